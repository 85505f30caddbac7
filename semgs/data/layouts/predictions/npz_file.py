"""The arrays of an `.npz` file, read one by one and never unpickled."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semgs.files.archives import MOST_BYTES, Member, members
from semgs.files.arrays import KINDS, read_array
from semgs.files.errors import InputError

ENDING = ".npy"


@dataclass(frozen=True)
class NpzFile:
    """An `.npz` file whose members are listed and not yet read.

    Attributes:
        path: the file.
        arrays: its members by the names of their arrays.
    """

    path: Path
    arrays: dict[str, Member]

    @property
    def names(self) -> Collection[str]:
        """The names of the arrays."""
        return self.arrays.keys()

    def first_of(self, names: Collection[str]) -> str | None:
        """The first of some names that an array has; None if there is none."""
        return next((name for name in names if name in self.arrays), None)

    def fits(self, name: str) -> bool:
        """Whether an array is small enough to be read."""
        return self.arrays[name].size <= MOST_BYTES

    def numbers(self, name: str, *, shape: str) -> np.ndarray:
        """An array of numbers, without axes of length 1 in front of those of each frame.

        Args:
            name: of the array.
            shape: what is expected, in words, for the error.

        Raises:
            InputError: the array is missing, damaged, too large or of another type; the length is checked before anything is read.
        """
        return self._read(name, KINDS, shape)

    def truths(self, name: str, *, shape: str) -> np.ndarray:
        """An array of truth values, or of numbers of which those but 0 are true; as `numbers`."""
        array = self._read(name, KINDS + "b", shape)
        return np.asarray(array.view(np.uint8) != 0 if array.dtype.kind == "b" else array != 0)

    def texts(self, name: str) -> list[str]:
        """A list of texts.

        Raises:
            InputError: as `numbers`.
        """
        member = self._member(name, "a list of texts")
        array = read_array(member, "U")
        if array.ndim != 1:
            raise InputError(self.path, "a list of texts", f"an array of shape {array.shape}", name)
        if not array.dtype.itemsize:
            return [""] * len(array)
        codes = np.ascontiguousarray(array).view(np.uint32)
        if codes.size and codes.max() > 0x10FFFF:
            raise InputError(self.path, "a list of texts", "characters that do not exist", name)
        return [str(text) for text in array]

    def _read(self, name: str, kinds: str, shape: str) -> np.ndarray:
        """An array of some types."""
        member = self._member(name, shape)
        if not self.fits(name):
            raise InputError(
                self.path, f"an array of at most {MOST_BYTES >> 20} MiB", f"one of {member.size >> 20:,} MiB", name,
                "save fewer photos in one file",
            )  # fmt: skip
        return read_array(member, kinds)

    def _member(self, name: str, shape: str) -> Member:
        """The member of an array."""
        if name not in self.arrays:
            raise InputError(self.path, shape, "nothing", name)
        return self.arrays[name]


def open_npz(path: Path) -> NpzFile:
    """List the arrays of an `.npz` file.

    Raises:
        InputError: it is not a zip archive, or is damaged.
    """
    return NpzFile(
        path, {name.removesuffix(ENDING): one for name, one in members(path).items() if name.endswith(ENDING)}
    )

"""The one error for input that a file holds and we cannot use."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from semgs.files.stored import Stored
from semgs.files.text import printable


class InputError(ValueError):
    """A file or folder that cannot be used: says which, what was expected, what was found, on one line that any terminal can show.

    The command line prints it and ends with exit code 2; a library caller catches it as a ValueError.

    Args:
        path: the file or folder at fault; of what lies inside another file, its text.
        expected: what would have been usable ("a 4x4 matrix of finite numbers").
        found: what was there instead ("a NaN in row 2").
        key: the place inside the file ("frames[3].transform_matrix"), None for the file itself.
        advice: what the user can do about it, None where it is obvious.
    """

    def __init__(
        self, path: str | Stored, expected: str, found: str, key: str | None = None, advice: str | None = None
    ) -> None:
        self.path = Path(str(path))
        self.key = key
        self.expected = expected
        self.found = found
        self.advice = advice
        place = f"{path}: {key}" if key else f"{path}"
        message = f"{place}: expected {expected}, found {found}"
        super().__init__(printable(" ".join((f"{message}; {advice}" if advice else message).split())))

    def __reduce__(self) -> tuple[type[InputError], tuple[Path, str, str, str | None, str | None]]:
        """How it travels between processes: by its parts, not by its message."""
        return type(self), (self.path, self.expected, self.found, self.key, self.advice)


@contextmanager
def readable(path: str | Path) -> Iterator[None]:
    """Around looking at what a user named: what the system refuses (no permission, a name too long) becomes an InputError.

    Args:
        path: what was named, for errors that do not say which file they are of.

    Raises:
        InputError: in place of an OSError.
    """
    try:
        yield
    except OSError as error:
        place = path if error.filename is None else str(error.filename)
        raise InputError(place, "something that can be read", error.strerror or str(error)) from error

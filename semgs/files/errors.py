"""The one error for input that a file holds and we cannot use."""

from __future__ import annotations

from pathlib import Path

from semgs.files.stored import Stored


class InputError(ValueError):
    """A file or folder that cannot be used: says which, what was expected, what was found, on one line.

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
        super().__init__(" ".join((f"{message}; {advice}" if advice else message).split()))

    def __reduce__(self) -> tuple[type[InputError], tuple[Path, str, str, str | None, str | None]]:
        """How it travels between processes: by its parts, not by its message."""
        return type(self), (self.path, self.expected, self.found, self.key, self.advice)

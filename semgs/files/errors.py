"""The errors for files that cannot be used, for libraries that are not installed, and for arguments of another type."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from semgs.files.stored import Stored
from semgs.files.text import printable, shortened

ERROR_LINE = "semgs: error: "
"""How the line begins that the command line prints on stderr for an error; programs that start it look for this."""


_TO_OTHERS = re.compile(r"[;,.]?\s*\bplease (?:report|file|open|raise|submit)\b[^.;]*", re.IGNORECASE)
"""What other libraries ask for in their messages, which is not for users of ours."""


class InputError(ValueError):
    """A file or folder that cannot be used: which one, what was expected, and what was found, in one printable line.

    The command line prints it and exits with code 2. In Python code, catch it as a ValueError.

    Args:
        path: the file or folder at fault, or the name of a file inside another.
        expected: what would be usable ("a 4x4 matrix of finite numbers").
        found: what is there instead ("a NaN in row 2"); the middle of a long value is left out.
        key: the place inside the file ("frames[3].transform_matrix"); None for the file itself.
        advice: what the user can do about it; None if that is obvious.
        page: what is wrong, for people who see no command line and no file; None is the same as on the command line, with the advice.
    """

    def __init__(
        self,
        path: str | Stored,
        expected: str,
        found: str,
        key: str | None = None,
        advice: str | None = None,
        page: str | None = None,
    ) -> None:
        self.path = Path(str(path))
        self.key = key
        self.expected = expected
        self.found = shortened(found)
        self.advice = advice
        self.page = page
        place = f"{path}: {shortened(key)}" if key else f"{path}"
        found = _TO_OTHERS.sub("", self.found)
        nested = found.startswith(f"{path}: ")  # an error about the same file says more
        message = found if nested else f"{place}: expected {expected}, found {found}"
        super().__init__(printable(" ".join((f"{message}; {advice}" if advice else message).split())))

    def __reduce__(self) -> tuple[type[InputError], tuple[object, ...]]:
        """Pickle the parts, not the message."""
        return type(self), (self.path, self.expected, self.found, self.key, self.advice, self.page)

    @property
    def on_page(self) -> str:
        """Its text for people who see no command line; paths are as given."""
        return str(self) if self.page is None else printable(" ".join(f"{self.path}: {self.page}".split()))


@contextmanager
def readable(path: str | Path) -> Iterator[None]:
    """Turn errors of the file system (no permission, name too long, a link that leads to itself) into InputErrors.

    Args:
        path: the path that the user gave, for errors that do not name a file.

    Raises:
        InputError: in place of an OSError, or of the RuntimeError of `Path.resolve` for such a link.
    """
    try:
        yield
    except RuntimeError as error:
        if not str(error).startswith("Symlink loop"):
            raise
        raise InputError(path, "something that can be read", "a link that leads to itself") from error
    except OSError as error:
        place = path if error.filename is None else str(error.filename)
        raise InputError(place, "something that can be read", error.strerror or str(error)) from error


@contextmanager
def input_error(path: str | Stored, expected: str, key: str | None = None, advice: str | None = None) -> Iterator[None]:
    """Turn a ValueError about the content of a file into an InputError that names the file.

    Args:
        path: the file.
        expected, key, advice: as for `InputError`.

    Raises:
        InputError: in place of a ValueError.
    """
    try:
        yield
    except InputError:
        raise
    except ValueError as error:
        raise InputError(path, expected, str(error), key, advice) from error


@contextmanager
def needs_extra(extra: str, need: str, library: str) -> Iterator[None]:
    """Import a library in this block. If it is not installed, the error says how to install it.

    Args:
        extra: brings the library.
        need: what needs it, in words: "videos need PyAV".
        library: as it is imported.

    Raises:
        ImportError: it is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise ImportError(f"{need}: pip install -e '.[{extra}]' in SemGS's folder", name=library) from error


def check_type(what: str, value: object, kind: type | tuple[type, ...], expected: str) -> None:
    """Refuse an argument of another type.

    Args:
        what: the argument with its verb: "the encoding is".
        value: what was given.
        kind: the types that it may have.
        expected: these in words, with where to get one.

    Raises:
        TypeError: it has another type.
    """
    if not isinstance(value, kind):
        raise TypeError(f"{what} {type(value).__name__}; expected {expected}")

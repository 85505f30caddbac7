"""Errors that the user can fix: one line and exit code 2, without a traceback."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager

from semgs.files.errors import InputError

BAD_INPUT = 2
"""The exit code for what cannot be used."""

_ADVICE = {
    errno.ENOSPC: "free some space or write elsewhere",
    errno.EDQUOT: "free some space or write elsewhere",
    errno.EFBIG: "raise the limit on the size of files (ulimit -f) or write elsewhere",
    errno.EMFILE: "raise the limit on open files (ulimit -n) or take fewer --workers",
    errno.ENOMEM: "free some memory, or raise the limit on it (ulimit -v)",
}
"""What the user can do about errors of the system."""

_REFUSED = (
    errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG, errno.EBUSY, errno.EIO, errno.ENFILE, errno.ENODEV, errno.ENXIO,
    errno.ESTALE, *_ADVICE,
)  # fmt: skip
"""Errors that the system may give any program; they are no bugs of ours."""

_NO_MEMORY = (
    "can't allocate memory", "not enough memory", "cannot allocate memory (", "failed to allocate", "failed to map segment",
    "can't start new thread",
)  # fmt: skip
"""How torch (the first three), OpenCV, the library loader and Python report that memory ran out, in lower case."""


class UsageError(Exception):
    """A command that cannot be run as given; its text is the line that the user sees.

    Attributes:
        on_page: the same for people who see no command line.
    """

    def __init__(self, line: str, on_page: str = "") -> None:
        super().__init__(line)
        self.on_page = on_page or line


def line_for(error: Exception) -> str | None:
    """The line to print for an error that the user can fix; None for a bug of ours, which keeps its traceback."""
    if isinstance(error, InputError):
        return str(error)
    if isinstance(error, UsageError):
        return str(error)
    if isinstance(error, ImportError) and "pip install" in str(error):
        return str(error)  # a missing extra
    if isinstance(error, ChildProcessError) and error.errno is None:
        return str(error)  # a killed worker
    if isinstance(error, MemoryError) or any(said in str(error).lower() for said in _NO_MEMORY):
        return f"there is not enough memory; {_ADVICE[errno.ENOMEM]}"
    if isinstance(error, OSError) and error.errno in _REFUSED:
        return _refused(error)
    return None


def _refused(error: OSError) -> str:
    """The line for an error of the system: which file, why, and what may help."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        place = "" if error.filename is None else f" ({error.filename})"
        return f"the disk is full{place}; {_ADVICE[error.errno]}"
    place = "" if error.filename is None else f"{error.filename}: "
    advice = _ADVICE.get(error.errno or 0)
    return f"{place}{error.strerror}; {advice}" if advice else f"{place}{error.strerror}"


@contextmanager
def what_the_user_gave() -> Iterator[None]:
    """Turn a ValueError about the user's input into a UsageError.

    Any other ValueError is a bug and keeps its traceback. An InputError needs no such block.

    Raises:
        UsageError: instead of a ValueError.
    """
    try:
        yield
    except ValueError as error:
        raise UsageError(str(error), getattr(error, "on_page", "")) from error


@contextmanager
def what_fits() -> Iterator[None]:
    """Turn a NotEnoughMemoryError of a reconstruction into a UsageError.

    Raises:
        UsageError: instead of a NotEnoughMemoryError.
    """
    from semgs.model.memory.memory_plan import NotEnoughMemoryError  # torch takes seconds to import

    try:
        yield
    except NotEnoughMemoryError as error:
        raise UsageError(f"{error}; see --size and --views", f"{error}; use fewer views or smaller photos") from error

"""Errors that are the user's to mend: one line and exit code 2, without a traceback."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager

from semgs.files.errors import InputError

_ADVICE = {
    errno.ENOSPC: "free some space or write elsewhere",
    errno.EDQUOT: "free some space or write elsewhere",
    errno.EFBIG: "raise the limit on the size of files (ulimit -f) or write elsewhere",
    errno.EMFILE: "raise the limit on open files (ulimit -n) or take fewer --workers",
    errno.ENOMEM: "free some memory, or raise the limit on it (ulimit -v)",
}
"""What to do about what the system refuses."""

_REFUSED = (
    errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG, errno.EBUSY, errno.EIO, errno.ENFILE, errno.ENODEV, errno.ENXIO,
    errno.ESTALE, *_ADVICE,
)  # fmt: skip
"""What a system may refuse to any program: none of it is a fault of ours."""

_NO_MEMORY = (
    "can't allocate memory", "not enough memory", "cannot allocate memory (", "failed to allocate", "failed to map segment",
    "can't start new thread",
)  # fmt: skip
"""How torch (the first three), OpenCV, the loader of libraries and Python say that no memory is left, in lower case."""


class UsageError(Exception):
    """A command that cannot be carried out as it was given; the text is the line that the user sees."""


def line_for(error: Exception) -> str | None:
    """The line that tells the user of an error that is theirs to mend; None for a fault of ours, which keeps its traceback."""
    if isinstance(error, (InputError, UsageError)):
        return str(error)
    if isinstance(error, ImportError) and "pip install" in str(error):
        return str(error)  # of an extra that the input needs
    if isinstance(error, MemoryError) or any(said in str(error).lower() for said in _NO_MEMORY):
        return f"there is not enough memory; {_ADVICE[errno.ENOMEM]}"
    if isinstance(error, OSError) and error.errno in _REFUSED:
        return _refused(error)
    return None


def _refused(error: OSError) -> str:
    """The line for what the system refuses: which file, why, and what may help."""
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        place = "" if error.filename is None else f" ({error.filename})"
        return f"the disk is full{place}; {_ADVICE[error.errno]}"
    place = "" if error.filename is None else f"{error.filename}: "
    advice = _ADVICE.get(error.errno or 0)
    return f"{place}{error.strerror}; {advice}" if advice else f"{place}{error.strerror}"


@contextmanager
def what_the_user_gave() -> Iterator[None]:
    """Around a call whose ValueError is about what the user typed: it becomes a UsageError.

    ValueErrors of other calls are faults of ours and keep their traceback. An InputError needs no such block.

    Raises:
        UsageError: in place of a ValueError.
    """
    try:
        yield
    except ValueError as error:
        raise UsageError(str(error)) from error


@contextmanager
def what_fits() -> Iterator[None]:
    """Around a reconstruction, which may need more memory than there is.

    Raises:
        UsageError: in place of a NotEnoughMemoryError.
    """
    from semgs.model.memory_plan import NotEnoughMemoryError  # torch takes seconds to import

    try:
        yield
    except NotEnoughMemoryError as error:
        raise UsageError(f"{error}; see --size and --views") from error

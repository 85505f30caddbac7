"""Errors that are the user's to mend: one line and exit code 2, without a traceback."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class UsageError(Exception):
    """A command that cannot be carried out as it was given; the text is the line that the user sees."""


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
    from semgs.model.plan import NotEnoughMemoryError  # torch takes seconds to import

    try:
        yield
    except NotEnoughMemoryError as error:
        raise UsageError(f"{error}; see --size and --views") from error

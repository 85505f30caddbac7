"""Anything that has the bytes of a file: a path, a member of a zip archive, a message of a ROS bag."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, runtime_checkable


@runtime_checkable
class Stored(Protocol):
    """A named file as readers use it. Every `Path` is one. `str()` gives the name for errors."""

    @property
    def name(self) -> str:
        """The name without folders ("000.png")."""
        ...

    @property
    def suffix(self) -> str:
        """The file name extension (".png")."""
        ...

    def is_file(self) -> bool:
        """Whether it exists."""
        ...

    def read_bytes(self) -> bytes:
        """The content.

        Raises:
            OSError: it cannot be read.
        """
        ...


def stored(path: str | Stored) -> Stored:
    """A text as a path; anything else as it is."""
    return Path(path) if isinstance(path, str) else path

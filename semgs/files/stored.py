"""What holds the bytes of a file, wherever they are: a path, a member of a zip archive, a message of a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol, runtime_checkable


@runtime_checkable
class Stored(Protocol):
    """Bytes with a name, as far as readers need them; every `Path` is one. Its text is how errors name it."""

    @property
    def name(self) -> str:
        """The name without folders ("000.png")."""
        ...

    @property
    def suffix(self) -> str:
        """The ending of the name, which tells the format (".png")."""
        ...

    def is_file(self) -> bool:
        """Whether it is there."""
        ...

    def read_bytes(self) -> bytes:
        """All of it.

        Raises:
            OSError: it cannot be read.
        """
        ...


def stored(path: str | Stored) -> Stored:
    """What was named, a text taken as a path."""
    return Path(path) if isinstance(path, str) else path

"""Libraries that an extra of SemGS installs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


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

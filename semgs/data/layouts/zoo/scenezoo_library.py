"""scenezoo itself: importing it, and its errors as ours. Only this module imports it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from semgs.files.errors import InputError
from semgs.files.extras import needs_extra


@contextmanager
def scenezoo_errors(path: Path) -> Iterator[None]:
    """Turn what scenezoo raises into an InputError that names the data set's folder."""
    try:
        yield
    except (InputError, ImportError):
        raise
    except Exception as error:  # SceneZooError, KeyError, ValueError, OSError, ...
        said = error.args[0] if error.args and isinstance(error.args[0], str) else str(error)
        raise InputError(path, "a data set that scenezoo can read", said or type(error).__name__) from error


def scenezoo_library() -> Any:
    """The library, with what it needs.

    Raises:
        ImportError: scenezoo or Open3D is not installed; the error names the extra to install.
    """
    with needs_extra("scenezoo", "reading this data set needs scenezoo", "scenezoo"):
        import open3d  # noqa: F401
        import scenezoo
    return scenezoo

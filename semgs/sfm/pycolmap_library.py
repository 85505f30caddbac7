"""pycolmap, which is optional: everything that needs it imports it from here."""

from __future__ import annotations

import platform
from types import ModuleType


def pycolmap() -> ModuleType:
    """The library.

    Raises:
        ImportError: it is not installed; says how to install it, or where it cannot be installed, what to do instead.
    """
    try:
        import pycolmap
    except ImportError as error:
        raise ImportError(_remedy(), name="pycolmap") from error
    pycolmap.logging.minloglevel = (
        pycolmap.logging.Level.FATAL.value
    )  # what it says about progress and failures is not for users
    return pycolmap


def _remedy() -> str:
    """How to install pycolmap on this machine, or what to do without it."""
    if platform.system() == "Linux" and platform.machine() == "aarch64":
        return (
            "pycolmap has no package for Linux on aarch64. Compute the cameras on another machine with semgs poses, "
            "or write a transforms.json with the cameras you know"
        )
    return "this needs pycolmap: pip install -e '.[sfm]' in SemGS's folder"

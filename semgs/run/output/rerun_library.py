"""rerun-sdk (extra `rerun`), which is optional. Nothing else imports it."""

from __future__ import annotations

from types import ModuleType

from semgs.files.errors import needs_extra


def rerun_library() -> ModuleType:
    """rerun, with its `blueprint`.

    Raises:
        ImportError: rerun-sdk is not installed.
    """
    with needs_extra("rerun", "--rerun needs rerun-sdk", "rerun"):
        import rerun
        import rerun.blueprint
    return rerun

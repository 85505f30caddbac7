"""rerun-sdk (extra `rerun`), which is optional. Nothing else imports it."""

from __future__ import annotations

from types import ModuleType


def rerun_library() -> ModuleType:
    """rerun, with its `blueprint`.

    Raises:
        ImportError: rerun-sdk is not installed.
    """
    try:
        import rerun
        import rerun.blueprint
    except ImportError as error:
        raise ImportError("--rerun needs rerun-sdk: pip install '.[rerun]' in SemGS's folder", name="rerun") from error
    return rerun

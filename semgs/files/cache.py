"""Where results are kept that can be made again: outside of data sets, which may be read-only or shared."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "SEMGS_CACHE"


def cache_folder() -> Path:
    """The folder that SEMGS_CACHE names, else `semgs` in XDG_CACHE_HOME or `~/.cache`; it need not exist. It may be deleted at any time."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "semgs"

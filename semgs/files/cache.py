"""The cache folder, for results that can be recomputed. It is outside the data sets, which may be read-only or shared."""

from __future__ import annotations

import os
from pathlib import Path

VARIABLE = "SEMGS_CACHE"


def cache_folder() -> Path:
    """The folder named by SEMGS_CACHE, else `semgs` in XDG_CACHE_HOME or `~/.cache`. It may not exist, and may be deleted at any time."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named).expanduser()
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "semgs"

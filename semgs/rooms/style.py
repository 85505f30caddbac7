"""Styles: the worlds that rooms can be of. No torch, so that the command line can list them at once."""

from __future__ import annotations

from typing import Literal, get_args

Style = Literal["home", "plain"]
"""`home` is furnished as people live; `plain` is boxes with noise textures, the baseline."""

STYLES: tuple[Style, ...] = get_args(Style)

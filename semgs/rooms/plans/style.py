"""Styles of rooms. Imports no torch, so the command line lists them quickly."""

from __future__ import annotations

from typing import Literal, get_args

Style = Literal["home", "other"]
"""`home`: furnished as people live. `other`: a different world, held out for model selection; nothing is trained on it."""

STYLES: tuple[Style, ...] = get_args(Style)

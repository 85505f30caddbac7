"""Styles of rooms. Imports no torch, so the command line lists them quickly."""

from __future__ import annotations

from typing import Literal, get_args

Style = Literal["home", "other", "closeup"]
"""`home`: furnished as people live. `other`: a different world, held out for model selection; nothing is trained on it. `closeup`: homes in
which one piece fills the image, in dark and strong colours."""

STYLES: tuple[Style, ...] = get_args(Style)

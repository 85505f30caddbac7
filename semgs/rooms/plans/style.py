"""Styles: the worlds that rooms can be of. No torch, so that the command line can list them at once."""

from __future__ import annotations

from typing import Literal, get_args

Style = Literal["home", "other"]
"""`home` is furnished as people live; `other` is a second world, held out: choices are made by it and nothing is trained in it."""

STYLES: tuple[Style, ...] = get_args(Style)

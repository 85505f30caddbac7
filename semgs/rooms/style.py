"""Styles: the worlds that rooms can be of, and how they are lit. No torch, so that the command line can list them at once."""

from __future__ import annotations

from typing import Literal, get_args

Style = Literal["home", "plain", "other"]
"""`home` is furnished as people live; `plain` is boxes with noise textures, the baseline; `other` is a second world, held out:
choices are made by it and nothing is trained in it."""

STYLES: tuple[Style, ...] = get_args(Style)

Render = Literal["shaded", "traced"]
"""`shaded` is quick, with shadows and a guess of what light comes round; `traced` follows light's paths from wall to wall."""

Renders = Literal["shaded", "traced", "mixed"]
"""How the scenes of a data set are lit: all of them one way, or by `mixed` one in ten traced."""

RENDERS: tuple[Renders, ...] = get_args(Renders)

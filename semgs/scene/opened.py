"""What commands show and write: a reconstruction of ours or of another program, with what is known about it beside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, UInt8
from torch import Tensor

from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import Up, UpDirection


@dataclass(frozen=True)
class OpenedScene:
    """A reconstruction, of ours or of another program.

    Attributes:
        scene: the scene.
        up: the direction that is up: "auto" to find it in the scene.
        pivot: the middle of a splat without cameras, which a video circles; None for other scenes.
        photos: of the views of a splat whose cameras came from a scene; None for other scenes.
        splat: whether it is a splat of another program.
        note: what is probably wrong with it, in a sentence; empty if nothing is.
    """

    scene: SavedScene
    up: Up | UpDirection = "auto"
    pivot: Float64[Tensor, " 3"] | None = None
    photos: tuple[UInt8[np.ndarray, "h w 3"], ...] | None = None
    splat: bool = False
    note: str = ""

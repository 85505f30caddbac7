"""The quick test before a reconstruction: a few frames, a few hundred features each."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from semgs.data.scene import Scene
from semgs.doctor.diagnosis import diagnose

MOST_FRAMES = 4
FEATURES = 400


def warnings_of(scene: Scene, frames: Sequence[int]) -> list[str]:
    """A warning for the user if the cameras or depth maps do not fit the images; none if they fit or nothing can be said.

    Args:
        scene: the scene.
        frames: positions of the frames that are used; the first `MOST_FRAMES` are tested.

    Raises:
        InputError: an image or a depth map cannot be read.
    """
    found = diagnose(scene, tuple(frames[:MOST_FRAMES]), FEATURES)
    if found.verdict != "suspicious":
        return []
    wrong = "depth maps" if np.isfinite(found.depth_focal) else "cameras"
    return [f"The {wrong} may be wrong. {found.sentence} semgs doctor tests all of the scene."]

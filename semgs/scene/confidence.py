"""How sure a scene is of each Gaussian."""

from __future__ import annotations

from jaxtyping import Float
from torch import Tensor

from semgs.rendering.temperatures import highest_probability
from semgs.scene.scene_file import SavedScene


def class_confidences(scene: SavedScene) -> Float[Tensor, " g"]:
    """The probability of each Gaussian's likeliest class, 0..1, calibrated if the scene has temperatures; for colour-only models that of its depth."""
    semantic = scene.gaussians.semantic
    if semantic is None:
        return scene.per_gaussian(scene.confidences)
    return highest_probability(semantic.features, None if scene.temperatures is None else scene.temperatures.gaussians)

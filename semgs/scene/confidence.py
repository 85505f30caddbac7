"""The class of each Gaussian, and how sure a scene is of it."""

from __future__ import annotations

import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from semgs.rendering.rendering import UNSEEN, class_numbers
from semgs.rendering.temperatures import highest_probability
from semgs.scene.scene_file import SavedScene


def class_confidences(scene: SavedScene) -> Float[Tensor, " g"]:
    """The probability of each Gaussian's likeliest class, 0..1, calibrated if the scene has temperatures; for colour-only models that of its depth."""
    semantic = scene.gaussians.semantic
    if semantic is None:
        return scene.per_gaussian(scene.confidences)
    return highest_probability(semantic.features, None if scene.temperatures is None else scene.temperatures.gaussians)


def class_labels(scene: SavedScene) -> UInt8[Tensor, " g"]:
    """The number of each Gaussian's likeliest class; `UNSEEN` where all classes are equally likely, as in Gaussians that no photo shows.

    Raises:
        ValueError: the scene has no classes, or more than can be told from `UNSEEN`.
    """
    semantic = scene.gaussians.semantic
    if semantic is None or semantic.features.shape[-1] > UNSEEN:
        raise ValueError(f"expected a scene with 1 to {UNSEEN} classes")
    return class_numbers(semantic.features).to(torch.uint8)

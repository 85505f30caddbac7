"""The class of each Gaussian, how sure a scene is of it, and which Gaussians to export."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import torch
from jaxtyping import Bool, Float, UInt8
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


def selected(
    scene: SavedScene, *, min_opacity: float = 0.0, min_confidence: float = 0.0, classes: Collection[str] = ()
) -> Bool[Tensor, " g"]:
    """The Gaussians to keep.

    Args:
        scene: with all of its Gaussians.
        min_opacity: the least opacity.
        min_confidence: the least `class_confidences`.
        classes: names of their likeliest class; empty for all.

    Raises:
        ValueError: the scene has no such class.
    """
    gaussians = scene.gaussians
    keep = (gaussians.opacities >= min_opacity) & (class_confidences(scene) >= min_confidence)
    if not classes:
        return keep
    if scene.classes is None or gaussians.semantic is None:
        raise ValueError(f"the scene has no classes; expected one with {', '.join(classes)}")
    for name in classes:
        if name not in scene.classes.names:
            raise ValueError(f"there is no class {name!r}; expected some of {', '.join(scene.classes.names)}")
    numbers = torch.tensor([scene.classes.names.index(name) for name in classes])
    return keep & torch.isin(class_numbers(gaussians.semantic.features), numbers)


def part_of(scene: SavedScene, keep: Bool[Tensor, " g"]) -> SavedScene:
    """The scene with some of its Gaussians only."""
    return replace(scene, gaussians=scene.gaussians.map(lambda tensor: tensor[keep]), places=scene.blocks[keep])

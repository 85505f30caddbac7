"""Which Gaussians of a scene to export."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import torch
from jaxtyping import Bool
from torch import Tensor

from semgs.rendering.rendering import class_numbers
from semgs.scene.confidence import class_confidences
from semgs.scene.scene_file import SavedScene


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
    places = None if scene.places is None else scene.places[keep]
    return replace(scene, gaussians=scene.gaussians.map(lambda tensor: tensor[keep]), places=places)

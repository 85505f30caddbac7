"""Images of a scene from any camera: colour, classes, depth and more."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, final

import numpy as np
import torch
from jaxtyping import UInt8

from semgs.figures.class_images import class_picture, overlay
from semgs.figures.view_images import as_bytes
from semgs.files.images.colours import depth_limits, depth_picture, heat_picture
from semgs.geometry.cameras import Cameras
from semgs.rendering.rendering import Rendering, check_may_be_unknown, confidence_maps, label_maps
from semgs.scene.scene_file import SavedScene

Show = Literal["colour", "classes", "overlay", "depth", "confidence", "alpha", "rgba"]
"""What an image shows: the colours over black; the classes, hatched where unseen; the colours tinted by class; the depth; the probability of the likeliest
class; the opacity; the colours with the opacity as transparency."""

OF_CLASSES = ("classes", "overlay", "confidence")
"""Images of scenes that have classes."""

LEAST_ALPHA = 1 / 255
"""The colour of pixels with less opacity would be noise."""

GAP_PX = 4
"""White between images side by side."""


@final
@dataclass(frozen=True)
class Stills:
    """Renders a scene, one camera after the other.

    Attributes:
        scene: the scene.
        shows: what to show; an image for each.
        min_confidence: pixels whose likeliest class is less likely are unknown.

    Raises:
        ValueError: `shows` is empty, or names classes and the scene has none, or has too many for some to be unknown.
    """

    scene: SavedScene
    shows: tuple[Show, ...]
    min_confidence: float = 0.0

    def __post_init__(self) -> None:
        if not self.shows:
            raise ValueError("expected something to show")
        missing = [show for show in self.shows if show in OF_CLASSES]
        if missing and self.scene.classes is None:
            raise ValueError(f"the scene has no classes, so it cannot show {missing[0]}")
        if self.scene.classes is not None and self.min_confidence > 0:
            check_may_be_unknown(len(self.scene.classes))

    def images(self, cameras: Cameras) -> Iterator[tuple[UInt8[np.ndarray, "h w channel"], ...]]:
        """For each camera [n] the images, in the order of `shows`."""
        limits = depth_limits([self.scene.depths.numpy()])  # one scale for the whole path
        for index in range(cameras.batch[0]):
            rendering = self.scene.render(cameras[index : index + 1], footprint=True)
            yield tuple(self._image(show, rendering, limits) for show in self.shows)

    def _image(self, show: Show, rendering: Rendering, limits: tuple[float, float]) -> UInt8[np.ndarray, "h w channel"]:
        """One image of a rendering of one view."""
        if show == "depth":
            return depth_picture(rendering.depths[0].numpy(), limits)
        if show == "alpha":
            return as_bytes(rendering.alphas.expand(3, -1, -1))
        if show == "rgba":
            straight = rendering.images[0] / rendering.alphas[0].clamp(min=LEAST_ALPHA)
            return as_bytes(torch.cat((straight, rendering.alphas)))
        colour = as_bytes(rendering.images[0])
        if show == "colour":
            return colour
        assert rendering.semantics is not None
        assert self.scene.classes is not None
        if show == "confidence":
            shares = confidence_maps(rendering)[0]
            return heat_picture(np.where(shares > 0, shares, np.nan), (0.0, 1.0))
        labels = label_maps(rendering, self.min_confidence)[0]
        if show == "classes":
            return class_picture(labels, self.scene.classes)
        return overlay(colour, labels, self.scene.classes)


def side_by_side(images: Sequence[UInt8[np.ndarray, "h w 3"]]) -> UInt8[np.ndarray, "h columns 3"]:
    """Images of one height in a row, with white between them."""
    gap = np.full((images[0].shape[0], GAP_PX, 3), 255, np.uint8)
    parts = [part for image in images for part in (gap, image)][1:]
    return np.concatenate(parts, axis=1)

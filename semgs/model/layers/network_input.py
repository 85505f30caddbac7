"""NetworkInput: a batch of scenes in the form that the layers take; and chunks, by which they take a few views at a time, to save memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import avg_pool2d, interpolate, pad

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras
from semgs.scene.encoding import Encoding

MULTIPLE = 16
"""Sides of the images are padded to a multiple of this."""


@dataclass(frozen=True)
class NetworkInput:
    """A batch of b scenes of v views each, padded below and right; n = b v images, scene by scene.

    Attributes:
        images: on the network's device and in its dtype.
        small: the same images at the Gaussians' scale.
        cameras: of the padded images, [b v].
        depth_range: near and far of each view [m].
        views: v.
    """

    images: Float[Tensor, "n 3 h w"]
    small: Float[Tensor, "n 3 h2 w2"]
    cameras: Cameras
    depth_range: Float[Tensor, "b v 2"]
    views: int

    @staticmethod
    def of(views: Views, like: Tensor, stride: int) -> NetworkInput:
        """From views of one scene, or of scenes with any leading axes.

        Args:
            views: with images of any size.
            like: a tensor on the device and in the dtype of the network.
            stride: pixels per Gaussian along each side.
        """
        count, (height, width) = len(views), views.size
        padded = padded_size(views.size)
        images = views.images.flatten(end_dim=-4).to(like)
        if padded != (height, width):
            images = pad(images, (0, padded[1] - width, 0, padded[0] - height), mode="replicate")
        small = avg_pool2d(images, stride) if stride > 1 else images
        cameras = views.cameras.arranged(lambda array: array.reshape(-1, count, *array.shape[-2:]))
        cameras = Cameras.trusted(cameras.world_from_camera, cameras.intrinsics, padded)
        return NetworkInput(images, small, cameras, views.depth_range.reshape(-1, count, 2), count)

    def mirrored(self, view: int, size: tuple[int, int]) -> NetworkInput:
        """The mirror image of one view, resized, for layers that do not use cameras: it keeps those of the views.

        Args:
            view: its position.
            size: (height, width), multiples of 16 [px].
        """
        image = interpolate(
            self.images[view : view + 1].flip(-1), size, mode="bicubic", antialias=True, align_corners=False
        ).clamp(0, 1)
        stride = self.images.shape[-1] // self.small.shape[-1]
        return replace(self, images=image, small=avg_pool2d(image, stride))

    def only(self, views: Sequence[int]) -> NetworkInput:
        """Some of the views, for layers that do not use cameras: it keeps those of all."""
        return replace(self, images=self.images[views], small=self.small[views])

    @property
    def near(self) -> Float[Tensor, " b"]:
        """The smallest near bound of each scene's views [m]."""
        return self.depth_range[..., 0].amin(-1)


def padded_size(size: tuple[int, ...]) -> tuple[int, int]:
    """The (height, width) of images after padding [px]."""
    height, width = (-(-side // MULTIPLE) * MULTIPLE for side in size)
    return height, width


def widen(maps: Float[Tensor, "*n h w"], stride: int) -> Float[Tensor, "*n h2 w2"]:
    """Each pixel of the maps repeated `stride` times along both sides."""
    return maps.repeat_interleave(stride, -1).repeat_interleave(stride, -2)


@dataclass(frozen=True)
class Chunks:
    """How many views to process at a time; None is all. Results only change by rounding.

    Attributes:
        cost: reference views of the cost volume.
        heads: views whose features are upsampled and become Gaussians.

    Raises:
        ValueError: one of them is less than 1.
    """

    cost: int | None = None
    heads: int | None = None

    def __post_init__(self) -> None:
        for name, count in (("cost", self.cost), ("heads", self.heads)):
            if count is not None and count < 1:
                raise ValueError(f"{name} is {count}; expected 1 view or more at a time, or None for all")


WHOLE = Chunks()
"""All views at once."""


Result = TypeVar("Result", Tensor, Encoding)


def by_chunks(function: Callable[[slice], Result], views: int, at_a_time: int | None) -> Result:
    """The result of `function` for all views, which it computes for some of them at a time.

    Args:
        function: takes a slice of the views; every tensor of its result has the views along its first axis.
        views: number of views.
        at_a_time: views for one call; None is all.
    """
    if at_a_time is None or at_a_time >= views:
        return function(slice(0, views))
    whole: Result | None = None
    for start in range(0, views, at_a_time):
        at = slice(start, min(start + at_a_time, views))
        part = function(at)
        # Filled in place: to join all parts at the end would need twice the memory.
        if whole is None:
            whole = _mapped(part, lambda tensor: tensor.new_empty(views, *tensor.shape[1:]))
        for target, tensor in zip(_tensors(whole), _tensors(part), strict=True):
            target[at] = tensor
    assert whole is not None
    return whole


def _mapped(result: Result, function: Callable[[Tensor], Tensor]) -> Result:
    """The function of a tensor, or of every tensor of an encoding."""
    return function(result) if isinstance(result, Tensor) else result.map(function)


def _tensors(result: Tensor | Encoding) -> list[Tensor]:
    """The tensors of a result, in a fixed order."""
    return [result] if isinstance(result, Tensor) else result.tensors()

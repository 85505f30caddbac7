"""NetworkInput: a batch of scenes in the form that the layers take."""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import avg_pool2d, pad

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras

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

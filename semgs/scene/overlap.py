"""Overlap: how many of a scene's input views see a point, and what follows for the sizes of Gaussians. Not in the paper."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.geometry.cameras import Cameras, inverse_rigid
from semgs.runtime.precision import outside_autocast

PAIR = 2
"""The number of views for which sizes stay as predicted: the included weights learned mostly from pairs."""


@dataclass(frozen=True)
class Others:
    """Projections from the camera frames of n views to the images of the m other views of the same scene, on the features' device.

    A point x in a view's own camera frame is at (u z, v z, z) = matrix x + offset, with (u, v) in pixels of the other image and z the
    depth there [m]. Only relative poses are used, so float32 is precise even far from the origin.

    Attributes:
        matrix: K R.
        offset: K t.
        size: (height, width) of the images [px].
    """

    matrix: Float[Tensor, "n m 3 3"]
    offset: Float[Tensor, "n m 3"]
    size: tuple[int, int]

    @staticmethod
    def of(cameras: Cameras, size: tuple[int, int], like: Tensor) -> Others:
        """From the cameras [b v] of b scenes, computed in float64.

        Args:
            cameras: of all views.
            size: (height, width) of the images before padding [px].
            like: a tensor with the device and dtype of the result.
        """
        poses, count = cameras.world_from_camera, cameras.batch[-1]
        own = torch.arange(count)[:, None]
        other = torch.tensor([[j for j in range(count) if j != i] for i in range(count)])
        other_from_own = inverse_rigid(poses)[:, other] @ poses[:, own]
        intrinsics = cameras.intrinsics[:, other]
        matrix = intrinsics @ other_from_own[..., :3, :3]
        offset = (intrinsics @ other_from_own[..., :3, 3:])[..., 0]
        return Others(matrix.flatten(0, 1).to(like), offset.flatten(0, 1).to(like), size)

    def __getitem__(self, at: slice) -> Others:
        """The projections of some of the n views."""
        return Others(self.matrix[at], self.offset[at], self.size)


@outside_autocast
def seen_by(points: Float[Tensor, "n h w 3"], others: Others) -> Float[Tensor, "n h w"]:
    """How many input views of its scene see each point: its own view, and all others with the point in front and inside the image.

    Occlusion is ignored.

    Args:
        points: in the frame of each view's own camera [m].
        others: of the same views.
    """
    height, width = others.size
    flat = points.detach().flatten(1, 2).mT
    count = flat.new_ones(flat.shape[0], flat.shape[2])
    for matrix, offset in zip(others.matrix.unbind(1), others.offset.unbind(1), strict=True):
        x, y, z = (matrix @ flat + offset[..., None]).unbind(1)
        count += (x >= 0) & (x < width * z) & (y >= 0) & (y < height * z)  # never true behind the camera, where z < 0
    return torch.unflatten(count, 1, points.shape[1:3])


def shrinkage(seen: Float[Tensor, "*n"], exponent: float) -> Float[Tensor, "*n"]:
    """(2 / max(n, 2))^exponent: factor for the sizes of a Gaussian that n input views see.

    Each view that sees a surface puts Gaussians there. At unchanged size, more views would make surfaces thicker, and colours too strong,
    because they were learned for the Gaussians of two views.
    """
    return (PAIR / seen.clamp(min=PAIR)) ** exponent

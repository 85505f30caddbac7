"""Overlap: by how many of a scene's input views a point is seen. What follows from it for Gaussians is not in the paper."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.geometry.cameras import Cameras, inverse_rigid
from semgs.model.precision import outside_autocast

PAIR = 2
"""The number of views for which sizes stay as predicted: most of what the shipped weights learned came from pairs."""


@dataclass(frozen=True)
class Others:
    """From the frames of n views' cameras to the pictures of the m other views of each one's scene, on the features' device.

    A point x in the frame of a view's own camera is at (u z, v z, z) = matrix x + offset, with (u, v) in pixels of the other picture
    and z the depth there [m]. Only relative poses enter, so a scene far from the origin loses nothing in float32.

    Attributes:
        matrix: K R.
        offset: K t.
        size: (height, width) of the pictures [px].
    """

    matrix: Float[Tensor, "n m 3 3"]
    offset: Float[Tensor, "n m 3"]
    size: tuple[int, int]

    @staticmethod
    def of(cameras: Cameras, size: tuple[int, int], like: Tensor) -> Others:
        """Of the cameras [b v] of b scenes, computed in float64.

        Args:
            cameras: of all views.
            size: (height, width) of their pictures before these were padded [px].
            like: a tensor of the device and dtype to compute with.
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
        """Those of some of the n views."""
        return Others(self.matrix[at], self.offset[at], self.size)


@outside_autocast
def seen_by(points: Float[Tensor, "n h w 3"], others: Others) -> Float[Tensor, "n h w"]:
    """By how many input views of its scene each point is seen: its own, and the others that it is in front of and within the borders of.

    Nothing hides a point: what stands before it in another view does not count.

    Args:
        points: in the frame of each view's own camera [m].
        others: of the same views.
    """
    height, width = others.size
    flat = points.detach().flatten(1, 2).mT
    count = flat.new_ones(flat.shape[0], flat.shape[2])
    for matrix, offset in zip(others.matrix.unbind(1), others.offset.unbind(1), strict=True):
        x, y, z = (matrix @ flat + offset[..., None]).unbind(1)
        count += (
            (x >= 0) & (x < width * z) & (y >= 0) & (y < height * z)
        )  # nothing behind the camera, where z < 0, is within these
    return torch.unflatten(count, 1, points.shape[1:3])


def shrinkage(seen: Float[Tensor, "*n"], exponent: float) -> Float[Tensor, "*n"]:
    """(2 / max(n, 2))^exponent: what the sizes of a Gaussian are multiplied by that n input views see.

    Each view that sees a surface puts Gaussians there. Left at their size, more views would make surfaces thicker, and the learned colours,
    which are made for what two views draw, too strong.
    """
    return (PAIR / seen.clamp(min=PAIR)) ** exponent

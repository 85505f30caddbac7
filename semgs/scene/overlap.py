"""Overlap: how many of a scene's input views see a point, what follows for the sizes of Gaussians, and rendering from the nearest views only. Not in the paper."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from semgs.geometry.cameras import Cameras, inverse_rigid, project
from semgs.runtime.precision import outside_autocast
from semgs.scene.encoding import Encoding

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


@dataclass(frozen=True)
class NearestViews:
    """Chooses, for each target, the Gaussians of the input views that are nearest to it.

    Their sizes become what they would be if there were no other input views (`shrinkage`).

    Attributes:
        count: how many input views; with fewer, all are used.
        shrink_seen: exponent of the network's rule for sizes, `ColourSettings.shrink_seen`.

    Raises:
        ValueError: `count` is not positive.
    """

    count: int
    shrink_seen: float

    def __post_init__(self) -> None:
        if self.count < 1:
            raise ValueError(f"count is {self.count}; expected at least one input view")

    def chosen(self, contexts: Cameras, target: Cameras) -> list[int]:
        """Positions of the chosen input views, ascending: those whose optical centres are nearest to the target's.

        Args:
            contexts: of the input views [v].
            target: one camera, with or without a leading axis of 1.
        """
        distances = (contexts.centres - target.centres.reshape(3)).norm(dim=-1)
        return sorted(distances.argsort(stable=True)[: self.count].tolist())

    def __call__(self, encoding: Encoding, contexts: Cameras, target: Cameras) -> Encoding:
        """The encoding with the chosen views' Gaussians.

        Args:
            encoding: of one scene.
            contexts: of its input views [v].
            target: as for `chosen`.
        """
        chosen = self.chosen(contexts, target)
        if len(chosen) == contexts.batch[0]:
            return encoding
        gaussians = encoding.gaussians.map(
            lambda tensor: tensor.unflatten(0, (contexts.batch[0], -1))[chosen].flatten(0, 1)
        )
        within = inside(gaussians.means, contexts)
        within[:, chosen] |= _own(gaussians.means, len(chosen))
        before = within.sum(-1).to(gaussians.means)
        after = within[:, chosen].sum(-1).to(gaussians.means)
        growth = shrinkage(after, self.shrink_seen) / shrinkage(before, self.shrink_seen)
        colour = replace(gaussians.colour, scales=gaussians.colour.scales * growth[:, None])
        return replace(
            encoding,
            gaussians=replace(gaussians, colour=colour),
            depths=encoding.depths[chosen],
            confidences=encoding.confidences[chosen],
            depth_spread=encoding.depth_spread[chosen],
            depth_range=encoding.depth_range[chosen],
        )


def inside(means: Float[Tensor, "g 3"], cameras: Cameras) -> Bool[Tensor, "g v"]:
    """Whether each mean is in front of each camera and inside its image."""
    height, width = cameras.size
    x, y, z = project(means.double().cpu().expand(*cameras.batch, -1, 3), cameras).unbind(-1)
    return ((z > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)).T.to(means.device)


def _own(means: Float[Tensor, "g 3"], views: int) -> Bool[Tensor, "g views"]:
    """Whether each Gaussian is of each view, in the order view, row, column."""
    return torch.eye(views, dtype=torch.bool, device=means.device).repeat_interleave(len(means) // views, 0)

"""Rendering a target with the Gaussians of the nearest input views only. Not in the paper."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from semgs.geometry.cameras import Cameras, project
from semgs.scene.encoding import Encoding
from semgs.scene.overlap import shrinkage


@dataclass(frozen=True)
class NearestViews:
    """Chooses, for each target, the Gaussians of the input views that are nearest to it.

    Their sizes become what they would be if there were no other input views (`semgs.scene.overlap`).

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

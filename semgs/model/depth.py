"""Depth by plane sweep: cost volume, and the probability of each depth candidate.

In `base` and `mvsplat` layer shapes and names are MVSplat's, so that its weights load.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.geometry.plane_sweep import depth_candidates, expected_depth
from semgs.model.conventions import Conventions
from semgs.model.cost_volume import cost_volume, unit_features
from semgs.model.layout import beside
from semgs.model.scene import Padded
from semgs.model.stages import Stage
from semgs.model.unet import GROUPS, UNet


@dataclass(frozen=True)
class Depth:
    """What the plane sweep says of n views at 1/4 of the images, in float32 or better.

    Attributes:
        probabilities: of the candidates.
        planes: depth of each candidate [m].
        bounds: near and far [m].
        conventions: say how candidates are sampled.
    """

    probabilities: Float[Tensor, "n l h4 w4"]
    planes: Float[Tensor, "n l"]
    bounds: Float[Tensor, "n 2"]
    conventions: Conventions

    def __getitem__(self, at: slice) -> Depth:
        """That of some of the views."""
        return Depth(self.probabilities[at], self.planes[at], self.bounds[at], self.conventions)

    def confidences(self, factor: int) -> Float[Tensor, "n h w"]:
        """The largest probability, repeated to maps `factor` times as large."""
        return self.probabilities.amax(1).repeat_interleave(factor, -1).repeat_interleave(factor, -2)

    def expected(self) -> Float[Tensor, "n h4 w4"]:
        """The expectation over the candidates [m]."""
        return expected_depth(self.probabilities, self.planes, self.conventions.candidates)


class PlaneSweepDepth(nn.Module):
    """The paper's depth: correlate the views' features at each candidate, and make probabilities of the cost.

    Args:
        regressor: from cost and features to logits.
        candidates: L.
        cosine_cost: correlate features of equal length (`semgs.model.settings.DepthSettings`).
        conventions: of geometry.
    """

    def __init__(self, regressor: CostRegressor, candidates: int, cosine_cost: bool, conventions: Conventions) -> None:
        super().__init__()
        self.regressor = regressor
        self.candidates = candidates
        self.cosine_cost = cosine_cost
        self.conventions = conventions

    def forward(
        self, features: Float[Tensor, "n c h4 w4"], scene: Padded, views_at_a_time: int | None, stage: Stage
    ) -> Depth:
        """Probabilities of the depth candidates; within autocast the regressor alone computes in half precision.

        Args:
            features: of the colour transformer.
            scene: the views that they are of.
            views_at_a_time: reference views whose costs are computed together; None is all.
            stage: stands around the stages `cost_volume` and `depth`.
        """
        precise = torch.promote_types(features.dtype, torch.float32)
        bounds = scene.depth_range.to(features.device, precise)
        planes = depth_candidates(scene.depth_range, self.candidates, self.conventions.candidates).to(bounds)
        with stage("cost_volume"):
            matched = unit_features(features) if self.cosine_cost else features
            cost = cost_volume(
                matched.unflatten(0, scene.cameras.batch),
                scene.cameras,
                bounds[..., 0],
                planes,
                self.conventions,
                views_at_a_time=views_at_a_time,
            ).flatten(0, 1)
        with stage("depth"):
            logits: Tensor = self.regressor(cost, features, scene.views)
            probabilities = logits.to(precise).softmax(1)
        return Depth(probabilities, planes.flatten(0, 1), bounds.flatten(0, 1), self.conventions)


class CostRegressor(nn.Module):
    """The probability of each depth candidate from cost and features: U-Net, then two convolutions.

    Args:
        channels: of the features.
        candidates: L.
        width: of the U-Net.
        hidden: width between the two last convolutions.
        levels, decoder_blocks: of the U-Net.
        cost_prior: the logits are a correction of the cost itself, from normalised features.
    """

    def __init__(
        self,
        channels: int,
        candidates: int,
        width: int,
        hidden: int,
        levels: int = 3,
        decoder_blocks: int = 2,
        cost_prior: bool = False,
    ) -> None:
        super().__init__()
        self.norm = nn.GroupNorm(GROUPS, candidates) if cost_prior else None
        inputs = channels + candidates
        self.refine = nn.ModuleList(
            [
                nn.Conv2d(inputs, width, 3, padding=1),
                nn.GroupNorm(GROUPS, width),
                nn.GELU(),
                UNet(width, levels, decoder_blocks),
                nn.Conv2d(width, candidates, 3, padding=1),
            ]
        )
        self.residual = nn.Conv2d(inputs, candidates, 1)
        self.head = nn.Sequential(
            nn.Conv2d(candidates, hidden, 3, padding=1), nn.GELU(), nn.Conv2d(hidden, candidates, 3, padding=1)
        )

    def forward(
        self, cost: Float[Tensor, "n l h w"], features: Float[Tensor, "n c h w"], views: int
    ) -> Float[Tensor, "n l h w"]:
        """Logits over the candidates; `views` of them belong to a scene."""
        x = beside(cost, features)
        conv, norm, activation, unet, last = self.refine
        refined = last(unet(activation(norm(conv(x))), views)) + self.residual(x)
        if self.norm is None:
            return self.head(refined)
        return cost + self.head(self.norm(refined))

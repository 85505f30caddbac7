"""Depth by plane sweep: cost volume, and the probability of each depth candidate.

In `base` and `mvsplat`, layer shapes and names are those of MVSplat, so that its weights load.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.geometry.plane_sweep import depth_candidates
from semgs.model.classes.refinement import Cues
from semgs.model.layers.cnn import beside
from semgs.model.layers.network_input import NetworkInput, by_chunks, widen
from semgs.model.settings import Conventions, DepthSettings
from semgs.model.sweep.cost_volume import CostFilter, cost_volume, unit_features
from semgs.model.sweep.unet import GROUPS, UNet
from semgs.runtime.precision import FullPrecisionConv2d


@dataclass(frozen=True)
class Planes:
    """The depth candidates of n views, in float32 or better.

    Attributes:
        depths: of each candidate [m].
        bounds: near and far [m].
    """

    depths: Float[Tensor, "n l"]
    bounds: Float[Tensor, "n 2"]

    def __getitem__(self, at: slice) -> Planes:
        """The candidates of some of the views."""
        return Planes(self.depths[at], self.bounds[at])


@dataclass(frozen=True)
class Depth:
    """The plane sweep's depth of n views at 1/4 of the images.

    Attributes:
        probabilities: of the candidates.
        planes: the candidates.
    """

    probabilities: Float[Tensor, "n l h4 w4"]
    planes: Planes

    def __getitem__(self, at: slice) -> Depth:
        """The depth of some of the views."""
        return Depth(self.probabilities[at], self.planes[at])

    def confidences(self, factor: int) -> Float[Tensor, "n h w"]:
        """The largest probability, repeated to maps `factor` times as large."""
        return widen(self.probabilities.amax(1), factor)

    def spread(self, factor: int) -> Float[Tensor, "n h w"]:
        """Standard deviation of log depth under the probabilities, repeated to maps `factor` times as large; without gradient."""
        probabilities = self.probabilities.detach()

        def spread(at: slice) -> Tensor:
            logs = self.planes.depths[at].log()[..., None, None]
            mean = (probabilities[at] * logs).sum(1, keepdim=True)
            return (probabilities[at] * (logs - mean).square()).sum(1).sqrt()

        # A view at a time stays in the cache: half the time.
        return widen(by_chunks(spread, len(probabilities), 1), factor)


class PlaneSweepDepth(nn.Module):
    """The paper's depth: correlate the views' features for each candidate, and turn the cost into probabilities.

    Args:
        regressor: from cost and features to logits.
        settings: of depth; only `candidates` and `cosine_cost` are used.
        conventions: of geometry.
        cost_filter: filters the cost before the regressor; None for no filter.
    """

    def __init__(
        self,
        regressor: CostRegressor,
        settings: DepthSettings,
        conventions: Conventions,
        cost_filter: CostFilter | None = None,
    ) -> None:
        super().__init__()
        self.regressor = regressor
        self.filter = cost_filter
        self.settings = settings
        self.conventions = conventions

    def cost(
        self, features: Float[Tensor, "n c h4 w4"], inputs: NetworkInput, views_at_a_time: int | None
    ) -> Float[Tensor, "n l h4 w4"]:
        """The cost volume of all views.

        Args:
            features: of the colour transformer.
            inputs: the views.
            views_at_a_time: reference views to compute at a time; None is all.
        """
        planes, batch = self.planes(features, inputs), inputs.cameras.batch
        matched = unit_features(features) if self.settings.cosine_cost else features
        return cost_volume(
            torch.unflatten(matched, 0, batch),
            inputs.cameras,
            torch.unflatten(planes.bounds[:, 0], 0, batch),
            torch.unflatten(planes.depths, 0, batch),
            self.conventions,
            views_at_a_time=views_at_a_time,
        ).flatten(0, 1)

    @property
    def reads_cues(self) -> bool:
        """Whether it reads cues from the class branch."""
        return self.regressor.cues is not None

    def forward(
        self,
        cost: Float[Tensor, "n l h4 w4"],
        features: Float[Tensor, "n c h4 w4"],
        inputs: NetworkInput,
        cues: Cues = (),
    ) -> Depth:
        """Probabilities of the depth candidates. Within autocast, only filter and regressor compute in half precision.

        Args:
            cost: from `cost`.
            features: of the colour transformer.
            inputs: the views.
            cues: from the class branch; only used with `reads_cues`.
        """
        planes = self.planes(features, inputs)
        if self.filter is not None:
            cost = self.filter(cost)
        logits: Tensor = self.regressor(cost, features, inputs.views, cues)
        return Depth(logits.to(planes.depths).softmax(1), planes)

    def planes(self, features: Tensor, inputs: NetworkInput) -> Planes:
        """The candidates on the features' device, in their dtype or at least float32."""
        bounds = inputs.depth_range.to(features.device, torch.promote_types(features.dtype, torch.float32))
        depths = depth_candidates(inputs.depth_range, self.settings.candidates, self.conventions.candidates).to(bounds)
        return Planes(depths.flatten(0, 1), bounds.flatten(0, 1))


class CostRegressor(nn.Module):
    """The probability of each depth candidate from cost and features: U-Net, then two convolutions.

    Args:
        channels: of the features.
        settings: of depth.
        cue_widths: channels of the class branch's cues, maps at 1/2 and 1/4 of the cost's size; they start without influence. Empty for
            no cues.
    """

    def __init__(self, channels: int, settings: DepthSettings, cue_widths: tuple[int, ...] = ()) -> None:
        super().__init__()
        candidates, width, hidden = settings.candidates, settings.width, settings.hidden
        self.norm = nn.GroupNorm(GROUPS, candidates) if settings.cost_prior else None
        inputs = channels + candidates
        first = nn.Conv2d(inputs, width, 3, padding=1)
        unet = UNet(width, settings.levels, settings.decoder_blocks)
        last = nn.Conv2d(width, candidates, 3, padding=1)
        self.refine = nn.ModuleList([first, nn.GroupNorm(GROUPS, width), nn.GELU(), unet, last])
        self.residual = nn.Conv2d(inputs, candidates, 1)
        self.head = nn.Sequential(
            nn.Conv2d(candidates, hidden, 3, padding=1),
            nn.GELU(),
            FullPrecisionConv2d(hidden, candidates, 3, padding=1),
        )
        self.cues = nn.ModuleList(_cue(one, width) for one in cue_widths) if cue_widths else None

    def forward(
        self, cost: Float[Tensor, "n l h w"], features: Float[Tensor, "n c h w"], views: int, cues: Cues = ()
    ) -> Float[Tensor, "n l h w"]:
        """Logits over the candidates; `views` of them belong to a scene."""
        x = beside(cost, features)
        conv, norm, activation, unet, last = self.refine
        seen = () if self.cues is None else tuple(look(cue) for look, cue in zip(self.cues, cues, strict=True))
        refined = last(unet(activation(norm(conv(x))), views, seen)) + self.residual(x)
        logits: Tensor = self.head(refined) if self.norm is None else cost + self.head(self.norm(refined))
        return logits


def _cue(inputs: int, outputs: int) -> nn.Sequential:
    """From a cue to what a level of the U-Net adds; it starts at zero."""
    last = nn.Conv2d(outputs, outputs, 1)
    for parameter in last.parameters():
        nn.init.zeros_(parameter)
    return nn.Sequential(nn.GroupNorm(GROUPS, inputs), nn.Conv2d(inputs, outputs, 3, padding=1), nn.GELU(), last)

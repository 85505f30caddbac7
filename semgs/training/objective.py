"""The objective: a network and what it is trained for, as the one module that the engine wraps."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from semgs.data.classes import IGNORE
from semgs.data.views import Batch, Views, joined
from semgs.model.encoding import Encoding
from semgs.objectives.losses import cross_entropy, depth_error, losses
from semgs.objectives.metrics import psnr
from semgs.rendering.rendering import Rendering
from semgs.training.settings import TrainingSettings

TERMS = ("total", "semantic", "colour", "smoothness", "depth", "psnr", "unlabelled")
"""What the objective says of a batch; only `total` has a gradient."""


class Objective(nn.Module):
    """From a batch to the terms of its loss: encode the contexts, render the targets, compare.

    Every term is a mean over scenes, so that the means of equal shares of a batch average to that of the whole.
    """

    def __init__(self, network: Any) -> None:
        super().__init__()
        self.network = network

    def forward(self, batch: Batch, settings: TrainingSettings) -> dict[str, Tensor]:
        """Each of `TERMS` as a number, `total` with its gradient; all are NaN where the Gaussians cannot be drawn."""
        if settings.supervision == "pictures":
            return self._of_labels(_joined(batch.target, batch.context), settings, alone=True)
        if settings.supervision == "labels":
            return self._of_labels(batch.context, settings)
        encoding = self.network(batch.context)
        if not _can_be_drawn(encoding):
            return _broken(encoding)
        rendering, target = render_targets(encoding, batch, settings.context_targets)
        assert not isinstance(settings.class_weights, str)  # the survey of the data made them numbers
        terms = losses(rendering, target, settings.losses, class_weights=settings.class_weights)
        depth = torch.zeros_like(terms.total)
        if settings.depth_weight and batch.context.depths is not None:
            depth = depth_error(encoding.depths, batch.context.depths.to(encoding.depths.device))
        found = {
            "semantic": terms.semantic,
            "colour": terms.colour,
            "smoothness": terms.smoothness,
            "depth": depth,
            "psnr": psnr(rendering.images, target.images).mean(),
            "unlabelled": terms.total.new_tensor(float(terms.unlabelled)),
        }
        return {"total": terms.total + settings.depth_weight * depth} | {
            name: term.detach() for name, term in found.items()
        }

    def _of_labels(self, views: Views, settings: TrainingSettings, alone: bool = False) -> dict[str, Tensor]:
        """The terms where only the classes of the views' own pixels count; nothing is rendered, so there is no PSNR.

        With `alone` no view learns from another.

        Raises:
            ValueError: the views have no labels.
        """
        distributions = self.network.classify(views, alone)
        if views.labels is None:
            raise ValueError(f"the scenes have no labels; supervision by {settings.supervision} needs them")
        assert not isinstance(settings.class_weights, str)
        labels = views.labels.to(distributions.device).flatten(end_dim=-3)
        total = cross_entropy(distributions.flatten(end_dim=-4), labels, settings.class_weights).mean()
        none = total.new_zeros(())
        unlabelled = (labels == IGNORE).flatten(1).all(1).sum().to(total)
        found = dict.fromkeys(TERMS, none) | {"semantic": total.detach(), "psnr": none + torch.nan}
        return found | {"total": total, "unlabelled": unlabelled}


def render_targets(encoding: Encoding, batch: Batch, context_targets: bool = False) -> tuple[Rendering, Views]:
    """The Gaussians of the contexts as the targets see them (and the contexts, if asked), and what they should see.

    The near bound is the smallest of each scene's contexts, as for its encoding. Both are on the Gaussians' device.
    """
    target = _joined(batch.target, batch.context) if context_targets else batch.target
    rendering = encoding.render(target.cameras)
    return rendering, target.to(rendering.images.device)


def _can_be_drawn(encoding: Encoding) -> bool:
    """Whether every number of the Gaussians is finite."""
    finite: list[bool] = []

    def look(tensor: Tensor) -> Tensor:
        finite.append(bool(torch.isfinite(tensor.detach()).all()))
        return tensor

    encoding.gaussians.map(look)
    return all(finite)


def _broken(encoding: Encoding) -> dict[str, Tensor]:
    """NaN for every term, with a gradient to everything, so that processes that share a step agree that it is none."""
    held: list[Tensor] = [encoding.depths]

    def hold(tensor: Tensor) -> Tensor:
        held.append(tensor)
        return tensor

    encoding.gaussians.map(hold)
    total = torch.stack([tensor.sum() for tensor in held]).sum() * torch.nan
    return {name: total if name == "total" else total.detach() for name in TERMS}


def _joined(first: Views, second: Views) -> Views:
    """The views of both, of the same scenes, along the view axis."""
    return joined([first, second])

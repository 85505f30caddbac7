"""One step: encode the contexts, render the targets, compare, move the weights."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from semgs.data.views import Batch, Views
from semgs.geometry.cameras import Cameras
from semgs.model.encoding import Encoding
from semgs.objectives.losses import Losses, depth_error, losses
from semgs.objectives.metrics import psnr
from semgs.rendering.render import render
from semgs.rendering.rendering import Rendering
from semgs.training.settings import TrainingSettings
from semgs.training.state import TrainingState


@dataclass(frozen=True)
class StepReport:
    """What a step measured, as plain numbers.

    Attributes:
        total: the weighted sum that was minimised, the depth term included.
        semantic, colour, smoothness, depth: its terms, unweighted; depth is 0 where it has no weight.
        psnr: mean over the rendered views [dB].
        gradient_norm: before clipping.
        learning_rate: of this step.
        unlabelled: rendered views without a labelled pixel.
        moved: whether the weights moved; false if the loss or the gradient was not finite.
    """

    total: float
    semantic: float
    colour: float
    smoothness: float
    depth: float
    psnr: float
    gradient_norm: float
    learning_rate: float
    unlabelled: int
    moved: bool


def training_step(state: TrainingState, batch: Batch, settings: TrainingSettings) -> StepReport:
    """Move the weights by one batch; a step whose loss or gradient is not finite leaves them as they are."""
    rate = learning_rate(state.step, settings.steps, settings.learning_rate, settings.warmup)
    for group in state.optimizer.param_groups:
        group["lr"] = rate
    encoding, rendering, target = encode_and_render(state.model, batch, settings.context_targets)
    terms = losses(rendering, target, settings.losses, class_weights=settings.class_weights)
    depth = _depth_term(encoding, batch.context, settings.depth_weight, like=terms.total)
    total = terms.total + settings.depth_weight * depth
    state.optimizer.zero_grad()
    total.backward()
    norm = float(nn.utils.clip_grad_norm_(state.model.parameters(), settings.clip))
    moved = math.isfinite(float(total.detach())) and math.isfinite(norm)
    if moved:
        state.optimizer.step()
        state.average.update_parameters(state.model)
    state.step += 1
    state.skipped += not moved
    state.skipped_in_a_row = 0 if moved else state.skipped_in_a_row + 1
    return _report(terms, total, depth, float(psnr(rendering.images.detach(), target.images).mean()), norm, rate, moved)


def encode_and_render(
    model: nn.Module, batch: Batch, context_targets: bool = False
) -> tuple[Encoding, Rendering, Views]:
    """Gaussians from the contexts, seen by the targets (and by the contexts, if asked), and what should be seen there.

    Nothing nearer than a fifth of the contexts' near bound is drawn.
    """
    encoding = model(batch.context)
    target = _joined(batch.target, batch.context) if context_targets else batch.target
    near = batch.context.depth_range[..., 0].amin(-1)
    return encoding, render(encoding.gaussians, target.cameras, near=near), target


def learning_rate(step: int, steps: int, peak: float, warmup: float) -> float:
    """The rate of a step: half a cosine up from peak / 25, then half a cosine down to nearly zero.

    Smith's one-cycle policy as MVSplat uses it (PyTorch's `OneCycleLR` without its cycle of momentum), as a function of
    the step alone, so that nothing of it needs saving.
    """
    first, last = peak / 25, peak / 25e4
    top = max(warmup * steps - 1, 1e-9)
    if step <= top:
        return _cosine(first, peak, step / top)
    return _cosine(peak, last, min((step - top) / max(steps - 1 - top, 1e-9), 1))


def _cosine(start: float, end: float, share: float) -> float:
    """From start to end along half a cosine."""
    return end + (start - end) * (1 + math.cos(math.pi * share)) / 2


def _depth_term(encoding: Encoding, context: Views, weight: float, like: Tensor) -> Tensor:
    """The error of the contexts' depths, 0 where it has no weight or no truth."""
    if not weight or context.depths is None:
        return torch.zeros_like(like)
    return depth_error(encoding.depths, context.depths)


def _joined(first: Views, second: Views) -> Views:
    """The views of both, of the same scenes, along the view axis."""

    def join(a: Tensor | None, b: Tensor | None, axis: int) -> Tensor | None:
        return None if a is None or b is None else torch.cat((a, b), dim=axis)

    return Views(
        images=torch.cat((first.images, second.images), dim=-4),
        cameras=Cameras(
            torch.cat((first.cameras.world_from_camera, second.cameras.world_from_camera), dim=-3),
            torch.cat((first.cameras.intrinsics, second.cameras.intrinsics), dim=-3),
            first.size,
        ),
        depth_range=torch.cat((first.depth_range, second.depth_range), dim=-2),
        labels=join(first.labels, second.labels, -3),
        depths=join(first.depths, second.depths, -3),
        classes=first.classes,
    )


def _report(
    terms: Losses, total: Tensor, depth: Tensor, decibels: float, norm: float, rate: float, moved: bool
) -> StepReport:
    """The step's numbers off the graph."""
    values = [total, terms.semantic, terms.colour, terms.smoothness, depth]
    return StepReport(*(float(value.detach()) for value in values), decibels, norm, rate, terms.unlabelled, moved)

"""One step: encode the contexts, render the targets, compare, move the weights."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from semgs.data.views import Batch, Views
from semgs.geometry.cameras import Cameras
from semgs.model.encoding import Encoding
from semgs.objectives.losses import depth_error, losses
from semgs.objectives.metrics import psnr
from semgs.rendering.render import render
from semgs.rendering.rendering import Rendering
from semgs.training.settings import TrainingSettings
from semgs.training.state import TrainingState


@dataclass(frozen=True)
class StepReport:
    """What a step measured, as plain numbers; not a number where it did not come so far.

    Attributes:
        learning_rate: of this step.
        total: the weighted sum that was minimised, the depth term included.
        semantic, colour, smoothness, depth: its terms, unweighted; depth is 0 where it has no weight.
        psnr: mean over the rendered views [dB].
        gradient_norm: before clipping.
        unlabelled: rendered views without a labelled pixel.
        moved: whether the weights moved; false if the loss or the gradient was not finite.
    """

    learning_rate: float
    total: float = math.nan
    semantic: float = math.nan
    colour: float = math.nan
    smoothness: float = math.nan
    depth: float = math.nan
    psnr: float = math.nan
    gradient_norm: float = math.nan
    unlabelled: int = 0
    moved: bool = False


def training_step(state: TrainingState, batch: Batch, settings: TrainingSettings) -> StepReport:
    """Move the weights by one batch; a step whose loss or gradient is not finite leaves them as they are."""
    rate = learning_rate(state.step, settings.steps, settings.learning_rate, settings.warmup)
    for group in state.optimizer.param_groups:
        group["lr"] = rate
    report = _descend(state, batch, settings, rate)
    if report.moved:
        state.optimizer.step()
        state.average.update_parameters(state.model)
    state.step += 1
    state.skipped += not report.moved
    state.skipped_in_a_row = 0 if report.moved else state.skipped_in_a_row + 1
    return report


def _descend(state: TrainingState, batch: Batch, settings: TrainingSettings, rate: float) -> StepReport:
    """Leave the clipped gradient of a batch in the parameters, if there is one."""
    state.optimizer.zero_grad()
    encoding = state.model(batch.context)
    if not _can_be_drawn(encoding):
        return StepReport(learning_rate=rate)
    rendering, target = render_targets(encoding, batch, settings.context_targets)
    terms = losses(rendering, target, settings.losses, class_weights=settings.class_weights)
    depth = torch.zeros_like(terms.total)
    if settings.depth_weight and batch.context.depths is not None:
        depth = depth_error(encoding.depths, batch.context.depths.to(encoding.depths.device))
    total = terms.total + settings.depth_weight * depth
    total.backward()
    norm = nn.utils.clip_grad_norm_(state.model.parameters(), settings.clip)
    return StepReport(
        total=float(total.detach()),
        semantic=float(terms.semantic.detach()),
        colour=float(terms.colour.detach()),
        smoothness=float(terms.smoothness.detach()),
        depth=float(depth.detach()),
        psnr=float(psnr(rendering.images.detach(), target.images).mean()),
        gradient_norm=float(norm),
        learning_rate=rate,
        unlabelled=terms.unlabelled,
        moved=bool(torch.isfinite(total.detach()) and torch.isfinite(norm)),
    )


def render_targets(encoding: Encoding, batch: Batch, context_targets: bool = False) -> tuple[Rendering, Views]:
    """The Gaussians of the contexts as the targets see them (and the contexts, if asked), and what they should see.

    The near bound is the smallest of each scene's contexts, as for its encoding. Both are on the Gaussians' device.
    """
    target = _joined(batch.target, batch.context) if context_targets else batch.target
    near = batch.context.depth_range[..., 0].amin(-1, keepdim=True)
    rendering = render(encoding.gaussians, target.cameras, near=near.expand(target.cameras.batch))
    return rendering, target.to(rendering.images.device)


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


def _can_be_drawn(encoding: Encoding) -> bool:
    """Whether every number of the Gaussians is finite."""
    finite: list[bool] = []

    def look(tensor: Tensor) -> Tensor:
        finite.append(bool(torch.isfinite(tensor.detach()).all()))
        return tensor

    encoding.gaussians.map(look)
    return all(finite)


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

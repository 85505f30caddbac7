"""One step: the gradient of a batch, clipped, and the move along it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import nn

from semgs.data.views import Batch
from semgs.training.objective import TERMS
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
    """Leave the clipped gradient of a batch in the parameters."""
    state.optimizer.zero_grad()
    terms = state.objective(batch, settings)
    state.fabric.backward(terms["total"])
    norm = nn.utils.clip_grad_norm_(state.model.parameters(), settings.clip)
    measured = dict(zip(TERMS, torch.stack([terms[name].detach() for name in TERMS]).tolist(), strict=True))
    unlabelled = measured.pop("unlabelled")
    return StepReport(
        learning_rate=rate,
        **measured,
        gradient_norm=float(norm),
        unlabelled=0 if math.isnan(unlabelled) else round(unlabelled),
        moved=math.isfinite(measured["total"]) and bool(torch.isfinite(norm)),
    )


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

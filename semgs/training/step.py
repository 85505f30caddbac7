"""One step: compute the gradient of a batch, clip it, update the weights."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import nn

from semgs.data.views import Batch
from semgs.training.schedule import Schedule
from semgs.training.state import RELATIVE_RATE, TrainingState
from semgs.training.supervision.objective import TERMS


@dataclass(frozen=True)
class StepReport:
    """What a step measured, as plain numbers; NaN for what was not computed.

    Attributes:
        learning_rate: of this step.
        total: the weighted sum that is minimised, including the depth term.
        semantic, colour, smoothness, depth, gradients, distribution: its terms, unweighted; 0 if they have no weight.
        psnr: mean over the rendered views [dB].
        gradient_norm: before clipping.
        unlabelled: rendered views without a labelled pixel.
        moved: whether the weights were updated; false if the loss or the gradient was not finite.
    """

    learning_rate: float
    total: float = math.nan
    semantic: float = math.nan
    colour: float = math.nan
    smoothness: float = math.nan
    depth: float = math.nan
    gradients: float = math.nan
    distribution: float = math.nan
    psnr: float = math.nan
    gradient_norm: float = math.nan
    unlabelled: int = 0
    moved: bool = False


def training_step(state: TrainingState, pieces: Sequence[Batch], schedule: Schedule) -> StepReport:
    """Update the weights with one batch. If the loss or the gradient is not finite, the weights and the statistics of batch norms stay as they are.

    Args:
        state: of the training; changed in place.
        pieces: this process's share of the batch, in equal pieces; every process has the same number of pieces of the same size.
        schedule: of the learning rate, and the norm to which the gradient is clipped.
    """
    rate = schedule.rate(state.step)
    for group in state.optimizer.param_groups:
        group["lr"] = rate * group[RELATIVE_RATE]
    statistics = [buffer.clone() for buffer in state.model.buffers()] if state.supervision.measures else []
    report = descend(state, pieces, schedule.clip, rate)
    if report.moved:
        state.optimizer.step()
        state.average.update_parameters(state.model)
    elif statistics:
        for buffer, before in zip(state.model.buffers(), statistics, strict=True):
            buffer.copy_(before)
    state.step += 1
    state.skipped += not report.moved
    state.skipped_in_a_row = 0 if report.moved else state.skipped_in_a_row + 1
    return report


def descend(state: TrainingState, pieces: Sequence[Batch], clip: float, rate: float) -> StepReport:
    """Compute the clipped gradient of a batch in the parameters: the mean over its pieces and over the processes."""
    state.optimizer.zero_grad()
    measured = []
    for piece in pieces:
        # Processes exchange gradients once, after the last piece.
        with state.fabric.no_backward_sync(state.objective, enabled=piece is not pieces[-1]):
            terms = state.objective(piece)
            state.fabric.backward(terms["total"] / len(pieces))
        measured.append(torch.stack([terms[name].detach() for name in TERMS]))
    norm = nn.utils.clip_grad_norm_(state.objective.parameters(), clip)
    mean = state.fabric.all_reduce(torch.stack(measured).mean(0), reduce_op="mean")
    means = dict(zip(TERMS, mean.tolist(), strict=True))
    unlabelled = means.pop("unlabelled") * len(pieces) * state.fabric.world_size
    return StepReport(
        learning_rate=rate,
        **means,
        gradient_norm=float(norm),
        unlabelled=0 if math.isnan(unlabelled) else round(unlabelled),
        moved=math.isfinite(means["total"]) and bool(torch.isfinite(norm)),
    )

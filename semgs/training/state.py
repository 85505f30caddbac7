"""State: everything that a training carries from step to step, with its conversion to named tensors and back; and one step: compute the gradient of a batch, clip it, update the weights."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel

from semgs.data.views import Batch
from semgs.training.run.execution import Execution, launch
from semgs.training.schedule import Schedule
from semgs.training.supervision.supervision import TERMS, Objective, Supervision

HEAD = "head."
"""Prefix of a head's tensors in a checkpoint."""

RELATIVE_RATE = "relative_rate"
"""Key of a parameter group: its learning rate, relative to the setting."""


@dataclass
class TrainingState:
    """A training between two steps.

    Attributes:
        model: the network.
        supervision: what it learns from.
        fabric: the engine, which knows the other processes.
        objective: the network with its loss, wrapped by the engine; batches go through it.
        average: the moving average of its weights; `average.module` is a network like `model`.
        optimizer: Adam with its moments.
        step: number of steps taken, including skipped ones; also the number of the next batch.
        skipped: steps without a finite gradient so far.
        skipped_in_a_row: such steps since the last good one.
        seconds: time spent so far, over all sessions.
        validation_due: whether the weights after `step` must still be validated, because a signal stopped that.
        best_step, best_score: of the best validation so far; -1 and -inf before the first.
        head: layers that are trained with the model but are in no weights file; None for none.
    """

    model: nn.Module
    supervision: Supervision
    fabric: Any
    objective: nn.Module
    average: AveragedModel
    optimizer: torch.optim.Adam
    step: int = 0
    skipped: int = 0
    skipped_in_a_row: int = 0
    seconds: float = 0.0
    validation_due: bool = False
    best_step: int = -1
    best_score: float = -math.inf
    head: nn.Module | None = None

    @classmethod
    def begin(
        cls,
        model: nn.Module,
        supervision: Supervision,
        learning_rate: float,
        average_decay: float,
        fabric: Any = None,
        rates: Mapping[str, float] | None = None,
    ) -> TrainingState:
        """The state before the first step. Parameters that do not learn are frozen, and so are batch norms that do not measure.

        Args:
            model: on the device to train on.
            supervision: what it learns from.
            learning_rate: of Adam, until a step sets it.
            average_decay: of the moving average.
            fabric: the launched engine; None launches one for this process alone.
            rates: learning rates of parameters by name, relative to that of the others; 0 freezes one.
        """
        rates = rates or {}
        learning = {name for name in supervision.learning(model) if rates.get(name, 1.0) > 0}
        for name, parameter in model.named_parameters():
            parameter.requires_grad_(name in learning)
        model.train()
        fabric = fabric or launch(Execution(next(model.parameters()).device.type))
        average = AveragedModel(model, multi_avg_fn=_average_from_zero(average_decay))
        average.eval()
        objective = Objective(model, supervision)
        head = objective.head
        optimizer = torch.optim.Adam(_parameter_groups(_named_parameters(model, head), rates), lr=learning_rate)
        objective = fabric.setup_module(objective)
        if not supervision.measures:
            freeze_statistics(model)
        return cls(model, supervision, fabric, objective, average, optimizer, head=head)

    def tensors(self) -> dict[str, Tensor]:
        """Copies of every tensor: weights (`model.`), their average (`average.`), a head's (`head.`), Adam's moments (`optimizer.`)."""
        tensors = {f"model.{name}": tensor for name, tensor in self.model.state_dict().items()}
        if self.head is not None:
            tensors |= {f"{HEAD}{name}": tensor for name, tensor in self.head.state_dict().items()}
        tensors |= {f"average.{name}": tensor for name, tensor in self.average.state_dict().items()}
        for name, parameter in _named_parameters(self.model, self.head).items():
            moments = self.optimizer.state.get(parameter, {})
            tensors |= {f"optimizer.{name}/{key}": tensor for key, tensor in moments.items()}
        return {name: tensor.detach().clone().contiguous() for name, tensor in tensors.items()}

    def numbers(self) -> dict[str, int | float]:
        """Every number of the state."""
        return {
            "step": self.step,
            "skipped": self.skipped,
            "skipped_in_a_row": self.skipped_in_a_row,
            "seconds": self.seconds,
            **({"validation_due": 1} if self.validation_due else {}),
            **({} if self.best_step < 0 else {"best_step": self.best_step, "best_score": self.best_score}),
        }

    def restore(self, tensors: dict[str, Tensor], numbers: dict[str, int | float]) -> None:
        """Restore what `tensors` and `numbers` of another state gave.

        Raises:
            ValueError: the tensors are of another network.
        """
        try:
            self.model.load_state_dict(_with_prefix("model.", tensors))
            self.average.load_state_dict(_with_prefix("average.", tensors))
            if self.head is not None:
                self.head.load_state_dict(_with_prefix(HEAD, tensors))
        except RuntimeError as error:
            raise ValueError(f"checkpoints of another one: {error}") from error
        moments: dict[str, dict[str, Tensor]] = {}
        for name, tensor in _with_prefix("optimizer.", tensors).items():
            parameter, key = name.rsplit("/", 1)
            moments.setdefault(parameter, {})[key] = tensor
        names = {parameter: name for name, parameter in _named_parameters(self.model, self.head).items()}
        order = [names[parameter] for group in self.optimizer.param_groups for parameter in group["params"]]
        numbered = {order.index(name): values for name, values in moments.items()}
        self.optimizer.load_state_dict({"state": numbered, "param_groups": self.optimizer.state_dict()["param_groups"]})
        self.step = int(numbers["step"])
        self.skipped = int(numbers["skipped"])
        self.skipped_in_a_row = int(numbers["skipped_in_a_row"])
        self.seconds = float(numbers["seconds"])
        self.validation_due = bool(numbers.get("validation_due", 0))
        self.best_step = int(numbers.get("best_step", -1))
        self.best_score = float(numbers.get("best_score", -math.inf))


def are_numbers(values: Mapping[str, object]) -> bool:
    """Whether these could come from `TrainingState.numbers`."""
    whole = {"step", "skipped", "skipped_in_a_row"}
    if not whole | {"seconds"} <= values.keys() or ("best_step" in values) != ("best_score" in values):
        return False
    return all(
        type(value) in ((int,) if name in whole | {"best_step", "validation_due"} else (int, float))
        and math.isfinite(value)  # type: ignore[arg-type]
        and (value >= 0 or name == "best_score")  # type: ignore[operator]
        for name, value in values.items()
    )


def _named_parameters(model: nn.Module, head: nn.Module | None) -> dict[str, nn.Parameter]:
    """The parameters of a model and of its head, by name."""
    extra = {} if head is None else {f"{HEAD}{name}": parameter for name, parameter in head.named_parameters()}
    return dict(model.named_parameters()) | extra


def _parameter_groups(named: Mapping[str, nn.Parameter], rates: Mapping[str, float]) -> list[dict[str, Any]]:
    """Adam's parameter groups, one for each relative learning rate; the fastest first."""
    groups: dict[float, list[nn.Parameter]] = {}
    for name, parameter in named.items():
        groups.setdefault(rates.get(name, 1.0), []).append(parameter)
    return [{"params": groups[rate], RELATIVE_RATE: rate} for rate in sorted(groups, reverse=True)]


def freeze_statistics(model: nn.Module) -> None:
    """Freeze the statistics of a network's batch norms, also in training mode."""
    for module in model.modules():
        if isinstance(module, nn.BatchNorm2d):
            module.eval()


def averaged_weights(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """The averaged weights among a state's tensors, by their names in the network."""
    return _with_prefix("average.module.", tensors)


def _average_from_zero(decay: float):
    """A moving average for `AveragedModel` whose decay rises as (1 + n) / (10 + n) until it reaches `decay`.

    Otherwise the average of a young run would be its random start.
    """

    @torch.no_grad()
    def update(averages: list[Tensor], weights: list[Tensor], count: Tensor | int) -> None:
        now = min(decay, (1 + float(count)) / (10 + float(count)))
        torch._foreach_lerp_(averages, weights, 1 - now)

    return update


def _with_prefix(prefix: str, tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names begin with the prefix, without the prefix."""
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}


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

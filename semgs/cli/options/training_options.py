"""Options of commands that train: settings, which are a preset's name, then what to change; and how the training is run. No torch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from semgs.data.tables.class_files import read_class_file
from semgs.data.tables.classes import ClassTable
from semgs.run.device import chosen_device
from semgs.run.options.types import (
    Count,
    Device,
    Minutes,
    PrecisionOrAuto,
    Workers,
    at_least,
    height_and_width,
    shown_size,
)
from semgs.run.options.words import HIDDEN, REPEATABLE, Words, one_word, optional
from semgs.run.usage_errors import UsageError
from semgs.training.training_settings import TrainingSettings

if TYPE_CHECKING:
    from semgs.training.run.execution import Execution

CLASS_FILE = one_word(
    "FILE",
    lambda text: None if text == "None" else read_class_file(text).table,
    lambda table: "None" if table is None else table.name,
)
"""A class table, given by its file."""


@dataclass(frozen=True, kw_only=True)
class TypedSettings(TrainingSettings):
    """Settings of the training."""

    model: Annotated[str, HIDDEN]
    size: Annotated[tuple[int, int], one_word("HxW", height_and_width, shown_size)] = TrainingSettings.size
    classes: Annotated[ClassTable | None, CLASS_FILE, optional()] = TrainingSettings.classes
    assets: Annotated[tuple[str, ...], REPEATABLE, Words(metavar="DIR")] = TrainingSettings.assets
    preset: Annotated[str, HIDDEN] = TrainingSettings.preset


@dataclass(frozen=True)
class ExecutionOptions:
    """How a training is run. Only rounding depends on it."""

    device: Device = "auto"
    """Where to compute; auto uses a CUDA GPU if there is one. Only the CPU gives exactly the same numbers every time."""
    devices: Count = 1
    """GPUs to use on this machine, or CPU processes. They share the scenes of each step."""
    precision: PrecisionOrAuto = "float32"
    """Precision of the layers: float32, bf16, or auto for bf16 on GPUs that support it. The paper does not state one. Cameras, depth, opacity,
    Gaussians and losses always use float32 or better."""
    accumulate: Count = 1
    """Split each process's share of a step into this many pieces, computed one after the other, to save memory."""
    minutes: Annotated[Minutes, optional()] = None
    """Stop after this time, with a checkpoint. The schedule is unchanged. By default training runs to its last step."""
    workers: Workers = 1
    """Processes that load scenes ahead, for each device; 0 loads them between steps."""
    save_minutes: Annotated[float, one_word("FLOAT", at_least(0.0))] = 5.0
    """Minutes between checkpoints."""
    cache_gib: Annotated[float, one_word("FLOAT", at_least(0.0, finite=True))] = 0.0
    """GiB of memory in which each of the workers keeps decoded images of --data folders. This speeds up training on a GPU where all images fit."""

    def execution(self, nodes: int = 1) -> Execution:
        """The same, for `semgs.training.loop.train`.

        Args:
            nodes: machines, each with that many devices.

        Raises:
            UsageError: there are fewer CUDA devices than requested.
        """
        import torch

        from semgs.training.run.execution import Execution

        device = chosen_device(self.device)
        if device == "cuda" and self.devices > torch.cuda.device_count():
            raise UsageError(f"--devices {self.devices}: torch finds {torch.cuda.device_count()} CUDA devices here")
        return Execution(
            device, self.devices, nodes, self.precision, self.accumulate, self.minutes, self.workers, self.save_minutes,
            self.cache_gib,
        )  # fmt: skip

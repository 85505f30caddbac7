"""What a worker of a batch needs, from its command and options, and how many workers a machine has room for."""

from __future__ import annotations

import math
from dataclasses import dataclass

from semgs.run.label_splat import LabelSplat
from semgs.run.options.depth_options import MEASURED, OWN
from semgs.run.outcome import Run
from semgs.run.reconstruct import MOST_VIEWS, Reconstruct

PROCESS = {"poses": 2.0e9, "doctor": 1.0e9, "export": 1.0e9, "label": 1.0e9, "label-splat": 2.0e9}
"""Memory of a process of the other commands, measured at 240x320 and rounded up [bytes]."""

USUAL = (240, 320)
"""Size of the images if no option gives one: at most so many pixels."""

HELD_OUT = 4
"""Most views that are rendered besides the input views."""

MANY, VIEW_BYTES = 100, 120
"""Input views of a long recording, and what each adds per pixel: its photo, and its Gaussians after merging [bytes]."""

NETWORK = 1.0e9
"""Memory of a segmentation or depth network of another program [bytes]."""

CUDA_PROCESS, CUDA_CONTEXT = 3.0e9, 0.6e9
"""Memory of a process that uses CUDA, and what its libraries take on the GPU [bytes]."""


@dataclass(frozen=True)
class Demands:
    """What a worker needs, besides a core.

    Attributes:
        memory: peak of its process [bytes].
        gpu: the part of a GPU, 0 to 1; 0 computes on the CPU.
    """

    memory: float
    gpu: float = 0.0

    def workers(self, cores: int, free: float) -> int:
        """How many workers fit into a machine, at least one.

        Args:
            cores: that may be used.
            free: memory [bytes].
        """
        most = min(cores, free / self.memory)
        return max(1, int(min(most, 1 / self.gpu) if self.gpu else most))


def demands_of(command: str, given: Run) -> Demands:
    """What a worker needs for a command with its options."""
    if isinstance(given, Reconstruct):
        return _reconstructing(given)
    networks = command == "label" or (isinstance(given, LabelSplat) and given.segmenting.segmenter is not None)
    return Demands(PROCESS[command] + NETWORK * networks)


def _reconstructing(given: Reconstruct) -> Demands:
    """What a reconstruction needs, by the memory plan of its network."""
    import torch

    from semgs.model.memory.memory_plan import memory_plan
    from semgs.run.steps.pipeline import MOST_AT_ONCE

    uses_gpu = given.device == "cuda" or (given.device == "auto" and torch.cuda.is_available())
    model = given.load_network("cuda" if uses_gpu and torch.cuda.is_available() else "cpu")
    height, width = given.size or USUAL
    views = len(given.context) or given.views or (MANY if given.all else MOST_VIEWS)
    at_once = min(views, MOST_AT_ONCE)
    plan = memory_plan(model.work(at_once, (height, width), at_once + HELD_OUT), math.inf)
    peak = plan.peak_bytes + (views - at_once) * VIEW_BYTES * height * width
    networks = (given.segmenting.segmenter is not None) + (given.placing.depth not in (*MEASURED, OWN))
    peak += NETWORK * networks
    if not uses_gpu:
        return Demands(peak)
    if not torch.cuda.is_available():  # the cluster has GPUs, this machine has none
        return Demands(CUDA_PROCESS, 1.0)
    whole = torch.cuda.get_device_properties(0).total_memory
    return Demands(CUDA_PROCESS, min(1.0, math.ceil(100 * (peak + CUDA_CONTEXT) / whole) / 100))

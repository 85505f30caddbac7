"""Encode: a network and views in, Gaussians out, as many views at a time as memory allows."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from typing import Protocol, runtime_checkable

import torch

from semgs.data.classes import ClassTable
from semgs.data.views import Views
from semgs.model.encoding import Encoding
from semgs.model.memory_plan import MemoryPlan, memory_plan
from semgs.model.semgs import SemGS


@runtime_checkable
class Network(Protocol):
    """What reconstructs: `SemGS`, or whatever else turns views into Gaussians.

    Attributes:
        name: to call it by.
        classes: the table of its class distributions; None if it knows colour only.
    """

    name: str
    classes: ClassTable | None

    def __call__(self, views: Views) -> Encoding:
        """The Gaussians of two or more views."""
        ...


@dataclass(frozen=True)
class Encoded:
    """What a network made of views.

    Attributes:
        encoding: its answer, without gradients.
        plan: how memory was used; None for a network that `memory_plan` does not know.
        seconds: that the network took.
    """

    encoding: Encoding
    plan: MemoryPlan | None
    seconds: float


@torch.no_grad()
def encode(
    network: Network, views: Views, targets: Views | None = None, *, device: torch.device | str | None = "cpu"
) -> Encoded:
    """The Gaussians of some views.

    Where memory is short, `SemGS` takes fewer views at a time, as `memory_plan` says; the numbers are the same but for rounding.

    Args:
        network: in evaluation mode, on the device to compute on.
        views: of one scene.
        targets: those that will be rendered beside them, for which memory has to be left.
        device: to bring the answer to, in float32; None leaves it where and as it is.

    Raises:
        NotEnoughMemoryError: it would not fit into memory.
        ValueError: there are fewer than two views.
    """
    planned = memory_plan(network, views, targets) if isinstance(network, SemGS) else None
    start = now()
    encoding = network(views, planned.chunks) if isinstance(network, SemGS) and planned else network(views)
    seconds = now() - start
    return Encoded(encoding if device is None else encoding.to(device, torch.float32), planned, seconds)


def now() -> float:
    """The time at which all that was asked of CUDA is done [s]."""
    if torch.cuda.is_initialized():
        torch.cuda.synchronize()
    return perf_counter()

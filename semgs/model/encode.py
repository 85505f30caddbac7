"""Encodes views into Gaussians, as many views at a time as memory allows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import torch

from semgs.data.tables.classes import ClassTable
from semgs.data.views import Views
from semgs.model.classes.view_cache import ViewCache
from semgs.model.memory.memory_plan import MemoryPlan
from semgs.model.semgs import SemGS
from semgs.runtime.stopwatch import now
from semgs.scene.encoding import Encoding


@runtime_checkable
class Network(Protocol):
    """A network that turns views into Gaussians, such as `SemGS`.

    Attributes:
        name: of the network.
        classes: the table of its class distributions; None if it predicts colour only.
    """

    name: str
    classes: ClassTable | None

    def __call__(self, views: Views) -> Encoding:
        """The Gaussians of two or more views."""
        ...


@dataclass(frozen=True)
class Encoded:
    """The encoding of some views.

    Attributes:
        encoding: the output of the network, without gradients.
        plan: how memory was used; None for networks other than `SemGS`.
        seconds: run time of the network.
    """

    encoding: Encoding
    plan: MemoryPlan | None
    seconds: float


@torch.no_grad()
def encode(
    network: Network,
    views: Views,
    targets: Views | None = None,
    *,
    device: torch.device | str | None = "cpu",
    cache: ViewCache | None = None,
) -> Encoded:
    """Encode views into Gaussians.

    If memory is short, `SemGS` processes fewer views at a time, as planned by its `memory_plan`; the result is the same up to rounding.

    Args:
        network: in evaluation mode, on the device to compute on.
        views: of one scene.
        targets: views that will be rendered later and also need memory.
        device: where to move the result, in float32; None leaves it unchanged.
        cache: of earlier calls with the same network, as for `SemGS.forward`; other networks have none.

    Raises:
        NotEnoughMemoryError: it would not fit in memory.
        ValueError: there are fewer than two views.
    """
    planned = network.memory_plan(views, targets) if isinstance(network, SemGS) else None
    start = now()
    encoding = network(views, planned.chunks, cache=cache) if isinstance(network, SemGS) and planned else network(views)
    seconds = now() - start
    return Encoded(encoding if device is None else encoding.to(device, torch.float32), planned, seconds)

"""How fast the network learns: the optimiser's schedule over the steps, and rates of layers relative to one another. No torch."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from semgs.files.records import check_values

if TYPE_CHECKING:
    from semgs.model.semgs import SemGS


@dataclass(frozen=True, kw_only=True)
class Schedule:
    """Steps of the optimiser (Adam) and of the moving average."""

    steps: int
    """Optimiser steps in the run. The learning rate reaches zero at the last one."""
    learning_rate: float = 2e-4
    """Peak learning rate of Adam; the paper's is 2e-4."""
    warmup: float = 0.01
    """Share of the steps in which the learning rate rises (MVSplat's OneCycle)."""
    clip: float = 0.5
    """Clip the gradient to this norm (MVSplat's)."""
    average_decay: float = 0.999
    """Decay of the moving average of the weights, which is what is validated and exported. It starts lower."""

    def __post_init__(self) -> None:
        check_values(
            self,
            steps=(self.steps >= 1, "at least 1"),
            learning_rate=(0 < self.learning_rate < math.inf, "a positive number"),
            warmup=(0 < self.warmup < 1, "a share between 0 and 1"),
            clip=(self.clip > 0, "a positive number"),
            average_decay=(0 <= self.average_decay < 1, "0 (no average) to below 1"),
        )

    def rate(self, step: int) -> float:
        """The learning rate of a step: half a cosine up from a 25th of the peak, then half a cosine down to nearly zero.

        This is Smith's one-cycle policy as MVSplat uses it (PyTorch's `OneCycleLR` without its momentum cycle). As a function of the
        step alone it has no state to save.
        """
        first, last = self.learning_rate / 25, self.learning_rate / 25e4
        top = max(self.warmup * self.steps - 1, 1e-9)
        if step <= top:
            return _cosine(first, self.learning_rate, step / top)
        return _cosine(self.learning_rate, last, min((step - top) / max(self.steps - 1 - top, 1e-9), 1))


def _cosine(start: float, end: float, share: float) -> float:
    """From start to end along half a cosine."""
    return end + (start - end) * (1 + math.cos(math.pi * share)) / 2


@dataclass(frozen=True, kw_only=True)
class Rates:
    """Learning rates of layers, relative to that of the others. A layer in several groups gets the product; 0 freezes."""

    backbone_rate: float = 0.1
    """Learning rate of the class backbone, relative to the other layers; 0 freezes it. Where depth takes cues from it, as in the preset small,
    it is a shared layer, too, so it learns only if --shared-rate is above 0."""
    class_rate: float = 1.0
    """Learning rate of all layers that classify each view by itself, backbone included, relative to the other layers; 0 freezes them."""
    sweep_rate: float = 1.0
    """Learning rate of all layers that depth by plane sweep depends on, relative to the other layers; 0 freezes them. Use 0.1 in a rendered
    stage after --supervision depth, so that colours and opacities adapt and depth stays good."""
    upsampling_rate: float = 1.0
    """Learning rate of the convex upsampling of depth, relative to the other layers; 0 freezes it."""
    shared_rate: float = 1.0
    """Learning rate of the layers that both branches share, relative to the other layers; 0 freezes them. With supervision by labels or
    pictures, 0 keeps depth and colour as they are; without it, a rendered stage has to restore them. With supervision by depth, 0 keeps the
    classes as they are."""

    def __post_init__(self) -> None:
        names = [field.name for field in fields(Rates)]
        check_values(self, **{name: (0 <= getattr(self, name) <= 1, "a share in 0..1") for name in names})


def relative_rates(network: SemGS, rates: Rates) -> dict[str, float]:
    """Learning rates of parameters by name, relative to the schedule's, for those that differ from 1."""
    groups = (
        (network.depth_parameters(), rates.sweep_rate),
        (network.upsampling_parameters(), rates.upsampling_rate),
        (network.semantic_parameters(shared=False, alone=True) | network.pretrained_parameters(), rates.class_rate),
        (network.pretrained_parameters(), rates.backbone_rate),
        (network.parts()["shared"], rates.shared_rate),
    )
    relative: dict[str, float] = {}
    for names, rate in groups:
        relative |= {name: rate * relative.get(name, 1.0) for name in names}
    return {name: rate for name, rate in relative.items() if rate != 1}


def what_learns(network: SemGS) -> str:
    """One line that says which parts of a network learn (have parameters that want a gradient) and which keep their weights."""
    parameters, second = dict(network.named_parameters()), network.second_parameters()
    named = {"the class backbone": network.pretrained_parameters() - second, "MOSAIC": second}
    learning = {name for name, parameter in parameters.items() if parameter.requires_grad}
    told: dict[str, list[str]] = {"learns": [], "keeps its weights": []}
    for part, names in network.parts().items():
        own = names & parameters.keys()
        inside = [name for name, layers in named.items() if layers & own and part != "classes"]
        title = f"{part} with {' and '.join(inside)}" if inside else part
        if own & learning:
            told["learns"].append(title if own <= learning else f"part of {title}")
        elif own:
            told["keeps its weights"].append(title)
    return "; ".join(f"{what}: {', '.join(parts)}" for what, parts in told.items() if parts)

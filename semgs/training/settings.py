"""Settings: everything that decides the numbers of a training, in one frozen record."""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass, field, fields
from typing import Annotated, Any

import tyro

from semgs.objectives.weights import LossWeights
from semgs.rooms import demo
from semgs.rooms.style import Style


def _size(given: list[str]) -> tuple[int, int]:
    """(height, width) of "240x320".

    Raises:
        ValueError: it is written otherwise.
    """
    match = re.fullmatch(r"(\d{1,5})[x×X](\d{1,5})", given[0])
    if not match:
        raise ValueError(f"expected height x width in pixels, such as 240x320, found {given[0]!r}")
    return int(match[1]), int(match[2])


VALIDATION_SEED = 2**31 - 1
"""Seed of the validation rooms, the same for every run; no training may use it."""

HEIGHT_BY_WIDTH = tyro.constructors.PrimitiveConstructorSpec(
    nargs=1,
    metavar="HxW",
    instance_from_str=_size,
    is_instance=lambda value: isinstance(value, tuple) and len(value) == 2,
    str_from_instance=lambda size: [f"{size[0]}x{size[1]}"],
)
"""How a size is written on the command line, here as everywhere."""


@dataclass(frozen=True)
class TrainingSettings:
    """What a training computes. Two runs of equal settings give the same bits on one process of one machine.

    How it is run (minutes, data workers, how often it saves) changes no number and is not in here.
    """

    model: Annotated[str, tyro.conf.Suppress]
    """The network: small or base."""
    steps: int
    """Length of the run in optimiser steps; the learning rate falls to zero at its end."""
    batch: int = 2
    """Scenes per step."""
    size: Annotated[tuple[int, int], HEIGHT_BY_WIDTH] = (240, 320)
    """Height and width of the pictures [px]."""
    contexts: tuple[int, int] = (2, 4)
    """Fewest and most input views; each step draws its own number, equal for all scenes of its batch."""
    targets: int = 2
    """Views rendered and compared per scene, other than the inputs."""
    context_targets: bool = False
    """Render and compare the input views as well (not in the paper): a frame of its own is where depth is easiest to learn."""
    learning_rate: float = 2e-4
    """Peak of the schedule, for Adam (the paper's)."""
    warmup: float = 0.01
    """Share of the steps in which the learning rate rises (MVSplat's OneCycle)."""
    clip: float = 0.5
    """Largest norm of the gradient; longer ones are shortened to it (MVSplat's)."""
    average_decay: float = 0.999
    """Decay of the moving average of the weights, which is what is validated and exported; it starts lower."""
    losses: LossWeights = field(default_factory=LossWeights)
    """Weights of the paper's three terms."""
    class_weights: tuple[float, ...] | None = None
    """Factor of each class in the cross-entropy; none is 1 for all, the paper's."""
    depth_weight: float = 0.0
    """Weight of the error of log depth of the input views where their true depth is known (not in the paper)."""
    weights: str = "random"
    """Where to start: random, or a file of weights."""
    seed: int = 0
    """Of the weights and of every sample."""
    scene_reuse: int = 1
    """Samples that a scene serves on average: 1 draws a room for each; more takes them from scenes of twelve frames that are kept
    in RUN/rooms, which costs less and shows fewer rooms."""
    style: Style = "home"
    """The world that the rooms of the training are of: home or plain; other is held out. Validation rooms are always homes."""
    assets: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Folder of meshes and pictures for the rooms, see semgs rooms --help; again for another one. Validation rooms get pieces
    that no training sees."""
    validate_every: int = 1000
    """Steps between validations."""
    validation_scenes: int = 16
    """Fixed scenes of validation, never among those trained on."""

    def __post_init__(self) -> None:
        fewest, most = self.contexts
        checks = {
            "steps": (self.steps >= 1, "at least 1"),
            "batch": (self.batch >= 1, "at least 1"),
            "size": (min(self.size) >= 16, "at least 16 pixels a side"),
            "contexts": (2 <= fewest <= most, "fewest and most input views, 2 or more, in this order"),
            "targets": (self.targets >= 1, "at least 1"),
            "learning_rate": (self.learning_rate > 0, "a positive number"),
            "warmup": (0 < self.warmup < 1, "a share between 0 and 1"),
            "clip": (self.clip > 0, "a positive number"),
            "average_decay": (0 <= self.average_decay < 1, "0 (no average) to below 1"),
            "depth_weight": (self.depth_weight >= 0, "0 or more"),
            "scene_reuse": (self.scene_reuse >= 1, "at least 1"),
            "seed": (
                self.seed >= 0 and self.seed not in (VALIDATION_SEED, demo.SEED),
                f"0 or more, and neither {VALIDATION_SEED} nor {demo.SEED}, which the validation rooms and the demo are drawn from",
            ),
            "style": (self.style != "other", "home or plain; nothing is trained in the world that is held out"),
            "assets": (not self.assets or self.style == "home", "none in rooms of style plain"),
            "validate_every": (self.validate_every >= 1, "at least 1"),
            "validation_scenes": (self.validation_scenes >= 0, "0 or more"),
        }
        for name, (holds, expected) in checks.items():
            if not holds:
                raise ValueError(f"{name} is {getattr(self, name)}; expected {expected}")

    def as_json(self) -> dict:
        """The settings as JSON knows them."""
        return asdict(self)

    @classmethod
    def from_json(cls, saved: dict) -> TrainingSettings:
        """The settings that `as_json` gave; fields that a newer version added take their defaults.

        Raises:
            ValueError: a field is not known to this version.
        """
        unknown = sorted(set(saved) - {one.name for one in fields(cls)})
        if unknown:
            raise ValueError(f"the settings hold {', '.join(unknown)}, which this version of semgs does not know")
        values: dict[str, Any] = {
            name: tuple(value) if isinstance(value, list) else value for name, value in saved.items()
        }
        if not isinstance(values.get("assets", ()), tuple):  # as older versions kept it
            values["assets"] = (values["assets"],) if values["assets"] else ()
        if "losses" in values:
            values["losses"] = LossWeights(**values["losses"])
        return cls(**values)


def differences(settings: TrainingSettings, reference: TrainingSettings) -> dict[str, tuple[object, object]]:
    """The fields that differ: name to (value, value in the reference)."""
    pairs = {one.name: (getattr(settings, one.name), getattr(reference, one.name)) for one in fields(settings)}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}

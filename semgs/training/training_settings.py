"""Settings: everything that decides the numbers of a training, in one frozen dataclass."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from pathlib import PurePath
from typing import Any, Literal, TypeVar, get_args

from semgs.files.records import make_record
from semgs.model.switches import Switches
from semgs.training.data.data_settings import DataSettings
from semgs.training.data.data_sources import ROOMS
from semgs.training.schedule import Schedule
from semgs.training.setting_checks import check_values
from semgs.training.supervision.rates import Rates
from semgs.training.supervision.supervision_settings import SupervisionSettings

SemanticBranch = Literal["kept", "drawn"]

PLACES = ("data", "scenes", "validation", "init", "backbone", "teacher", "assets")
"""Settings that are paths. They may differ between machines: two runs are the same if the last parts of their paths are."""

WEIGHTS, BEST = "weights.safetensors", "best.safetensors"
"""What every run folder calls the averaged weights of its newest checkpoint and of its best validation."""

PARTS = (DataSettings, Schedule, SupervisionSettings, Rates)
"""The parts of a training that have settings of their own."""

Part = TypeVar("Part", bound=DataSettings | Schedule | SupervisionSettings | Rates)


@dataclass(frozen=True, kw_only=True)
class TrainingSettings(Rates, SupervisionSettings, Schedule, DataSettings):
    """What a training computes: the settings of its `PARTS`, the network and where it starts. Two runs with equal settings give exactly the
    same result in one process on one CPU.

    How it runs (device, processes, precision, minutes, workers, how often it saves) is not included: it changes numbers by rounding at
    most, and may change when a run resumes.
    """

    model: str
    """The network: small, small_plain or base."""
    init: str = "random"
    """Where to start: random, the name of included weights (small), a weights file, or hf://OWNER/NAME on the hub. base also takes MVSplat's
    checkpoint."""
    backbone: str = ""
    """Published MobileNetV2 weights to start the class backbone from (with --network.class-backbone): an ImageNet classifier or a
    segmentation network, as safetensors; or MOSAIC's (with --network.class-mosaic). See docs/train.md."""
    semantic_branch: SemanticBranch = "kept"
    """Keep the semantic branch of the initial weights, or reinitialise it and keep depth and colour."""
    network: Switches = field(default_factory=Switches)
    """Switches of the network; presets have those of their own network."""
    validate_every: int = 1000
    """Steps between validations."""
    preset: str = field(default="", compare=False)
    """The preset that these began as; it decides nothing."""

    def __post_init__(self) -> None:
        for kind in PARTS:
            self.part(kind)
        by_labels, by_depth = self.supervision in ("labels", "pictures"), self.supervision == "depth"
        factors, classes = self.class_weights, len(self.table)
        check_values(
            self,
            **{
                "semantic_branch": (
                    self.semantic_branch in get_args(SemanticBranch),
                    f"one of {', '.join(get_args(SemanticBranch))}",
                ),
                "class_weights": (
                    not isinstance(factors, tuple) or len(factors) == classes,
                    f"{classes} factors, one for each class of the table",
                ),
                "augmentation.roll": (
                    self.single_images or not self.augmentation.roll,
                    "0, except with supervision by pictures: the corners of a rotated image are made up",
                ),
                "augmentation.exposure": (
                    self.supervision != "rendered" or not self.augmentation.exposure,
                    "0 with supervision by rendered views, whose colours are compared",
                ),
                "sweep_rate": (
                    self.sweep_rate > 0 or not by_depth or (self.depth_losses.sharp > 0 and self.upsampling_rate > 0),
                    "a share above 0 with supervision by depth, which teaches nothing else",
                ),
                "class_rate": (
                    self.class_rate > 0 or not by_labels,
                    "a share above 0 with supervision by labels or pictures",
                ),
                "sampling": (
                    not self.single_images or self.sampling == "even",
                    "even with supervision by pictures, whose scenes take turns",
                ),
                "validate_every": (self.validate_every >= 1, "at least 1"),
            },
        )

    def part(self, kind: type[Part]) -> Part:
        """The settings of one of `PARTS` alone.

        Raises:
            ValueError: they cannot be used.
        """
        return kind(**{setting.name: getattr(self, setting.name) for setting in fields(kind)})

    def check_complete(self) -> None:
        """Refuse settings that lack what a preset cannot know.

        Raises:
            ValueError: there is no source of scenes, or no start for the network.
        """
        if not self.data:
            raise ValueError(f"no data: give --data DIR [DIR ...], or --data {ROOMS} for generated rooms")
        if not self.init:
            raise ValueError(
                "no weights to start from: give --init FILE (MVSplat's re10k checkpoint), or --init random"
            )

    def as_json(self) -> dict[str, Any]:
        """The settings as plain JSON."""
        return asdict(self)

    def published(self) -> dict[str, Any]:
        """The settings as JSON for publishing: of each path in `PLACES` only what `name_place` keeps."""
        places = {place: getattr(self, place) for place in PLACES}
        return self.as_json() | {
            place: tuple(map(name_place, value)) if isinstance(value, tuple) else name_place(value)
            for place, value in places.items()
        }

    @classmethod
    def from_json(cls, saved: object) -> TrainingSettings:
        """The settings from `as_json`; missing fields take their defaults.

        Raises:
            ValueError: this version does not know a setting, or a value cannot be used; it is named.
        """
        return make_record(cls, saved)


def name_place(place: str) -> str:
    """What a path is called on any machine: its last part, with the name of the run before it for weights of a run; hub ids stay."""
    path = PurePath(place)
    run = path.parent.name if path.name in (WEIGHTS, BEST) else ""
    return place if "://" in place else f"{run}/{path.name}" if run else path.name

"""Settings: everything that decides the numbers of a training, in one frozen dataclass; and how two trainings differ, in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import PurePath
from typing import Any, Literal, get_args

from semgs.data.tables.classes import ClassTable
from semgs.files.records import check_values, make_record
from semgs.model.switches import Switches
from semgs.training.data.data_settings import ROOMS, DataSettings
from semgs.training.schedule import Rates, Schedule
from semgs.training.supervision.supervision_settings import SupervisionSettings

SemanticBranch = Literal["kept", "drawn"]

PLACES = ("data", "scenes", "validation", "init", "backbone", "teacher", "assets")
"""Settings that are paths. They may differ between machines: two runs are the same if the last parts of their paths are."""

WEIGHTS, BEST = "weights.safetensors", "best.safetensors"
"""What every run folder calls the averaged weights of its newest checkpoint and of its best validation."""

PARTS = (DataSettings, Schedule, SupervisionSettings, Rates)
"""The parts of a training that have settings of their own."""


@dataclass(frozen=True, kw_only=True)
class TrainingSettings(Rates, SupervisionSettings, Schedule, DataSettings):
    """What a training computes: the settings of all its `PARTS`, the network and where it starts. Two runs with equal settings give exactly the
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
        for part in PARTS:
            part.__post_init__(self)
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


def differences(settings: TrainingSettings, reference: TrainingSettings) -> dict[str, tuple[object, object]]:
    """The fields that differ: name to (value, value in the reference)."""
    names = [setting.name for setting in fields(settings) if setting.compare]
    pairs = {name: (getattr(settings, name), getattr(reference, name)) for name in names}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def find_changes(settings: TrainingSettings, reference: TrainingSettings) -> dict[str, tuple[object, object]]:
    """The fields that differ; the same file or folder in another place is no difference."""
    return {
        name: pair
        for name, pair in differences(settings, reference).items()
        if name not in PLACES or not _same_name(*pair)
    }


def _same_name(one: object, other: object) -> bool:
    """Whether two places may be of the same file or folder; weights of a run may lack its name."""
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same_name, one, other))
    short, long = sorted((name_place(str(one)), name_place(str(other))), key=len)
    return short == long or (short in (WEIGHTS, BEST) and long.endswith(f"/{short}"))


def list_changes(changes: Mapping[str, tuple[object, object]], here: str) -> str:
    """Differences from an existing run in one phrase; `here` names the other values, such as "requested"."""
    return ", ".join(f"{name} = {describe(run)} there, {describe(own)} {here}" for name, (own, run) in changes.items())


def describe(value: object) -> str:
    """A setting's value in words; "none" if it is empty."""
    if value in ("", (), None):
        return "none"
    return f"{value.name} ({', '.join(value.names)})" if isinstance(value, ClassTable) else str(value)

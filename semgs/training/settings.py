"""Settings: everything that decides the numbers of a training, in one frozen record."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from fractions import Fraction
from pathlib import PurePath
from typing import Any, Literal

from semgs.data.classes import SCANNET20, ClassTable
from semgs.model.switches import Switches
from semgs.objectives.weights import DepthLossWeights, LossWeights
from semgs.rooms.sets import demo

VALIDATION_SEED = 2**31 - 1
"""Seed of the validation rooms, the same for every run; no training may use it."""

ROOMS = "rooms"
"""The name of data that are drawn live."""

CLASS_WEIGHTINGS = {"inverse_root_frequency": 0.5, "inverse_fourth_root_frequency": 0.25}
"""Rules by which classes weigh more the rarer they are: the power of one over a class's share of the pixels."""

PLACES = ("data", "scenes", "validation", "init", "backbone", "teacher", "assets")
"""Settings that say where something lies. It may lie elsewhere on another machine: a run is the same if the last parts of the paths are."""


@dataclass(frozen=True)
class Source:
    """One of the things that a training takes its scenes from.

    Attributes:
        path: a scene or a folder of scenes; "rooms" for rooms drawn live.
        weight: its share of the samples, in relation to those of the others.
    """

    path: str
    weight: Fraction

    @classmethod
    def parsed(cls, text: str) -> Source:
        """Of "PATH=WEIGHT", or "PATH" for weight 1.

        Raises:
            ValueError: the weight is no positive number, or there is no path.
        """
        match = re.fullmatch(r"([^=].*?)(?:=([^=/]*))?", text)
        try:
            weight = Fraction(match[2] or "1" if match else "")
        except (ValueError, ZeroDivisionError):
            weight = Fraction(0)
        if match is None or weight <= 0:
            raise ValueError(f"data is {text!r}; expected {ROOMS}, DIR, or either with =WEIGHT, a positive number")
        return cls(match[1], weight)

    @property
    def is_rooms(self) -> bool:
        """Whether its scenes are rooms drawn live."""
        return self.path == ROOMS


@dataclass(frozen=True)
class Augmentation:
    """What is done to a sample so that it is seen in more ways than one; all of its views alike, their cameras with them."""

    colour: float = 0.0
    """Exposure, white balance and saturation vary by factors of up to exp(this); 0.2 is a lot, 0 is none."""
    crop: float = 1.0
    """Smallest side of the window that is cut out, as a share of the picture's; the camera's focal length and centre move along. 1 cuts none."""
    flip: bool = False
    """Mirror every second sample, poses included (MVSplat's)."""
    roll: float = 0.0
    """Turn every second sample about the camera's axis, by up to so many degrees either way; needs supervision by pictures, because
    the corners are filled with the mirrored image (and the label 255)."""
    camera: float = 0.0
    """Vary what a photo camera does to an image: blur, vignetting, white balance, noise, gamma, JPEG and, in one sample of ten, grey. 1 is
    as far as phones go, 0 is none."""

    def __post_init__(self) -> None:
        if not 0 <= self.colour <= 1 or not 0.2 <= self.crop <= 1:
            raise ValueError(f"augmentation is {self}; expected colour in 0..1 and crop in 0.2..1")
        if not 0 <= self.roll <= 45 or not 0 <= self.camera <= 1:
            raise ValueError(f"augmentation is {self}; expected roll in 0..45 degrees and camera in 0..1")


@dataclass(frozen=True)
class TrainingSettings:
    """What a training computes. Two runs of equal settings give the same bits on one process of one CPU.

    How it is run (device, processes, precision, minutes, data workers, how often it saves) is not in here: it changes numbers by
    rounding at most, and a run may go on otherwise.
    """

    model: str
    """The network: small or base."""
    steps: int
    """Length of the run in optimiser steps; the learning rate falls to zero at its end."""
    data: tuple[str, ...] = (ROOMS,)
    """Where scenes come from: rooms, drawn live from the seed, and folders (a scene, or a folder of scenes); each with =WEIGHT to
    say how many of the samples, as in: rooms=2 scans=1."""
    scenes: str = ""
    """Of the folders, take the scenes of a list: one that comes with semgs (scannet-1000-without-sray), or a text file with a name a line."""
    batch: int = 2
    """Scenes per step, over all processes."""
    size: tuple[int, int] = (240, 320)
    """Height and width of the pictures [px]."""
    half_size: float = 0.0
    """Share of the steps, the first ones, whose pictures are half as high and wide: they cost a quarter. Validation is at the full size."""
    contexts: tuple[int, int] = (2, 4)
    """Fewest and most input views; each step draws its own number, equal for all scenes of its batch. With supervision by pictures, 1 1
    and no targets make a batch of single pictures, each of another scene."""
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
    class_weights: tuple[float, ...] | Literal["inverse_root_frequency", "inverse_fourth_root_frequency"] | None = None
    """Factor of each class in the cross-entropy; None is 1 for all, the paper's. inverse_root_frequency measures how often each class occurs in
    the data and favours the rare, such that a mean pixel has factor 1; inverse_fourth_root_frequency favours them less."""
    depth_weight: float = 0.0
    """Weight of the error of log depth of the input views where their true depth is known (not in the paper)."""
    supervision: Literal["rendered", "labels", "pictures", "depth"] = "rendered"
    """What the loss looks at: rendered views, as in the paper; or labels, the classes of the input views' own pixels before anything is
    splatted, which trains the semantic branch and the layers it shares alone, in a fifth of the time; or pictures, the same of all views of a
    sample, each by itself, without the transformer between views: a first stage that learns what things look like; or depth, which compares the
    depth of the input views, as the plane sweep finds it before refinement, with true depth. It needs scenes with depth, but no labels."""
    depth_losses: DepthLossWeights = field(default_factory=DepthLossWeights)
    """Weights of the terms with --supervision depth."""
    hold_shared: bool = False
    """With supervision by labels or pictures: keep the layers that both branches share as they are, so that depth and colour of the weights to
    start from stay to the bit. Without, they move, and a second, rendered stage has to bring depth and colour back. With supervision by
    depth, classes stay as they are instead."""
    sampling: Literal["even", "balanced"] = "even"
    """Scenes of a folder are drawn with equal chances, or balanced: more often those that hold classes which are rare. Single pictures
    do not draw: all scenes of a folder take turns."""
    augmentation: Augmentation = field(default_factory=Augmentation)
    """Variations of the samples; all off unless asked for."""
    init: str = "random"
    """Where to start: random, the name of weights that ship (small), a file of weights, or hf://OWNER/NAME on the hub; MVSplat's
    checkpoint does for base."""
    backbone: str = ""
    """Published MobileNetV2 weights that the class backbone starts from (with --network.class-backbone): an ImageNet classifier or a
    segmentation network as safetensors (docs/train.md)."""
    backbone_rate: float = 0.1
    """Learning rate of the class backbone, as a share of that of the other layers; 0 holds it as it is."""
    class_rate: float = 1.0
    """Learning rate of all that classifies each view by itself, the backbone included, as a share of that of the other layers; 0 holds it."""
    sweep_rate: float = 1.0
    """Learning rate of all that depth by plane sweep depends on, as a share of that of the other layers; 0 holds it. In a rendered stage
    that follows --supervision depth, 0.1 lets colours and opacities learn the new depth without losing it."""
    teacher: str = ""
    """Folder of another network's class probabilities for the training pictures, as scripts/teach.py writes it: they are learned as well,
    by a head that is dropped afterwards, so that the backbone does not forget what it knew. Needs single pictures."""
    teacher_weight: float = 1.0
    """Weight of that second loss, a Kullback-Leibler divergence."""
    semantic_branch: Literal["kept", "drawn"] = "kept"
    """Of the weights to start from: keep all, or draw the semantic branch anew and keep depth and colour."""
    classes: ClassTable | None = None
    """One's own table of classes (JSON); scenes of other tables are read by the names of their classes. Weights of another table
    keep all but their class head."""
    network: Switches = field(default_factory=Switches)
    """Switches of the network."""
    seed: int = 0
    """Of the weights and of every sample."""
    scene_reuse: int = 1
    """Samples that a scene serves on average: 1 draws a room for each; more takes them from scenes of twelve frames that are kept
    in RUN/rooms, which costs less and shows fewer rooms."""
    assets: tuple[str, ...] = ()
    """Folder of meshes and pictures for the rooms, see semgs rooms --help; again for another one. Validation rooms get pieces
    that no training sees."""
    validation: str = ROOMS
    """Where the scenes of validation come from: rooms, or a folder of scenes that are not trained on."""
    validate_every: int = 1000
    """Steps between validations."""
    validation_scenes: int = 16
    """Fixed samples of validation, never among those trained on."""
    preset: str = field(default="", compare=False)
    """The preset that these began as; it decides nothing."""

    def __post_init__(self) -> None:
        fewest, most = self.contexts
        for text in self.data:
            Source.parsed(text)
        count, alone = len(self.classes or SCANNET20), self.supervision == "pictures"
        checks = {
            "steps": (self.steps >= 1, "at least 1"),
            "batch": (self.batch >= 1, "at least 1"),
            "size": (min(self.size) >= 16, "at least 16 pixels a side"),
            "half_size": (
                0 <= self.half_size <= 1 and (not self.half_size or min(self.size) >= 32),
                "a share in 0..1, and 0 if a side is below 32 pixels",
            ),
            "contexts": (
                (1 if alone else 2) <= fewest <= most,
                "fewest and most input views, 2 or more (1 with supervision by pictures), in this order",
            ),
            "targets": (self.targets >= (0 if alone else 1), "at least 1 (0 with supervision by pictures)"),
            "learning_rate": (self.learning_rate > 0, "a positive number"),
            "warmup": (0 < self.warmup < 1, "a share between 0 and 1"),
            "backbone_rate": (0 <= self.backbone_rate <= 1, "a share in 0..1"),
            "clip": (self.clip > 0, "a positive number"),
            "average_decay": (0 <= self.average_decay < 1, "0 (no average) to below 1"),
            "class_weights": (
                not isinstance(self.class_weights, tuple) or len(self.class_weights) == count,
                f"{count} factors, one for each class of the table, {', '.join(CLASS_WEIGHTINGS)}, or None",
            ),
            "depth_weight": (self.depth_weight >= 0, "0 or more"),
            "scene_reuse": (self.scene_reuse >= 1, "at least 1"),
            "seed": (
                self.seed >= 0 and self.seed not in (VALIDATION_SEED, demo.SEED),
                f"0 or more, and neither {VALIDATION_SEED} nor {demo.SEED}, which the validation rooms and the demo are drawn from",
            ),
            "hold_shared": (
                not self.hold_shared or self.supervision != "rendered",
                "False, unless supervision is labels, pictures or depth",
            ),
            "augmentation": (
                alone or not self.augmentation.roll,
                "no roll, but with supervision by pictures: the corners of a turned image show nothing true",
            ),
            "sweep_rate": (
                0 <= self.sweep_rate <= 1 and (self.sweep_rate > 0 or self.supervision != "depth"),
                "a share in 0..1, and above 0 with supervision by depth, which teaches nothing else",
            ),
            "class_rate": (
                0 <= self.class_rate <= 1 and (self.class_rate > 0 or self.supervision in ("rendered", "depth")),
                "a share in 0..1, and above 0 with supervision by labels or pictures",
            ),
            "sampling": (
                not self.single_pictures or self.sampling == "even",
                "even with single pictures, whose scenes take turns",
            ),
            "teacher": (
                not self.teacher or self.single_pictures,
                "none, but with single pictures (--supervision pictures --contexts 1 1 --targets 0)",
            ),
            "teacher_weight": (self.teacher_weight > 0, "a positive number"),
            "validate_every": (self.validate_every >= 1, "at least 1"),
            "validation_scenes": (self.validation_scenes >= 0, "0 or more"),
        }
        for name, (holds, expected) in checks.items():
            if not holds:
                raise ValueError(f"{name} is {getattr(self, name)}; expected {expected}")

    def check_whole(self) -> None:
        """Refuse settings that leave open what a preset cannot know.

        Raises:
            ValueError: it is not said where scenes come from, or where the network starts.
        """
        if not self.data:
            raise ValueError(f"no data: give --data DIR [DIR ...], or --data {ROOMS} for rooms that are drawn")
        if not self.init:
            raise ValueError(
                "no weights to start from: give --init FILE (MVSplat's re10k checkpoint), or --init random"
            )

    @property
    def single_pictures(self) -> bool:
        """Whether each sample is one picture alone, so that a batch is of as many scenes as it has pictures."""
        return self.supervision == "pictures" and self.contexts == (1, 1) and self.targets == 0

    @property
    def sources(self) -> tuple[Source, ...]:
        """What `data` names."""
        return tuple(Source.parsed(text) for text in self.data)

    def as_json(self) -> dict:
        """The settings as JSON knows them."""
        return asdict(self)

    def published(self) -> dict:
        """The settings as JSON for a file that travels: of `PLACES` the last part of each path, not where it lay; hub ids stay."""

        def named(value: Any) -> Any:
            if isinstance(value, tuple):
                return tuple(map(named, value))
            return value if "://" in value else PurePath(value).name

        return self.as_json() | {place: named(getattr(self, place)) for place in PLACES}

    @classmethod
    def from_json(cls, saved: dict) -> TrainingSettings:
        """The settings that `as_json` gave; fields that a newer version added take their defaults.

        Raises:
            ValueError: a field, or the style of rooms, is not known to this version.
        """
        saved = dict(saved)
        if "weights" in saved:  # its name before there were mixtures of data
            saved["init"] = saved.pop("weights")
        if (style := saved.pop("style", "home")) != "home":  # a setting while there was a second world to train in
            raise ValueError(f"style is {style}; this version of semgs trains in rooms of style home only")
        unknown = sorted(set(saved) - {one.name for one in fields(cls)})
        if unknown:
            raise ValueError(f"the settings hold {', '.join(unknown)}, which this version of semgs does not know")
        values = _with_tuples(saved)
        if not isinstance(values.get("assets", ()), tuple):  # as older versions kept it
            values["assets"] = (values["assets"],) if values["assets"] else ()
        kinds = {
            "losses": LossWeights, "depth_losses": DepthLossWeights, "augmentation": Augmentation, "network": Switches,
        }  # fmt: skip
        for name, kind in kinds.items():
            if name in values:
                values[name] = kind(**_with_tuples(values[name]))
        if values.get("classes") is not None:
            values["classes"] = ClassTable.from_json(values["classes"])
        return cls(**values)


def _with_tuples(saved: Mapping[str, Any]) -> dict[str, Any]:
    """What JSON kept, its lists as the tuples that they were."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in saved.items()}


def differences(settings: TrainingSettings, reference: TrainingSettings) -> dict[str, tuple[object, object]]:
    """The fields that differ: name to (value, value in the reference)."""
    pairs = {
        one.name: (getattr(settings, one.name), getattr(reference, one.name)) for one in fields(settings) if one.compare
    }
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def changed(settings: TrainingSettings, reference: TrainingSettings) -> dict[str, tuple[object, object]]:
    """As `differences`, but what only lies elsewhere is the same."""

    def last(value: object) -> object:
        if isinstance(value, tuple):
            return tuple(last(one) for one in value)
        return PurePath(str(value)).name

    return {
        name: pair
        for name, pair in differences(settings, reference).items()
        if name not in PLACES or last(pair[0]) != last(pair[1])
    }


def told(value: object) -> str:
    """A setting's value as a person reads it."""
    if isinstance(value, ClassTable):
        return f"{value.name} ({', '.join(value.names)})"
    return str(value)

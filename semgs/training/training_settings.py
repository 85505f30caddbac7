"""Settings: everything that decides the numbers of a training, in one frozen dataclass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from operator import attrgetter
from pathlib import PurePath
from typing import Any, Literal, get_args

from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.model.switches import Switches
from semgs.objectives.loss_weights import DepthLossWeights, LossWeights
from semgs.rooms.sets import demo_room as demo
from semgs.training.data.data_sources import ROOMS, Source

Frames = Literal["covisible", "consecutive"]
SupervisedBy = Literal["rendered", "labels", "pictures", "depth"]
Sampling = Literal["even", "balanced"]
SemanticBranch = Literal["kept", "drawn"]

VALIDATION_SEED = 2**31 - 1
"""Seed of the validation rooms, the same for every run; no training may use it."""

CLASS_WEIGHTINGS = {"inverse_root_frequency": 0.5, "inverse_fourth_root_frequency": 0.25}
"""Rules that give rare classes more weight: (1 / share of the pixels) to this power."""

PLACES = ("data", "scenes", "validation", "init", "backbone", "teacher", "assets")
"""Settings that are paths. They may differ between machines: two runs are the same if the last parts of their paths are."""


@dataclass(frozen=True)
class Augmentation:
    """Random changes to a sample. All but `exposure` are the same for all of its views and their cameras."""

    colour: float = 0.0
    """Change exposure, white balance and saturation by factors of up to exp(this). 0.2 is strong."""
    crop: float = 1.0
    """Random crop: shortest side of the window, relative to the image. The camera follows. 1 does not crop."""
    flip: bool = False
    """Mirror every second sample, with its cameras (MVSplat's)."""
    roll: float = 0.0
    """Rotate every second sample about the optical axis, by up to this many degrees either way. Needs --supervision pictures, because the
    corners are filled with the mirrored image (label 255)."""
    camera: float = 0.0
    """Imitate a photo camera: blur, vignetting, white balance, noise, gamma, JPEG and, in one sample of ten, grey. 1 is as strong as on
    phones."""
    exposure: float = 0.0
    """Change the exposure, white balance and saturation of each view by itself, by factors of up to exp(this), as a camera on automatic does.
    Not with --supervision rendered, which compares the views' colours."""

    def __post_init__(self) -> None:
        bounds = {"colour": (0, 1), "crop": (0.2, 1), "roll": (0, 45), "camera": (0, 1), "exposure": (0, 1)}
        for name, (least, most) in bounds.items():
            if not least <= getattr(self, name) <= most:
                raise ValueError(f"{name} is {getattr(self, name)}; expected {least} to {most}")


@dataclass(frozen=True)
class TrainingSettings:
    """What a training computes. Two runs with equal settings give exactly the same result in one process on one CPU.

    How it runs (device, processes, precision, minutes, workers, how often it saves) is not included: it changes numbers by rounding at
    most, and may change when a run resumes.
    """

    model: str
    """The network: small or base."""
    steps: int
    """Optimiser steps in the run. The learning rate reaches zero at the last one."""
    data: tuple[str, ...] = (ROOMS,)
    """Where scenes come from: rooms (generated from the seed) and folders (a scene, or a folder of scenes). Add =WEIGHT to set the share of
    samples from each, as in: rooms=2 scans=1."""
    scenes: str = ""
    """Only use the scenes of a list: an included one (scannet-1000-without-sray), or a text file with one name per line."""
    batch: int = 2
    """Scenes per step, over all processes."""
    size: tuple[int, int] = (240, 320)
    """Height and width of the images, in pixels."""
    half_size: float = 0.0
    """Share of the steps, from the start, that use images of half the height and width, at a quarter of the cost. Validation uses the full size."""
    contexts: tuple[int, int] = (2, 4)
    """Fewest and most input views. Each step picks a number for all scenes of its batch. With --supervision pictures, 1 1 and no targets
    make each sample a single image of another scene."""
    targets: int = 2
    """Target views per scene, rendered and compared, besides the input views."""
    frames: Frames = "covisible"
    """Which frames of a folder's scene form a sample. covisible: views that share enough of what they see, wherever they stand in the file.
    consecutive: a frame and the input views around it in file order, as semgs evaluate takes them."""
    context_targets: bool = False
    """Also render and compare the input views (not in the paper). Depth is easiest to learn there."""
    learning_rate: float = 2e-4
    """Peak learning rate of Adam (the paper's)."""
    warmup: float = 0.01
    """Share of the steps in which the learning rate rises (MVSplat's OneCycle)."""
    clip: float = 0.5
    """Clip the gradient to this norm (MVSplat's)."""
    average_decay: float = 0.999
    """Decay of the moving average of the weights, which is what is validated and exported. It starts lower."""
    losses: LossWeights = field(default_factory=LossWeights)
    """Weights of the paper's three loss terms."""
    class_weights: tuple[float, ...] | Literal["inverse_root_frequency", "inverse_fourth_root_frequency"] | None = None
    """Weight of each class in the cross-entropy; None weighs all alike, as the paper does. inverse_root_frequency counts how often each class
    occurs in the data and favours rare ones; inverse_fourth_root_frequency favours them less."""
    depth_weight: float = 0.0
    """Weight of the error in log depth of the input views, if their true depth is known (not in the paper)."""
    supervision: SupervisedBy = "rendered"
    """What the loss compares. rendered: rendered views, as in the paper. labels: classes of the input views' own pixels, before splatting; trains
    only the semantic branch and shared layers, five times faster. pictures: the same for each view by itself, without the transformer between
    views; a first stage that learns what things look like. depth: depth of the plane sweep against true depth; needs depth, but no labels."""
    depth_losses: DepthLossWeights = field(default_factory=DepthLossWeights)
    """Weights of the loss terms for --supervision depth."""
    hold_shared: bool = False
    """Freeze the layers that both branches share. With supervision by labels or pictures, depth and colour do not change; without it, a
    rendered stage has to restore them. With supervision by depth, classes do not change."""
    sampling: Sampling = "even"
    """even: every scene of a folder is equally likely. balanced: scenes with rare classes are more likely. Single images always take turns."""
    augmentation: Augmentation = field(default_factory=Augmentation)
    """Random changes to the samples; all off by default."""
    init: str = "random"
    """Where to start: random, the name of included weights (small), a weights file, or hf://OWNER/NAME on the hub. base also takes MVSplat's
    checkpoint."""
    backbone: str = ""
    """Published MobileNetV2 weights to start the class backbone from (with --network.class-backbone): an ImageNet classifier or a
    segmentation network, as safetensors; see docs/train.md."""
    backbone_rate: float = 0.1
    """Learning rate of the class backbone, relative to the other layers; 0 freezes it."""
    class_rate: float = 1.0
    """Learning rate of all layers that classify each view by itself, backbone included, relative to the other layers; 0 freezes them."""
    sweep_rate: float = 1.0
    """Learning rate of all layers that depth by plane sweep depends on, relative to the other layers; 0 freezes them. Use 0.1 in a rendered
    stage after --supervision depth, so that colours and opacities adapt and depth stays good."""
    teacher: str = ""
    """Folder with another network's class probabilities for the training images, from scripts/teach.py. The network also learns these, so the
    backbone does not forget real photos. Needs single images."""
    teacher_weight: float = 1.0
    """Weight of that second loss, a Kullback-Leibler divergence."""
    semantic_branch: SemanticBranch = "kept"
    """Keep the semantic branch of the initial weights, or reinitialise it and keep depth and colour."""
    classes: ClassTable | None = None
    """Your own class table (JSON). Scenes with other tables are matched by class name. Weights with another table lose only their class
    head."""
    network: Switches = field(default_factory=Switches)
    """Switches of the network."""
    seed: int = 0
    """Random seed of the weights and of every sample."""
    scene_reuse: int = 1
    """Samples taken from each generated room, on average. 1 generates a new room for every sample; more is cheaper and shows fewer rooms
    (they are cached in RUN/rooms)."""
    assets: tuple[str, ...] = ()
    """Folder of meshes and images for the rooms; see semgs rooms --help. Repeatable. Validation rooms use pieces that training never
    sees."""
    validation: str = ROOMS
    """Validation scenes: rooms, or a folder of scenes that you do not train on."""
    validate_every: int = 1000
    """Steps between validations."""
    validation_scenes: int = 16
    """Number of validation samples; they are fixed and never trained on."""
    preset: str = field(default="", compare=False)
    """The preset that these began as; it decides nothing."""

    def __post_init__(self) -> None:
        fewest, most = self.contexts
        for text in self.data:
            Source.parsed(text)
        words = {"frames": Frames, "supervision": SupervisedBy, "sampling": Sampling, "semantic_branch": SemanticBranch}
        for name, kind in words.items():
            if getattr(self, name) not in get_args(kind):
                raise ValueError(f"{name} is {getattr(self, name)!r}; expected one of {', '.join(get_args(kind))}")
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
                len(self.class_weights) == count
                if isinstance(self.class_weights, tuple)
                else self.class_weights is None or self.class_weights in CLASS_WEIGHTINGS,
                f"{count} factors, one for each class of the table, {', '.join(CLASS_WEIGHTINGS)}, or None",
            ),
            "depth_weight": (self.depth_weight >= 0, "0 or more"),
            "scene_reuse": (self.scene_reuse >= 1, "at least 1"),
            "seed": (
                self.seed >= 0 and self.seed not in (VALIDATION_SEED, demo.SEED),
                f"0 or more, and neither {VALIDATION_SEED} nor {demo.SEED}, which are the seeds of the validation rooms and the demo",
            ),
            "hold_shared": (
                not self.hold_shared or self.supervision != "rendered",
                "False, unless supervision is labels, pictures or depth",
            ),
            "augmentation.roll": (
                alone or not self.augmentation.roll,
                "0, except with supervision by pictures: the corners of a rotated image are made up",
            ),
            "augmentation.exposure": (
                self.supervision != "rendered" or not self.augmentation.exposure,
                "0 with supervision by rendered views, whose colours are compared",
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
                "none, except with single pictures (--supervision pictures --contexts 1 1 --targets 0)",
            ),
            "teacher_weight": (self.teacher_weight > 0, "a positive number"),
            "validate_every": (self.validate_every >= 1, "at least 1"),
            "validation_scenes": (self.validation_scenes >= 0, "0 or more"),
        }
        for name, (holds, expected) in checks.items():
            if not holds:
                raise ValueError(f"{name} is {attrgetter(name)(self)}; expected {expected}")

    def check_whole(self) -> None:
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

    @property
    def single_pictures(self) -> bool:
        """Whether each sample is a single image, so that every image of a batch shows another scene."""
        return self.supervision == "pictures" and self.contexts == (1, 1) and self.targets == 0

    @property
    def sources(self) -> tuple[Source, ...]:
        """The sources that `data` names."""
        return tuple(Source.parsed(text) for text in self.data)

    def as_json(self) -> dict:
        """The settings as plain JSON."""
        return asdict(self)

    def published(self) -> dict:
        """The settings as JSON for publishing: of each path in `PLACES` only the last part; hub ids stay."""

        def named(value: Any) -> Any:
            if isinstance(value, tuple):
                return tuple(map(named, value))
            return value if "://" in value else PurePath(value).name

        return self.as_json() | {place: named(getattr(self, place)) for place in PLACES}

    @classmethod
    def from_json(cls, saved: dict) -> TrainingSettings:
        """The settings from `as_json`; missing fields take their defaults.

        Raises:
            ValueError: this version does not know a field.
        """
        unknown = sorted(set(saved) - {one.name for one in fields(cls)})
        if unknown:
            raise ValueError(f"this version of semgs does not know the settings {', '.join(unknown)}")
        values = _with_tuples(saved)
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
    """Values from JSON, with lists as tuples."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in saved.items()}

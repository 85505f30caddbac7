"""Settings of the data: which scenes a training sees and in which proportion, what its samples look like, and how they are changed at random. No torch."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Literal, get_args

from semgs.data import demo_scene
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.records import check_values

ROOMS = "rooms"
"""The name of generated rooms among the sources."""


@dataclass(frozen=True)
class Source:
    """One source of training scenes.

    Attributes:
        path: a scene or a folder of scenes; "rooms" for generated rooms.
        weight: its share of the samples, relative to the weights of the other sources.
    """

    path: str
    weight: Fraction

    @classmethod
    def parsed(cls, text: str) -> Source:
        """From "PATH=WEIGHT", or "PATH" for weight 1.

        Raises:
            ValueError: the weight is not a positive number, or there is no path.
        """
        match = re.fullmatch(r"([^=].*?)(?:=([^=/]*))?", text)
        try:
            weight = Fraction(match[2] or "1" if match else "")
        except (ValueError, ZeroDivisionError):
            weight = Fraction(0)
        if match is None or weight <= 0:
            raise ValueError(f"data is {text!r}; expected {ROOMS} or DIR, optionally with =WEIGHT, a positive number")
        return cls(match[1], weight)

    @property
    def is_rooms(self) -> bool:
        """Whether its scenes are generated rooms."""
        return self.path == ROOMS


@dataclass(frozen=True)
class Augmentation:
    """Random changes to samples. All but `exposure` are the same for all of its views and their cameras."""

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
        checks = {
            name: (low <= getattr(self, name) <= high, f"{low} to {high}") for name, (low, high) in bounds.items()
        }
        check_values(self, **checks)


Frames = Literal["covisible", "consecutive"]
Sampling = Literal["even", "balanced"]

VALIDATION_SEED = 2**31 - 1
"""Seed of the validation rooms, the same for every run; no training may use it."""


@dataclass(frozen=True, kw_only=True)
class DataSettings:
    """Where scenes come from and what is made of them, for training and validation."""

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
    """Fewest and most input views. Each step picks a number for all scenes of its batch. Not used with --supervision pictures."""
    targets: int = 2
    """Target views per scene, rendered and compared, besides the input views. Not used with --supervision pictures."""
    frames: Frames = "covisible"
    """Which frames of a folder's scene form a sample. covisible: views that share enough of what they see, wherever they stand in the file.
    consecutive: a frame and the input views around it in file order, as semgs evaluate takes them."""
    sampling: Sampling = "even"
    """even: every scene of a folder is equally likely. balanced: scenes with rare classes are more likely. Single images always take turns."""
    augmentation: Augmentation = field(default_factory=Augmentation)
    """Random changes to the samples; all off by default."""
    classes: ClassTable | None = None
    """Your own class table (JSON). Scenes with other tables are matched by class name. Weights with another table lose only their class
    head."""
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
    validation_scenes: int = 16
    """Number of validation samples; they are fixed and never trained on."""

    def __post_init__(self) -> None:
        fewest, most = self.contexts
        for text in self.data:
            Source.parsed(text)
        try:
            Source.parsed(self.validation)
        except ValueError:
            raise ValueError(f"validation is {self.validation!r}; expected {ROOMS} or DIR") from None
        check_values(
            self,
            batch=(self.batch >= 1, "at least 1"),
            size=(min(self.size) >= 16, "at least 16 pixels a side"),
            half_size=(
                0 <= self.half_size <= 1 and (not self.half_size or min(self.size) >= 32),
                "a share in 0..1, and 0 if a side is below 32 pixels",
            ),
            contexts=(2 <= fewest <= most, "fewest and most input views, 2 or more, in this order"),
            targets=(self.targets >= 1, "at least 1"),
            frames=(self.frames in get_args(Frames), f"one of {', '.join(get_args(Frames))}"),
            sampling=(self.sampling in get_args(Sampling), f"one of {', '.join(get_args(Sampling))}"),
            seed=(
                0 <= self.seed < 2**63 and self.seed not in (VALIDATION_SEED, demo_scene.SEED),
                f"0 to 2^63 - 1, and neither {VALIDATION_SEED} nor {demo_scene.SEED}, which are the seeds of the validation rooms and the demo",
            ),
            scene_reuse=(self.scene_reuse >= 1, "at least 1"),
            validation_scenes=(self.validation_scenes >= 0, "0 or more"),
        )

    @property
    def needs_rooms(self) -> bool:
        """Whether rooms are generated, to train on or to validate with."""
        validation = self.validation_scenes > 0 and Source.parsed(self.validation).is_rooms
        return validation or bool(self.assets) or any(source.is_rooms for source in self.sources)

    @property
    def sources(self) -> tuple[Source, ...]:
        """The sources that `data` names."""
        return tuple(Source.parsed(text) for text in self.data)

    @property
    def table(self) -> ClassTable:
        """The class table of the run."""
        return self.classes or SCANNET20


def view_counts(settings: DataSettings, single_images: bool) -> tuple[tuple[int, int], int]:
    """Fewest and most input views of a sample, and its target views: those of the settings, or one and none for single images."""
    return ((1, 1), 0) if single_images else (settings.contexts, settings.targets)

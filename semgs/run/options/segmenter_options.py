"""Options of commands that take classes and features from elsewhere."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from semgs.files.errors import InputError
from semgs.files.paths import found_at
from semgs.run.options.words import INLINE, optional
from semgs.run.usage_errors import UsageError
from semgs.segmenters.tables import make_word_table

if TYPE_CHECKING:
    from collections.abc import Callable

    from semgs.data.scene import Scene
    from semgs.run.options.types import Looks
    from semgs.runtime.stopwatch import Stages
    from semgs.segmenters.features.scene_features import Featuring
    from semgs.segmenters.labelling import Labelling

FOLDER = "segmenter"
"""Folder in the output for the maps of a segmentation network."""


@dataclass(frozen=True)
class AnswerOptions:
    """What a segmenter's answers are, and what they mean."""

    excludes: ClassVar = {
        "--classes own": ("--correspondence",),
        "--words": ("--correspondence", "--classes scannet20"),
    }

    classes: Annotated[Literal["scannet20", "own"] | None, optional()] = None
    """Translate the segmenter's classes to ScanNet's 20 by name, or keep its own. By default class maps keep their own, and networks are
    translated."""
    words: Annotated[tuple[str, ...], optional("WORD [WORD ...]")] = ()
    """Classes to look for with a text-prompted model: chair mug "power socket". What none of them describes becomes "none of these"."""
    correspondence: Annotated[Path | None, optional("FILE")] = None
    """What the segmenter's classes mean, a file as in docs/segmenters.md; by default class names decide."""

    def check(self) -> None:
        """Check what can be checked without importing torch.

        Raises:
            UsageError: options contradict each other, a word is empty, or two are equal.
        """
        if not self.words:
            return
        try:
            make_word_table(self.words)
        except ValueError as error:
            raise UsageError(f"--words: {error}") from None


@dataclass(frozen=True)
class SegmenterOptions:
    """Classes from a 2D segmenter instead of the model's own."""

    only_with: ClassVar = {"--segmenter": ("--classes", "--words", "--with-own-classes", "--correspondence")}
    excludes: ClassVar = {"--with-own-classes": ("--classes own", "--words")}

    segmenter: Annotated[str | None, optional("SEGMENTER")] = None
    """Take the classes from a 2D segmenter: a folder of class maps, an exported network (.onnx, .tflite), a model folder of
    transformers, or hf:OWNER/NAME; see docs/segmenters.md. Its answers are made consistent between the input views."""
    answers: Annotated[AnswerOptions, INLINE] = field(default_factory=AnswerOptions)
    with_own_classes: bool = False
    """With --segmenter: the model's own classes vote too. A --correspondence may say how much each does."""

    @property
    def replaces(self) -> bool:
        """Whether the classes are a segmenter's alone."""
        return self.segmenter is not None and not self.with_own_classes

    @property
    def inputs(self) -> tuple[str | Path | None, ...]:
        """The files and folders to read."""
        return self.segmenter, self.answers.correspondence

    def check(self, looks: Looks | None) -> None:
        """Check what can be checked without importing torch.

        Args:
            looks: how often the network is to look at each photo; None for the default.

        Raises:
            UsageError: an option needs --segmenter, or options contradict each other.
        """
        self.answers.check()
        if looks == 2 and self.replaces:
            raise UsageError("--looks 2 is for the network's own classes, and --segmenter replaces them")

    def labelling(self, save: Path | None = None, earlier: Path | None = None) -> Callable[[Scene], Labelling] | None:
        """What gives the Gaussians of a scene their classes; None without a segmenter.

        Args:
            save: new folder for the maps of a network; None for none.
            earlier: folder in which an earlier run may have saved maps.

        Raises:
            InputError: the segmenter cannot be used. So does the returned function.
            ImportError: the library that runs it is not installed.
        """
        if self.segmenter is None:
            return None
        from semgs.segmenters.labelling import Labelling
        from semgs.segmenters.opening import open_class_sources, read_correspondence

        answers = self.answers
        opened = open_class_sources(
            self.segmenter, answers.classes, answers.correspondence, save, earlier, answers.words
        )
        votes = None if answers.correspondence is None else read_correspondence(answers.correspondence).votes
        return lambda scene: Labelling(opened(scene), self.with_own_classes, votes)

    def load(self, scene: Scene, folder: Path, out: Path, stages: Stages) -> Labelling | None:
        """As `labelling` for one scene, as a stage. A network's maps are saved in the new output folder; those of an earlier run are in `out`."""
        if self.segmenter is None:
            return None
        with stages("load", f"Loading {self.segmenter}"):
            opened = self.labelling(folder / FOLDER, out / FOLDER)
            return opened and opened(scene)


@dataclass(frozen=True)
class FeatureOptions:
    """Features from any network, to search the scene with semgs query."""

    features: Annotated[Path | None, optional("DIR")] = None
    """Give the Gaussians features: DIR/FRAME.npy (or .npz) has those of an input photo, [numbers height width], of any floating-point type;
    see docs/segmenters.md. They are compressed to at most 32 numbers for each Gaussian and made consistent between the input views."""

    def check(self) -> None:
        """Check what can be checked without importing torch.

        Raises:
            InputError: there is no such folder.
        """
        if self.features is not None and not self.features.is_dir():
            raise InputError(self.features, "a folder of feature maps", found_at(self.features))

    def featuring(self, scene: Scene) -> Featuring | None:
        """What gives the Gaussians of a scene their features; None without the option.

        Raises:
            InputError: there is no such folder.
        """
        if self.features is None:
            return None
        from semgs.segmenters.features.feature_files import FeatureFiles
        from semgs.segmenters.features.scene_features import Featuring

        return Featuring(FeatureFiles.opened(self.features, scene))

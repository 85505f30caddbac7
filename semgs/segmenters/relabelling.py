"""Scenes whose labels are a segmenter's instead of those of their files, so that `semgs.data.preparation` writes them for training."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, final

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.maps import Pixels
from semgs.data.origin.terms import Labeller
from semgs.data.preparation.prepared_set import Reading, SceneSource
from semgs.data.resampling import nearest
from semgs.data.scene import Scene
from semgs.data.tables.classes import IGNORE
from semgs.files.contents import sha256
from semgs.files.errors import InputError
from semgs.files.paths import typed_path
from semgs.segmenters.class_source import ClassSource
from semgs.segmenters.opening import Table, is_map_folder, open_class_sources

MOST_PIXELS = 307_200
"""Distributions of larger photos are computed at this many pixels (480 x 640): with 150 classes they take 180 MB."""

UNNAMED = Labeller("class maps in files")
"""What the labels are from if maps do not say which network made them."""

TIE = 1e-6
"""Probabilities that are no further apart are equal, and then neither class is the answer."""


@final
@dataclass(frozen=True, eq=False)
class LikeliestClass:
    """The likeliest class of a frame's pixels by a segmenter, as a source of labels.

    Attributes:
        source: the segmenter.
        frame: the frame.
        confidence: pixels get no label if no class is this likely.
    """

    source: ClassSource
    frame: Frame
    confidence: float
    stored: ClassVar[bool] = False

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `ClassSource.of`.
        """
        size = self.frame.lens.size
        labels = likeliest_labels(self.source.of(self.frame, _reduced(size)), self.confidence)
        return replace(pixels, maps=None).taken(nearest(labels, size).numpy())  # undistorted already


def likeliest_labels(probabilities: Float[Tensor, "class h w"], confidence: float) -> UInt8[Tensor, "h w"]:
    """The likeliest class of each pixel; 255 if no class is as likely as `confidence`, or if several are the likeliest."""
    best, labels = probabilities.max(0)
    clear = (probabilities >= best - TIE).sum(0) == 1
    return torch.where((best >= confidence) & clear, labels, IGNORE).to(torch.uint8)


def relabel_scene(scene: Scene, source: ClassSource, confidence: float) -> Scene:
    """A scene with a segmenter's labels instead of its own."""
    frames = tuple(replace(frame, labels=LikeliestClass(source, frame, confidence)) for frame in scene.frames)
    made_by = source.made_by
    labeller = UNNAMED if made_by is None else Labeller(made_by.pinned, made_by.licence)
    return replace(scene, frames=frames, classes=source.classes, unread_labels=None, labeller=labeller)


@final
@dataclass(frozen=True)
class Relabelling:
    """Reads scenes for `semgs.data.preparation.prepared_set.PreparedSet` with a segmenter's labels.

    Attributes:
        reading: how to read the scenes.
        source_of: the segmenter as a source for a scene's frames.
        settings: describe the segmenter, for `settings.json`.
        confidence: as for `LikeliestClass`.
    """

    reading: Reading
    source_of: Callable[[Scene], ClassSource] = field(repr=False)
    settings: Mapping[str, Any]
    confidence: float = 0.5

    def open(self, source: SceneSource) -> Scene:
        """Open a scene.

        Raises:
            InputError: it cannot be opened, or there are no maps of it.
        """
        scene = self.reading.open(source)
        return relabel_scene(scene, self.source_of(scene), self.confidence)

    def as_json(self) -> dict[str, Any]:
        """The details for `settings.json`."""
        return {**self.reading.as_json(), **self.settings, "confidence": self.confidence}


def open_relabelling(
    segmenter: str,
    reading: Reading,
    classes: Table | None = None,
    confidence: float = 0.5,
    *,
    correspondence: Path | None = None,
    words: Sequence[str] = (),
    alone: bool = False,
) -> Relabelling:
    """Scenes with the labels of a segmenter.

    Args:
        segmenter: as for `semgs.segmenters.opening.open_class_sources`.
        reading: how to read the scenes.
        classes: the table of the labels, as for `open_class_sources`.
        confidence: as for `LikeliestClass`.
        correspondence, words: as for `open_class_sources`.
        alone: whether there is one scene only. Then class maps need no folder with its name.

    Raises:
        InputError: it cannot be read, is no segmenter, or less than half of its class names are known.
        ImportError: the library that runs it is not installed.
    """
    folder = typed_path(segmenter)
    found = open_class_sources(segmenter, classes, correspondence, words=words)

    def own(scene: Scene) -> ClassSource:
        if not alone and is_map_folder(folder) and not (folder / scene.name).is_dir():
            raise InputError(folder / scene.name, f"a folder with the class maps of scene {scene.name}", "none")
        return found(scene)

    name = folder.name if folder.exists() else segmenter
    settings: dict[str, Any] = {"segmenter": name, "classes": classes or "automatic"}
    if folder.is_file():
        settings["network"] = sha256(folder)
    if correspondence is not None:
        settings["correspondence"] = sha256(correspondence)
    if words:
        settings["words"] = list(words)
    return Relabelling(reading, own, settings, confidence)


def _reduced(size: tuple[int, int]) -> tuple[int, int]:
    """A size of the same aspect with at most `MOST_PIXELS`, about."""
    share = min(1.0, (MOST_PIXELS / (size[0] * size[1])) ** 0.5)
    return max(1, round(share * size[0])), max(1, round(share * size[1]))

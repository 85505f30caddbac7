"""Scenes whose labels are a segmenter's instead of those of their files, so that `semgs.preparation` writes them for training."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, final

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from semgs.data.classes import IGNORE
from semgs.data.frames import Frame
from semgs.data.labeller import Labeller
from semgs.data.maps import Pixels
from semgs.data.resampling import nearest
from semgs.data.scene import Scene
from semgs.files.errors import InputError
from semgs.files.paths import typed_path
from semgs.preparation.prepared_set import Reading, SceneSource
from semgs.segmenters.files import TABLE
from semgs.segmenters.opening import Table, open_segmenter, open_source
from semgs.segmenters.source import Source

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

    source: Source
    frame: Frame
    confidence: float
    stored: ClassVar[bool] = False

    def read(self, pixels: Pixels) -> UInt8[np.ndarray, "h w"]:
        """As `MapSource.read`.

        Raises:
            InputError: as `Source.of`.
        """
        size = self.frame.lens.size
        labels = likeliest_labels(self.source.of(self.frame, _reduced(size)), self.confidence)
        return replace(pixels, maps=None).taken(nearest(labels, size).numpy())  # undistorted already


def likeliest_labels(probabilities: Float[Tensor, "class h w"], confidence: float) -> UInt8[Tensor, "h w"]:
    """The likeliest class of each pixel; 255 if no class is as likely as `confidence`, or if several are the likeliest."""
    best, labels = probabilities.max(0)
    clear = (probabilities >= best - TIE).sum(0) == 1
    return torch.where((best >= confidence) & clear, labels, IGNORE).to(torch.uint8)


def relabelled(scene: Scene, source: Source, confidence: float) -> Scene:
    """A scene with a segmenter's labels instead of its own."""
    frames = tuple(replace(frame, labels=LikeliestClass(source, frame, confidence)) for frame in scene.frames)
    made_by = source.made_by
    labeller = UNNAMED if made_by is None else Labeller(made_by.name, made_by.licence)
    return replace(scene, frames=frames, classes=source.classes, unread_labels=None, labeller=labeller)


@final
@dataclass(frozen=True)
class Relabelling:
    """Reads scenes for `semgs.preparation.prepared_set.prepare_set` with a segmenter's labels.

    Attributes:
        reading: how to read the scenes.
        source_of: the segmenter of a scene, given its name in the set.
        segmenter: describes it, for `settings.json`.
        confidence: as for `LikeliestClass`.
    """

    reading: Reading
    source_of: Callable[[Scene, str], Source] = field(repr=False)
    segmenter: Mapping[str, Any]
    confidence: float = 0.5

    def open(self, source: SceneSource) -> Scene:
        """Open a scene.

        Raises:
            InputError: it cannot be opened, or there are no maps of it.
        """
        scene = self.reading.open(source)
        return relabelled(scene, self.source_of(scene, source.name), self.confidence)

    def as_json(self) -> dict[str, Any]:
        """The details for `settings.json`."""
        return {**self.reading.as_json(), "segmenter": dict(self.segmenter), "confidence": self.confidence}


def relabelling(
    segmenter: str, reading: Reading, classes: Table | None = None, confidence: float = 0.5, *, alone: bool = False
) -> Relabelling:
    """Scenes with the labels of a segmenter.

    A folder of class maps has a folder NAME/ for each scene, where NAME.zip will be the prepared scene. If `alone`, its maps may
    also be in the folder itself. The table of classes is NAME/classes.json, or classes.json in the folder itself for all scenes.

    Args:
        segmenter: such a folder, or as for `semgs.segmenters.opening.open_segmenter`.
        reading: how to read the scenes.
        classes: the table of the labels, as for `open_source`.
        confidence: as for `LikeliestClass`.
        alone: whether there is one scene only.

    Raises:
        InputError: it cannot be read, is no segmenter, or less than half of its class names are known.
        ImportError: the library that runs it is not installed.
    """
    folder = typed_path(segmenter)
    table = classes or "automatic"
    if not _of_maps(folder):
        network = open_segmenter(segmenter, classes or "scannet20")
        described = {**asdict(network.segmenter.made_by), "classes": table}
        return Relabelling(reading, lambda scene, name: network.source(scene), described, confidence)

    def maps(scene: Scene, name: str) -> Source:
        inside = folder / name
        if not inside.is_dir():
            if not alone:
                raise InputError(inside, f"a folder with the class maps of scene {name}", "none")
            inside = folder
        return open_source(str(inside), scene, classes, shared=folder)

    return Relabelling(reading, maps, {"maps": folder.absolute().name, "classes": table}, confidence)


def _of_maps(folder: Path) -> bool:
    """Whether this is a folder of class maps, or of such folders for several scenes."""
    return folder.is_dir() and ((folder / TABLE).is_file() or any(folder.glob(f"*/{TABLE}")))


def _reduced(size: tuple[int, int]) -> tuple[int, int]:
    """A size of the same aspect with at most `MOST_PIXELS`, about."""
    share = min(1.0, (MOST_PIXELS / (size[0] * size[1])) ** 0.5)
    return max(1, round(share * size[0])), max(1, round(share * size[1]))

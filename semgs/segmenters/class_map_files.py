"""Class maps in files, from whatever segmented the photos, and those of a network, which may be saved in such files.

    DIR/classes.json            the table: names, colours and the numbers that stand for them (docs/train.md)
    DIR/color/0.png             class numbers of the photo color/0.jpg, 8 bits, or
    DIR/color/0.npz             its probabilities [class height width], one array
    DIR/0.png, DIR/0.npz        the same, if no other frame of the scene has that file name without its ending
    DIR/segmenter.json          written by semgs: which network the maps are from, and a hash of each photo

A map covers the whole photo as it is stored, distortion included, and may be smaller if its aspect is the same. Maps that semgs wrote are of the
undistorted photo.
"""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, final

import numpy as np
import torch
from jaxtyping import Float, Float32, UInt8
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.maps import ASPECT_TOLERANCE, ClassMap
from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.data.tables.class_files import LabelSet, class_file, read_class_file
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.atomic import write_bytes, write_json
from semgs.files.contents import sha256_of
from semgs.files.errors import InputError
from semgs.files.strict_json import read_json
from semgs.segmenters.class_source import ClassSource, Segmenter
from semgs.sources.photo_maps import file_of, needed_file, normalised, one_hot, only_array, place_of, stems_of, to_view
from semgs.sources.source import BOUNDS, Cost, MadeBy, cost_of_photos

TABLE = "classes.json"
RECORD = "segmenter.json"
RECORDED = ("name", "digest", "licence")
ENDINGS = (".png", ".npz")

SUMS_TO_1 = 0.02
"""Probabilities in files sum to 1 up to this: they are often stored in half precision."""


@final
@dataclass(frozen=True)
class MapFiles(ClassSource):
    """A folder of class maps for the frames of one scene.

    Attributes:
        folder: contains them.
        labels: the table, and the meaning of numbers.
        stems: how many frames of the scene have each file name, without folders and ending.
        made_by: the network that semgs made them with; None for maps from elsewhere, which are of the photos as stored.
        photos: for each frame whose map semgs made, the hash of its undistorted photo.
    """

    folder: Path
    labels: LabelSet
    stems: Counter[str]
    made_by: MadeBy | None = None
    photos: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def opened(cls, folder: Path, scene: Scene, table: Path | None = None) -> MapFiles:
        """The maps in a folder.

        Args:
            folder: of the maps.
            scene: contains the frames.
            table: the folder of the class table, and of the record if the maps have none; None for that of the maps.

        Raises:
            InputError: its table of classes is missing or damaged, or two frames would share a map.
        """
        stems = stems_of(scene)
        labels = read_class_file((table or folder) / TABLE)
        if labels.table.names == SCANNET20.names:
            labels = replace(labels, table=SCANNET20)
        record = _record(folder) or _record(table or folder)
        named = {name: str(record[name]) for name in (*RECORDED, "revision") if name in record}
        made_by = MadeBy(**named) if record else None
        return cls(folder, labels, stems, made_by, record.get("photos", {}))

    @property
    def title(self) -> str:
        """The folder, and the network that made the maps if that is known."""
        return str(self.folder) if self.made_by is None else f"{self.folder}, made by {self.made_by.title}"

    @property
    def classes(self) -> ClassTable:
        """The table of the distributions."""
        return self.labels.table

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "class h w"]:
        """The distribution over the classes of every pixel of a frame; even where a number means no label.

        Raises:
            InputError: there is no map of the frame, or it is damaged, has another aspect than the photo, a number outside the table, another
                number of classes, or probabilities that do not sum to 1.
        """
        path = needed_file(self.folder, frame, self.stems, ENDINGS, "a map")
        if path.suffix == ".npz":
            return to_view(self.probabilities(path, frame), frame, size, fit, undistorted=self.made_by is not None)
        labelled = replace(frame, labels=ClassMap(path, self.classes, self.labels.meaning), depth=None, mask=None)
        labels = labelled.view(BOUNDS, self.classes, size=size, fit=fit).labels
        assert labels is not None
        return one_hot(labels[0], len(self.classes))

    def path_of(self, frame: Frame) -> Path | None:
        """The file with the map of a frame; None if there is none."""
        return file_of(self.folder, frame, self.stems, ENDINGS)

    def probabilities(self, path: Path, frame: Frame) -> Float32[np.ndarray, "class rows columns"]:
        """The probabilities in a `.npz` file.

        Raises:
            InputError: as `of`.
        """
        values = read_probabilities(path)
        count, (height, width) = len(self.classes), frame.lens.size
        if values.shape[0] != count:
            raise InputError(path, f"the {count} classes of {TABLE} along the first axis", f"{values.shape[0]}")
        rows, columns = values.shape[1:]
        if self.made_by is None and abs(rows * width / (columns * height) - 1) > ASPECT_TOLERANCE:
            raise InputError(path, f"{width}x{height} pixels (width x height), as its photo", f"{columns}x{rows}")
        return values


def read_probabilities(path: Path) -> Float32[np.ndarray, "class rows columns"]:
    """The only array of a `.npz` file, as probabilities.

    Raises:
        InputError: it is missing or damaged, has several arrays, or these are no probabilities [class height width].
    """
    expected = "one array of probabilities [class height width]"
    values = only_array(path, expected)
    if values.ndim != 3 or min(values.shape) < 1 or values.dtype.kind != "f":
        raise InputError(path, expected, f"{values.shape} of {values.dtype}")
    numbers = values.astype(np.float32)
    if not np.isfinite(numbers).all() or numbers.min() < 0:
        raise InputError(path, expected, "numbers that are negative or not finite")
    if (off := float(np.abs(numbers.sum(0) - 1).max())) > SUMS_TO_1:
        raise InputError(path, expected, f"sums over the classes that are off 1 by up to {off:.2g}")
    return normalised(torch.from_numpy(numbers)).numpy()


def save_table(folder: Path, classes: ClassTable, made_by: MadeBy) -> None:
    """Write the table and the record of maps, in a new folder.

    Raises:
        OSError: a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / TABLE, class_file(classes))
    write_json(folder / RECORD, {**asdict(made_by), "photos": {}})


def save_class_map(
    folder: Path, frame: Frame, probabilities: Float32[np.ndarray, "class rows columns"], photo: str
) -> None:
    """Write the map of a frame's undistorted photo, in half precision.

    Args:
        folder: that `save_table` wrote.
        frame: the frame.
        probabilities: the map.
        photo: hash of the undistorted photo.

    Raises:
        OSError: a file cannot be written.
    """
    record = _record(folder)
    write_json(folder / RECORD, {**record, "photos": {**record["photos"], frame.name: photo}})
    path = folder / place_of(frame).with_suffix(".npz")
    path.parent.mkdir(parents=True, exist_ok=True)
    file = io.BytesIO()
    np.savez_compressed(file, probabilities=probabilities.astype(np.float16))
    write_bytes(path, file.getbuffer())


def _record(folder: Path) -> dict[str, Any]:
    """The record in a folder: name, digest and licence of the network, and hashes of photos; empty if there is none.

    Raises:
        InputError: it is not one.
    """
    path = folder / RECORD
    if not path.is_file():
        return {}
    found: Any = read_json(path, "the record of a segmenter")
    if not isinstance(found, dict) or not all(isinstance(found.get(name), str) for name in RECORDED):
        raise InputError(path, f"an object with {', '.join(RECORDED)}", f"{found!r:.60}")
    if not isinstance(found.get("photos", {}), dict):
        raise InputError(path, "an object", f"{found['photos']!r:.60}", key="photos")
    return found


@final
@dataclass(frozen=True)
class Photos(ClassSource):
    """What a network says about the undistorted photos of a scene, each at its own size.

    Attributes:
        segmenter: the network.
        save: folder to write its maps to; None for nowhere.
        earlier: maps from an earlier run of the same network, which are not computed again for the same photos; None if there are none.
    """

    segmenter: Segmenter
    save: Path | None = None
    earlier: MapFiles | None = field(default=None, repr=False)

    @property
    def made_by(self) -> MadeBy:
        """The network."""
        return self.segmenter.made_by

    @property
    def classes(self) -> ClassTable:
        """The table of the network."""
        return self.segmenter.classes

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "class h w"]:
        """The distribution over the network's classes of every pixel of a frame.

        Raises:
            InputError: the photo cannot be read, or an earlier map is damaged.
        """
        image = frame.read_undistorted()
        stored = self._stored(frame, image)
        if stored is not None and self.earlier is not None:
            found = self.earlier.probabilities(stored, frame)
        else:
            found = self.segmenter(image)
        if self.save is not None:
            save_class_map(self.save, frame, found, sha256_of(image))
        return to_view(found, frame, size, fit, undistorted=True)

    def cost(self, frames: Sequence[Frame]) -> Cost | None:
        """What the network takes for the frames without an earlier map: that of a grey image of the largest size, for each of them.

        Raises:
            InputError: the network cannot take the image, or a photo cannot be read.
        """
        left = [frame for frame in frames if self.earlier is None or not self._stored(frame, frame.read_undistorted())]
        return cost_of_photos(self.segmenter, left) if left else None

    def _stored(self, frame: Frame, image: UInt8[np.ndarray, "h w 3"]) -> Path | None:
        """The earlier map of a frame; None if there is none, or if the photo was another one then.

        Args:
            frame: the frame.
            image: its undistorted photo.
        """
        if self.earlier is None or self.earlier.photos.get(frame.name) != sha256_of(image):
            return None
        return self.earlier.path_of(frame)

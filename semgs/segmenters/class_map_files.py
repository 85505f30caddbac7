"""Class maps in files, from whatever segmented the photos.

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
from pathlib import Path, PurePosixPath
from typing import Any, final

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32
from torch import Tensor

from semgs.data.frames import Frame
from semgs.data.maps import ASPECT_TOLERANCE, ClassMap
from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.data.tables.class_files import LabelSet, class_file, read_class_file
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.archives import members
from semgs.files.arrays import read_array
from semgs.files.atomic import write_bytes, write_json
from semgs.files.errors import InputError
from semgs.files.strict_json import read_json
from semgs.segmenters.photo_maps import normalised, one_hot, to_view

TABLE = "classes.json"
RECORD = "segmenter.json"
RECORDED = ("name", "digest", "licence")

SUMS_TO_1 = 0.02
"""Probabilities in files sum to 1 up to this: they are often stored in half precision."""

BOUNDS = (0.1, 10.0)
"""Near and far that a frame is read with for its labels alone, which do not depend on them."""


@dataclass(frozen=True)
class MadeBy:
    """Which network maps are from.

    Attributes:
        name: of the network: a file name or a hub id.
        digest: a hash of its weights.
        licence: of the network; "unknown" if it does not say.
        revision: the commit of the hub that it was; empty for files and folders. Another one with the same weights is the same network.
    """

    name: str
    digest: str
    licence: str = "unknown"
    revision: str = field(default="", compare=False)

    @property
    def title(self) -> str:
        """Name and licence."""
        return f"{self.name} (licence {self.licence})"

    @property
    def pinned(self) -> str:
        """The name; of a model of the hub with its commit, as hf:OWNER/NAME@COMMIT."""
        return f"{self.name.partition('@')[0]}@{self.revision}" if self.revision else self.name


@final
@dataclass(frozen=True)
class MapFiles:
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

    @property
    def known(self) -> Bool[np.ndarray, " class"]:
        """All of the table."""
        return np.ones(len(self.classes), bool)

    def of(self, frame: Frame, size: tuple[int, int], fit: Fit = "crop") -> Float[Tensor, "class h w"]:
        """The distribution over the classes of every pixel of a frame; even where a number means no label.

        Raises:
            InputError: there is no map of the frame, or it is damaged, has another aspect than the photo, a number outside the table, another
                number of classes, or probabilities that do not sum to 1.
        """
        path = self.path_of(frame)
        if path is None:
            name = PurePosixPath(frame.name)
            wanted = f"a map of frame {frame.name}: {name.with_suffix('.png')} or {name.with_suffix('.npz')}"
            raise InputError(self.folder, wanted, "none")
        if path.suffix == ".npz":
            return to_view(self.probabilities(path, frame), frame, size, fit, undistorted=self.made_by is not None)
        labelled = replace(frame, labels=ClassMap(path, self.classes, self.labels.meaning), depth=None, mask=None)
        labels = labelled.view(BOUNDS, self.classes, size=size, fit=fit).labels
        assert labels is not None
        return one_hot(labels[0], len(self.classes))

    def path_of(self, frame: Frame) -> Path | None:
        """The file with the map of a frame; None if there is none."""
        return file_of(self.folder, frame, self.stems, (".png", ".npz"))

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


def stems_of(scene: Scene) -> Counter[str]:
    """How many frames of a scene have each file name, without folders and ending.

    Raises:
        InputError: the names of two frames differ only in their endings, so one map would belong to both.
    """
    frames: dict[PurePosixPath, str] = {}
    for frame in scene.frames:
        other = frames.setdefault(place_of(frame).with_suffix(""), frame.name)
        if other != frame.name:
            expected = "frames whose names differ in more than their endings, as each has a map of its own"
            raise InputError(scene.path, expected, f"{other} and {frame.name}")
    return Counter(PurePosixPath(frame.name).stem for frame in scene.frames)


def file_of(folder: Path, frame: Frame, stems: Counter[str], endings: Sequence[str]) -> Path | None:
    """The file in a folder that belongs to a frame; None if there is none.

    Args:
        folder: has the same folders as the names of frames, or contains the files itself.
        frame: the frame.
        stems: of the scene, as from `stems_of`. Files in the folder itself count for names that are unique.
        endings: that the file may have, the preferred one first.
    """
    name = place_of(frame)
    places = [folder / name.parent / name.stem]
    if stems[name.stem] == 1:
        places.append(folder / name.stem)
    candidates = (place.parent / f"{place.name}{ending}" for place in places for ending in endings)
    return next((path for path in candidates if path.is_file()), None)


def place_of(frame: Frame) -> PurePosixPath:
    """The name of a frame as a path inside a folder: `_` replaces a root and each step up, as scenes may list photos outside their folder."""
    parts = PurePosixPath(frame.name).parts
    return PurePosixPath(*("_" if part == ".." or part.startswith("/") else part for part in parts))


def only_array(path: Path, expected: str) -> np.ndarray:
    """The only array of a `.npz` file, or that of a `.npy` file.

    Args:
        path: the file.
        expected: what it should be, for errors.

    Raises:
        InputError: it is missing or damaged, or has several arrays.
    """
    if path.suffix == ".npy":
        return read_array(path)
    found = list(members(path).values())
    if len(found) != 1:
        raise InputError(path, expected, f"{len(found)} arrays")
    return read_array(found[0])


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

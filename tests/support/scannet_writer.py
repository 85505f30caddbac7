"""Writes the miniature room as ScanNet stores it, byte by byte from the format's description."""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from cast_room import Photo, miniature, pinhole_rays, poses
from PIL import Image

COLOUR_SIZE, DEPTH_SIZE = (121, 162), (60, 80)
"""An eighth of ScanNet's 968x1296 and 480x640 (height x width): their aspects differ as those do."""
COLOUR_K = np.array([[146.2, 0, 80.97], [0, 145.9, 61.2], [0, 0, 1]])
DEPTH_K = np.array([[72.2, 0, 39.9], [0, 72.3, 30.3], [0, 0, 1]])
"""With the centre of the first pixel at (0, 0), as ScanNet has it."""

TSV_HEADER = "id\traw_category\tcategory\tcount\tnyu40id\teigen13id\tnyuClass\tnyu40class"
TSV_ROWS = (
    (1, "wall", 1), (3, "floor", 2), (7, "cabinet", 3), (11, "bed", 4), (2, "chair", 5), (6, "couch", 6), (4, "table", 7),
    (5, "door", 8), (16, "window", 9), (18, "bookshelf", 10), (15, "picture", 11), (35, "counter", 12), (9, "desk", 14),
    (21, "curtain", 16), (27, "refrigerator", 24), (55, "shower curtain", 28), (17, "toilet", 33), (14, "sink", 34),
    (42, "bathtub", 36), (56, "trash can", 39), (41, "ceiling", 22), (22, "books", 23), (22, "book", 23), (1163, "object", 40),
    (188, "shower door", 8), (188, "shower doors", 38), (10, "office chair", 5), (1188, "poster", 11), (19, "monitor", 40),
)  # fmt: skip
"""(id, raw category, NYU40 class) of some rows of the real table; the last row of an id counts."""
RAW_OF_LABEL = (1, 3, 7, 11, 2, 6, 4, 5, 16, 18, 15, 35, 9, 21, 27, 55, 17, 14, 42, 56)
"""An id that means each of the 20 classes."""
VOID_IDS = (0, 41, 22, 1163, 4000)
"""Ids that mean none: nobody labelled, a class outside the 20, one that the table lacks."""


@dataclass(frozen=True, eq=False)
class Scan:
    """What is written, and what has to be read.

    Attributes:
        poses: camera to world [n 4 4], not finite where tracking was lost.
        jpegs: the pictures as they are stored.
        depths: uint16 [n h w], millimetres.
        ids: of the labels, uint16 [n h w].
        labels: what these mean, 255 = none.
    """

    poses: np.ndarray
    jpegs: tuple[bytes, ...]
    depths: np.ndarray
    ids: np.ndarray
    labels: np.ndarray
    lost: tuple[int, ...] = field(default=())

    @property
    def images(self) -> np.ndarray:
        """The pictures as anybody decodes them, uint8 [n h w 3]."""
        return np.stack([np.asarray(Image.open(io.BytesIO(jpeg))) for jpeg in self.jpegs])

    @property
    def posed(self) -> list[int]:
        """The frames that can be used."""
        return [number for number in range(len(self.jpegs)) if number not in self.lost]


def scan(lost: Sequence[int] = (2, 4), colour_size: tuple[int, int] = COLOUR_SIZE) -> Scan:
    """Six frames of the room; in `lost` ones tracking was lost, as ScanNet writes it (-inf) or as NaN."""
    room, seen = miniature(), poses()
    rng = np.random.default_rng(0)
    photos: list[Photo] = []
    depths, ids = [], []
    for pose in seen:
        photo = room.photograph(pose, pinhole_rays(colour_size, COLOUR_K, 0))
        photos.append(photo)
        depths.append(room.photograph(pose, pinhole_rays(DEPTH_SIZE, DEPTH_K, 0)).depth)
        void = rng.choice(VOID_IDS, colour_size)
        ids.append(np.where(photo.labels == 255, void, np.append(RAW_OF_LABEL, np.zeros(236, int))[photo.labels]))
    for number in lost:
        seen[number] = -np.inf if number % 2 else np.nan
    return Scan(
        seen,
        tuple(jpeg(photo.colour) for photo in photos),
        np.stack(depths),
        np.stack(ids).astype(np.uint16),
        np.stack([photo.labels for photo in photos]),
        tuple(lost),
    )


def long_scan(frames: int, lost: int | None = None) -> Scan:
    """A scan whose six frames repeat; in one of them, tracking was lost."""
    six = scan(lost=())
    order = np.arange(frames) % 6
    poses = six.poses[order].copy()
    if lost is not None:
        poses[lost] = -np.inf
    jpegs = tuple(six.jpegs[number] for number in order)
    return replace(
        six, poses=poses, jpegs=jpegs, depths=six.depths[order], ids=six.ids[order], labels=six.labels[order]
    )


def jpeg(colour: np.ndarray) -> bytes:
    """A picture as a JPEG."""
    file = io.BytesIO()
    Image.fromarray(colour).save(file, "JPEG", quality=90)
    return file.getvalue()


def png(values: np.ndarray) -> bytes:
    """A map as a PNG."""
    file = io.BytesIO()
    Image.fromarray(values).save(file, "PNG")
    return file.getvalue()


def sens(
    written: Scan,
    *,
    colour_size: tuple[int, int] = COLOUR_SIZE,
    version: int = 4,
    colour_codec: int = 2,
    depth_codec: int = 1,
    declared: int | None = None,
    depth_extrinsic: np.ndarray | None = None,
    shift: float = 1000.0,
    colour_k: np.ndarray = COLOUR_K,
    depth_k: np.ndarray = DEPTH_K,
    depth_size: tuple[int, int] | None = None,
) -> bytes:
    """The bytes of a `.sens` file."""

    def whole(number: int, count: int) -> bytes:
        return number.to_bytes(count, "little", signed=number < 0)

    def floats(matrix: np.ndarray) -> bytes:
        return np.ascontiguousarray(matrix, "<f4").tobytes()

    def square(k: np.ndarray) -> np.ndarray:
        full = np.eye(4)
        full[:3, :3] = k
        return full

    name = b"StructureSensor"
    parts = [whole(version, 4), whole(len(name), 8), name]
    parts += [floats(square(colour_k)), floats(np.eye(4)), floats(square(depth_k))]
    parts += [floats(np.eye(4) if depth_extrinsic is None else depth_extrinsic)]
    parts += [whole(colour_codec, 4), whole(depth_codec, 4)]
    parts += [whole(side, 4) for side in (*colour_size[::-1], *(depth_size or written.depths.shape[1:])[::-1])]
    parts += [np.float32(shift).tobytes(), whole(len(written.jpegs) if declared is None else declared, 8)]
    for number, (pose, colour, depth) in enumerate(zip(written.poses, written.jpegs, written.depths, strict=True)):
        packed = zlib.compress(depth.astype("<u2").tobytes())
        parts += [floats(pose), whole(1000 + number, 8), whole(1001 + number, 8)]
        parts += [whole(len(colour), 8), whole(len(packed), 8), colour, packed]
    return b"".join((*parts, whole(0, 8)))  # no measurements of motion


def tsv(end: str = "\n") -> bytes:
    """The table of labels, as far as it is needed here."""
    rows = [f"{raw}\t{name}\t{name}\t9\t{nyu}\t1\t{name}\t{name}" for raw, name, nyu in TSV_ROWS]
    return (end.join((TSV_HEADER, *rows)) + end).encode()


def label_zip(path: Path, written: Scan, leave_out: Collection[int] = ()) -> None:
    """The zip file of the labels."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("label-filt/", b"")
        for number, ids in enumerate(written.ids):
            if number not in leave_out:
                method = zipfile.ZIP_DEFLATED if number % 2 else zipfile.ZIP_STORED
                archive.writestr(zipfile.ZipInfo(f"label-filt/{number}.png"), png(ids), method)


def write_raw(root: Path, written: Scan, name: str = "scene0000_00") -> Path:
    """A scan as it is downloaded: `scans/NAME/NAME.sens` and its zip file, the table above; returns the scan's folder."""
    folder = root / "scans" / name
    folder.mkdir(parents=True)
    (root / "scannetv2-labels.combined.tsv").write_bytes(tsv())
    (folder / f"{name}.sens").write_bytes(sens(written))
    label_zip(folder / f"{name}_2d-label-filt.zip", written)
    (folder / f"{name}.txt").write_text("colorHeight = 121\ncolorWidth = 162\nsceneType = Office\n")
    return folder


def matrix_text(matrix: np.ndarray, end: str = "\n") -> bytes:
    """A matrix as ScanNet's exporter writes it."""
    return (end.join(" ".join(f"{value:f}" for value in row) for row in matrix) + end).encode()


def write_extracted(
    root: Path,
    written: Scan,
    name: str = "scene0000_00",
    *,
    digits: int = 0,
    end: str = "\n",
    labels: str | None = "label-filt",
    colour_k: np.ndarray = COLOUR_K,
    depth_k: np.ndarray = DEPTH_K,
) -> Path:
    """What ScanNet's exporter in Python leaves, with the labels unzipped; returns the scan's folder."""
    folder = root / name
    for place in ("color", "depth", "pose", "intrinsic", *([labels] if labels else [])):
        (folder / place).mkdir(parents=True)
    (root / "scannetv2-labels.combined.tsv").write_bytes(tsv(end))
    for number in range(len(written.jpegs)):
        stem = f"{number:0{digits}d}" if digits else f"{number}"
        (folder / "color" / f"{stem}.jpg").write_bytes(written.jpegs[number])
        (folder / "depth" / f"{stem}.png").write_bytes(png(written.depths[number]))
        (folder / "pose" / f"{stem}.txt").write_bytes(matrix_text(written.poses[number], end))
        if labels:
            (folder / labels / f"{stem}.png").write_bytes(png(written.ids[number]))
    for camera, k in (("color", colour_k), ("depth", depth_k)):
        full = np.eye(4)
        full[:3, :3] = k
        (folder / "intrinsic" / f"intrinsic_{camera}.txt").write_bytes(matrix_text(full, end))
        (folder / "intrinsic" / f"extrinsic_{camera}.txt").write_bytes(matrix_text(np.eye(4), end))
    return folder

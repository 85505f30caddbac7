"""ScanNet: scans as they are released (`.sens`, `*_2d-label-filt.zip`), and as its exporters leave them (`color/ depth/ pose/`).

Poses are camera to world with OpenCV axes, in metres; where tracking was lost they are not finite, and such frames are dropped, so
that frames count as in the peers' code. Intrinsics are pixels with the *centre* of the first pixel at (0, 0) (ScanNet's own tools
project and undistort so), and get half a pixel here. Depth is 16 bits, in millimetres unless a recording says otherwise, of a camera
of its own at the place of the colour camera; it is brought to the colour camera by both K. Labels are ids of `semgs.data.layouts.scannet.labels`.
http://www.scan-net.org, https://github.com/ScanNet/ScanNet
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semgs.data.classes import SCANNET20
from semgs.data.frames import Frame
from semgs.data.layouts.parts.poses import checked_poses
from semgs.data.layouts.scannet.files import read_fields, read_numbers
from semgs.data.layouts.scannet.labels import FILE_NAME, find_table, labels_of_ids, read_table
from semgs.data.layouts.scannet.sens import read_recording
from semgs.data.lens import Lens
from semgs.data.maps import DepthMap, DepthThroughLens, IdMap, MapSource, read_ids
from semgs.data.nyu40 import NAMES
from semgs.data.peers import GSNERF_LABELS, READINGS, ROWS_972
from semgs.data.scene import Scene
from semgs.files.archives import members
from semgs.files.errors import InputError
from semgs.files.pictures import read_header, read_uint16
from semgs.files.stored import Stored

LAYOUT = "ScanNet"
LOOKED_FOR = "a ScanNet scan (SCAN.sens, or color/ and pose/)"
APPLICABLE = (ROWS_972, GSNERF_LABELS)

COLOUR_SIZE, DEPTH_SIZE = (968, 1296), (480, 640)
"""(height, width) that ScanNet's intrinsics are for, where nothing else is said [px]."""
PEERS_ASPECT = 3 / 4
"""Height over width that the peers take the pictures to have: 972 rows for 1296 columns."""
CENTRAL = 0.1
"""Intrinsics are for pictures of a size if their principal point is this near the middle, in widths and heights."""

MILLIMETRE = 0.001
FILTERED, UNFILTERED, ZIP = "label-filt", "label", "_2d-label-filt.zip"
COLOUR_INTRINSICS = ("intrinsic/intrinsic_color.txt", "intrinsics_color.txt", "intrinsic_color.txt")
DEPTH_INTRINSICS = ("intrinsic/intrinsic_depth.txt", "intrinsics_depth.txt", "intrinsic_depth.txt")


@dataclass(frozen=True)
class _Dialect:
    """How an exporter names its files: the folder and ending of colours, depths and poses; a number stands before the ending."""

    colour: tuple[str, tuple[str, ...]]
    depth: tuple[str, tuple[str, ...]]
    pose: tuple[str, tuple[str, ...]]


DIALECTS = (
    _Dialect(("color", (".jpg", ".png")), ("depth", (".png",)), ("pose", (".txt",))),
    *(
        _Dialect((place, (".color.jpg", ".color.png")), (place, (".depth.png", ".depth.pgm")), (place, (".pose.txt",)))
        for place in ("sensor_data", "")
    ),
)
"""ScanNet's exporter in Python (and scannet_frames_25k); its exporter in C++, in the folder `sensor_data` or the scan's own."""


def recognises(path: Path) -> bool:
    """Whether a path is a recording, or the folder of a scan."""
    if path.is_file():
        return path.suffix.lower() == ".sens"
    return bool(_recordings(path)) or _dialect(path) is not None


def open_scan(path: Path, as_peers: Collection[str] = ()) -> Scene:
    """The scene of a scan: its recording if it is there, else what was extracted from one.

    Args:
        path: a `.sens` file or a scan's folder.
        as_peers: readings of `APPLICABLE`.

    Raises:
        InputError: the recording, its labels, a pose or the intrinsics cannot be used; a folder has several recordings; or
            fewer than two frames can be used.
    """
    recordings = [path] if path.is_file() else _recordings(path)
    if len(recordings) > 1:
        named = [one for one in recordings if one.stem == path.absolute().name]
        if len(named) != 1:
            raise InputError(
                path, "one .sens file", f"{len(recordings)} of them", advice=f"name one, {recordings[0]} for example"
            )
        recordings = named
    if recordings:
        return _recorded(recordings[0], path, as_peers)
    dialect = _dialect(path)
    if dialect is None:
        raise InputError(path, LOOKED_FOR, "neither")
    return _extracted(path, dialect, as_peers)


@dataclass(frozen=True)
class _Labels:
    """The labels of each frame by its number; or why there are none."""

    maps: Mapping[int, MapSource]
    notes: tuple[str, ...]
    unread: InputError | None = None


def _recorded(path: Path, named: Path, as_peers: Collection[str]) -> Scene:
    """The scene of a recording."""
    recording = read_recording(path)
    count = len(recording)
    if count < 2:
        raise InputError(
            path,
            "at least two complete frames",
            f"{count} of the {recording.declared} that its header speaks of",
            advice="download it again",
        )
    notes = []
    if count < recording.declared:
        notes.append(
            f"{path.name} is cut short: {count} of the {recording.declared} frames that its header speaks of are complete."
        )
    labels = _labels(path.parent, as_peers)
    colour = _lens(path, "intrinsic of colour", recording.colour_intrinsics, recording.colour_size)
    depth = _lens(path, "intrinsic of depth", recording.depth_intrinsics, recording.depth_size)
    return _Scan(
        path=path,
        name=path.stem if named.is_file() else named.absolute().name,
        pictures={number: recording.colour(number) for number in range(count)},
        names={number: f"color/{number}.jpg" for number in range(count)},
        poses=dict(enumerate(recording.poses.astype(np.float64))),
        lens=colour,
        reference=recording.colour_size,
        depths={
            number: DepthMap(held, recording.depth_unit)
            for number in range(count)
            if (held := recording.depth(number)) is not None
        },
        depth_lens=depth,
        labels=labels,
        notes=notes,
    ).scene(as_peers)


def _extracted(folder: Path, dialect: _Dialect, as_peers: Collection[str]) -> Scene:
    """The scene of what an exporter left."""
    pictures = _numbered(folder, *dialect.colour)
    if not pictures:
        raise InputError(folder / dialect.colour[0], "pictures named by numbers (0.jpg, 1.jpg, ...)", "none of them")
    depths = _numbered(folder, *dialect.depth)
    texts = _numbered(folder, *dialect.pose)
    poses = {number: _pose(texts[number]) for number in pictures if number in texts}
    told = _told(folder)
    first = next(iter(pictures.values()))
    size = read_header(first).size
    path, matrix = _intrinsics(folder, COLOUR_INTRINSICS, told, "color")
    if matrix is None:
        raise InputError(
            folder, "the intrinsics of the colour camera in " + ", ".join(COLOUR_INTRINSICS), "none of them"
        )
    lens, reference = _scaled(path, matrix, size, (size, told.size("color") or COLOUR_SIZE, COLOUR_SIZE))
    notes, depth_lens = [], None
    if depths:
        depth_size = _map_size(next(iter(depths.values())))
        path, matrix = _intrinsics(folder, DEPTH_INTRINSICS, told, "depth")
        if matrix is None:
            notes.append("The depth camera has no intrinsics here; its maps are taken to show what the pictures show.")
        else:
            depth_lens, _ = _scaled(
                path, matrix, depth_size, (depth_size, told.size("depth") or DEPTH_SIZE, DEPTH_SIZE)
            )
    return _Scan(
        path=folder,
        name=folder.absolute().name,
        pictures=pictures,
        names={number: picture.relative_to(folder).as_posix() for number, picture in pictures.items()},
        poses=poses,
        lens=lens,
        reference=reference,
        depths={number: DepthMap(held, MILLIMETRE) for number, held in depths.items()},
        depth_lens=depth_lens,
        labels=_labels(folder, as_peers),
        notes=notes,
    ).scene(as_peers)


@dataclass(frozen=True)
class _Scan:
    """A scan whose frames are known by their numbers, wherever they are.

    Attributes:
        path: what to call it by.
        name: of the scene.
        pictures: by number.
        names: of the frames, likewise.
        poses: likewise, perhaps not finite, perhaps not of all.
        lens: of the colour camera.
        reference: the (height, width) that its K is for [px].
        depths: by number, as the depth camera measured them.
        depth_lens: of the depth camera, at the colour camera's place; None if it is the colour camera.
        labels: what is known of them.
        notes: what the user should be told.
    """

    path: Path
    name: str
    pictures: Mapping[int, Stored]
    names: Mapping[int, str]
    poses: Mapping[int, np.ndarray]
    lens: Lens
    reference: tuple[int, int]
    depths: Mapping[int, DepthMap]
    depth_lens: Lens | None
    labels: _Labels
    notes: Sequence[str]

    def scene(self, as_peers: Collection[str]) -> Scene:
        """The scene of its frames; those without a finite pose are left out.

        Raises:
            InputError: a pose is no rigid motion, or fewer than two frames are left.
        """
        posed = [number for number in self.pictures if number in self.poses and np.isfinite(self.poses[number]).all()]
        rigid = checked_poses(
            self.path, [self.poses[number] for number in posed], [f"pose of {self.names[number]}" for number in posed]
        )
        if len(posed) < 2:
            raise InputError(
                self.path,
                "at least two frames with a picture and a finite pose",
                f"{len(posed)} of {len(self.pictures)}",
            )
        frames = tuple(
            Frame(
                name=self.names[number],
                picture=self.pictures[number],
                lens=_seen_by_peers(self.lens, self.reference) if ROWS_972 in as_peers else self.lens,
                world_from_camera=pose,
                depth=self._depth(number),
                labels=self.labels.maps.get(number),
            )
            for number, pose in zip(posed, rigid, strict=True)
        )
        labelled = any(frame.labels is not None for frame in frames)
        return Scene(
            path=self.path,
            name=self.name,
            layout=LAYOUT,
            unit="metric",
            frames=frames,
            classes=SCANNET20 if labelled else None,
            unread_labels=self.labels.unread,
            notes=(
                *self.notes,
                *_missing(self.pictures, self.names, posed, "a finite pose (tracking was lost) and are left out"),
                *(_missing(posed, self.names, self.depths, "depth") if self.depths else ["There is no depth."]),
                *(_missing(posed, self.names, self.labels.maps, "labels") if self.labels.maps else []),
                *self.labels.notes,
                *(f"Read as peers do: {READINGS[one]}." for one in APPLICABLE if one in as_peers),
            ),
        )

    def _depth(self, number: int) -> MapSource | None:
        """Where the depth of a frame comes from."""
        held = self.depths.get(number)
        return held if held is None or self.depth_lens is None else DepthThroughLens(held, self.depth_lens, self.lens)


def _missing(wanted: Iterable[int], names: Mapping[int, str], there: Collection[int], what: str) -> list[str]:
    """A sentence on the frames that lack something, none where all have it."""
    held = set(there)
    numbers = list(wanted)
    lacking = [number for number in numbers if number not in held]
    if not lacking:
        return []
    return [f"{len(lacking)} of {len(numbers)} frames are without {what}, the first is {names[lacking[0]]}."]


def _labels(folder: Path, as_peers: Collection[str]) -> _Labels:
    """The label maps of a scan, in the zip file as it was downloaded or extracted, with what their ids mean.

    Raises:
        InputError: the zip file or a map cannot be used.
    """
    as_gsnerf = GSNERF_LABELS in as_peers
    maps, where = _label_maps(folder)
    if not maps:
        return _Labels({}, (f"There are no labels ({FILTERED}/ or SCAN{ZIP}): colour and depth alone are read.",))
    first = maps[min(maps)]
    if read_ids(first).dtype == np.uint8:
        if where == FILTERED:
            raise InputError(
                first,
                "16-bit ids, as ScanNet has them",
                "8 bits",
                advice=f"where they are NYU40's, call the folder {UNFILTERED}",
            )
        # scannet_frames_25k
        labels = labels_of_ids({number: number for number in range(len(NAMES) + 1)}, as_gsnerf)
        return _Labels(_meant(maps, labels), ("The 8-bit labels are NYU40's, as in scannet_frames_25k.",))
    table = find_table(folder)
    if table is None:
        sentence = f"{FILE_NAME} is neither with the scan nor above it, so its labels have no meaning and are not read."
        return _Labels({}, (sentence,))
    try:
        return _Labels(_meant(maps, read_table(table).labels(as_gsnerf)), ())
    except InputError as error:
        return _Labels({}, (), error)


def _meant(maps: Mapping[int, Stored], labels: np.ndarray) -> dict[int, MapSource]:
    """Label maps by number, given the label of each id."""
    return {number: IdMap(path, labels) for number, path in maps.items()}


def _label_maps(folder: Path) -> tuple[dict[int, Stored], str]:
    """The label maps by number, and where they are: extracted ones before those in a zip file."""
    for place in (
        FILTERED,
        *sorted(one.name + f"/{FILTERED}" for one in folder.glob("*_2d-label-filt") if one.is_dir()),
    ):
        found = _numbered(folder, place, (".png",))
        if found:
            return dict(found), FILTERED
    archives = sorted(folder.glob("*" + ZIP))
    if archives:
        inside = {
            int(Path(name).stem): member
            for name, member in members(archives[0]).items()
            if name.lower().endswith(".png") and Path(name).stem.isdecimal()
        }
        return dict(sorted(inside.items())), FILTERED
    return dict(_numbered(folder, UNFILTERED, (".png",))), UNFILTERED


def _recordings(folder: Path) -> list[Path]:
    """The recordings in a folder."""
    return sorted(one for one in folder.glob("*.sens") if one.is_file()) if folder.is_dir() else []


def _dialect(folder: Path) -> _Dialect | None:
    """How the frames of a folder are named, None where they are in no known way or nothing tells of the cameras."""
    for dialect in DIALECTS:
        place = dialect.pose[0]
        if place == "pose":
            known = (folder / "color").is_dir() and (folder / place).is_dir()
        else:
            # Other data sets name their frames like this too; ScanNet's come with intrinsics, and with PGMs or labels.
            known = any((folder / place).glob("frame-*.pose.txt")) and _has_intrinsics(folder)
            known = known and (bool(place) or any(folder.glob("frame-*.depth.pgm")) or _has_labels(folder))
        if known:
            return dialect
    return None


def _has_intrinsics(folder: Path) -> bool:
    """Whether a folder holds a file with the colour camera's intrinsics."""
    return any((folder / name).is_file() for name in (*COLOUR_INTRINSICS, *_tellers(folder)))


def _has_labels(folder: Path) -> bool:
    """Whether label maps lie in a folder, extracted or not."""
    return (folder / FILTERED).is_dir() or any(folder.glob("*_2d-label-filt*"))


def _numbered(folder: Path, place: str, endings: Sequence[str]) -> dict[int, Path]:
    """The files of a folder that are named by numbers, with or without zeros or `frame-` before them, by number and in their order.

    Raises:
        InputError: two have the same number.
    """
    found: dict[int, Path] = {}
    pattern = re.compile(r"(?:frame-)?(\d+)(?:" + "|".join(re.escape(ending) for ending in endings) + ")", re.I)
    if not (folder / place).is_dir():
        return found
    for path in sorted((folder / place).iterdir()):
        matched = pattern.fullmatch(path.name)
        if matched:
            number = int(matched[1])
            if number in found:
                raise InputError(folder / place, "one file of each number", f"{found[number].name} and {path.name}")
            found[number] = path
    return dict(sorted(found.items()))


def _pose(path: Path) -> np.ndarray:
    """The pose of a text file, [4 4], perhaps not finite.

    Raises:
        InputError: it is not 12 or 16 numbers.
    """
    numbers = read_numbers(path)
    if len(numbers) not in (12, 16):
        raise InputError(path, "a camera-to-world matrix of 16 numbers", f"{len(numbers)}")
    pose = np.eye(4)
    pose[: len(numbers) // 4] = numbers.reshape(-1, 4)
    return pose


def _tellers(folder: Path) -> tuple[str, ...]:
    """Names of the files that may tell of the cameras in words: the C++ exporter's and the scan's own."""
    return ("_info.txt", "sensor_data/_info.txt", f"{folder.absolute().name}.txt")


@dataclass(frozen=True)
class _Told:
    """What `_info.txt` or `SCAN.txt` says, by key, and which it is."""

    path: Path
    values: Mapping[str, str]

    def size(self, camera: str) -> tuple[int, int] | None:
        """(height, width) of a camera's pictures."""
        for before in (camera, f"m_{camera}"):
            sides = [self.values.get(f"{before}{side}", "") for side in ("Height", "Width")]
            if all(side.isdecimal() and int(side) for side in sides):
                return int(sides[0]), int(sides[1])
        return None

    def matrix(self, camera: str) -> np.ndarray | None:
        """K of a camera.

        Raises:
            InputError: it is no matrix of numbers.
        """
        text = self.values.get("m_calibration" + {"color": "Color", "depth": "Depth"}[camera] + "Intrinsic")
        if text is None:
            names = [f"{name}_{camera}" for name in ("fx", "fy", "mx", "my")]
            if not all(name in self.values for name in names):
                return None
            fx, fy, mx, my = (self.values[name] for name in names)
            text = f"{fx} 0 {mx} 0 {fy} {my} 0 0 1"
        try:
            return _matrix(np.array(text.split(), np.float64))
        except ValueError as error:
            raise InputError(self.path, "a matrix of numbers", text[:40], key=f"intrinsics of {camera}") from error


def _told(folder: Path) -> _Told:
    """What is told of a scan beside its frames."""
    for name in _tellers(folder):
        if (folder / name).is_file():
            return _Told(folder / name, read_fields(folder / name))
    return _Told(folder, {})


def _intrinsics(folder: Path, places: Sequence[str], told: _Told, camera: str) -> tuple[Path, np.ndarray | None]:
    """K [3 3] of a camera, pixel centres at whole numbers, and the file that it is from; None where no file has it.

    Raises:
        InputError: the file holds no matrix.
    """
    for place in places:
        path = folder / place
        if path.is_file():
            try:
                return path, _matrix(read_numbers(path))
            except ValueError as error:
                raise InputError(path, "a 3x3 or 4x4 matrix K", f"{error}") from error
    return told.path, told.matrix(camera)


def _matrix(numbers: np.ndarray) -> np.ndarray:
    """K [3 3] from 9, 12 or 16 numbers, row by row.

    Raises:
        ValueError: they are not as many.
    """
    columns = {9: 3, 12: 4, 16: 4}.get(len(numbers))
    if columns is None:
        raise ValueError(f"{len(numbers)} numbers")
    return np.ascontiguousarray(numbers.reshape(-1, columns)[:3, :3])


def _scaled(
    path: Path, matrix: np.ndarray, size: tuple[int, int], candidates: Iterable[tuple[int, int]]
) -> tuple[Lens, tuple[int, int]]:
    """The lens of pictures that may have been resized since their K was found, and the (height, width) that K is for [px].

    Args:
        path: the file with K, for messages.
        matrix: K, pixel centres at whole numbers.
        size: (height, width) of the pictures [px].
        candidates: sizes that K may be for; the first in whose middle its principal point lies is taken.

    Raises:
        InputError: it lies in the middle of none of them, or K is of no camera.
    """
    for height, width in candidates:
        off = abs((matrix[0, 2] + 0.5) / width - 0.5), abs((matrix[1, 2] + 0.5) / height - 0.5)
        if max(off) <= CENTRAL:
            whole = _lens(path, None, matrix, (height, width))
            across, down = size[1] / width, size[0] / height
            focal = whole.focal[0] * across, whole.focal[1] * down
            return Lens(size, focal, (whole.centre[0] * across, whole.centre[1] * down)), (height, width)
    raise InputError(
        path,
        f"intrinsics for pictures of {size[1]}x{size[0]} (width x height) or of ScanNet's own size",
        f"a principal point at ({matrix[0, 2]:g}, {matrix[1, 2]:g})",
    )


def _seen_by_peers(lens: Lens, reference: tuple[int, int]) -> Lens:
    """The lens as peers take it, whose pictures have three rows for four columns; `reference` is the (height, width) that K is for."""
    down = reference[0] / (PEERS_ASPECT * reference[1])
    return Lens(lens.size, (lens.focal[0], lens.focal[1] * down), (lens.centre[0], lens.centre[1] * down))


def _lens(path: Path, key: str | None, matrix: np.ndarray, size: tuple[int, int]) -> Lens:
    """The pinhole of a K whose pixel centres are at whole numbers.

    Raises:
        InputError: it is of no camera.
    """
    focal, centre = (float(matrix[0, 0]), float(matrix[1, 1])), (float(matrix[0, 2]) + 0.5, float(matrix[1, 2]) + 0.5)
    try:
        return Lens(size, focal, centre)
    except ValueError as error:
        raise InputError(path, "a camera that can be", str(error), key=key) from error


def _map_size(path: Path) -> tuple[int, int]:
    """(height, width) of a depth map."""
    if path.suffix.lower() != ".pgm":
        return read_header(path).size
    height, width = read_uint16(path).shape
    return height, width

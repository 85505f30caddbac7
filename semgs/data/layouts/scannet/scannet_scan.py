"""ScanNet: scans as released (`.sens`, `*_2d-label-filt.zip`), and as written by its exporters (`color/ depth/ pose/`).

Poses are camera to world with OpenCV axes, in metres. They are not finite if tracking was lost; such frames are dropped, so frames are
numbered as in other papers' code. Intrinsics are in pixels with the *centre* of the first pixel at (0, 0), as in ScanNet's own tools, so half
a pixel is added. Depth is 16 bits, in millimetres unless a recording says otherwise, from a separate camera with the pose of the colour
camera; it is mapped to the colour camera with both K. Label maps, extracted or in the downloaded zip file, have ids of
`semgs.data.layouts.scannet.scannet_labels`.
http://www.scan-net.org, https://github.com/ScanNet/ScanNet
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import HALF, Lens
from semgs.data.frames import Frame
from semgs.data.layouts.parts.pose_files import checked_poses
from semgs.data.layouts.parts.trajectories import read_pose
from semgs.data.layouts.parts.usable_frames import note_lacking, numbered_files
from semgs.data.layouts.scannet.intrinsics import PLACES, ScanCamera, find_camera, has_intrinsics
from semgs.data.layouts.scannet.scannet_labels import FILE_NAME, NYU40_NAMES, find_table, labels_of_ids, read_table
from semgs.data.layouts.scannet.sens import read_recording
from semgs.data.maps import DepthMap, DepthThroughLens, IdMap, InstanceMap, MapSource
from semgs.data.paper_variants import GSNERF_LABELS, LSM8_LABELS, READINGS, ROWS_972
from semgs.data.scene import Scene
from semgs.data.tables.classes import LSM8, SCANNET20
from semgs.files.archives import members
from semgs.files.errors import InputError, input_error
from semgs.files.images.pictures import read_header, read_numbers, read_uint16
from semgs.files.paths import not_hidden
from semgs.files.stored import Stored

LAYOUT = "ScanNet"
LOOKED_FOR = "a ScanNet scan (SCAN.sens, or color/ and pose/)"
APPLICABLE = (ROWS_972, GSNERF_LABELS, LSM8_LABELS)

FILTERED, UNFILTERED, UNZIPPED = "label-filt", "label", "*_2d-label-filt"
THINGS, UNZIPPED_THINGS = "instance-filt", "*_2d-instance-filt"


@dataclass(frozen=True)
class ScanLabels:
    """The label maps by frame number, or why there are none."""

    maps: Mapping[int, MapSource]
    notes: tuple[str, ...] = ()
    unread: InputError | None = None
    instances: Mapping[int, Stored] = field(default_factory=dict)


@dataclass(frozen=True)
class _Dialect:
    """How an exporter names its files: folder and ending of colours, depths and poses, with a number before the ending."""

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


def open_scannet(path: Path, as_peers: Collection[str] = ()) -> Scene:
    """The scene of a scan: from its recording, or else from exported files.

    Args:
        path: a `.sens` file or a scan's folder.
        as_peers: readings of `APPLICABLE`.

    Raises:
        InputError: the recording, its labels, a pose or the intrinsics cannot be used, a folder has several recordings, or
            fewer than two frames are usable.
    """
    recordings = [path] if path.is_file() else _recordings(path)
    if len(recordings) > 1:
        named = [one for one in recordings if one.stem == path.absolute().name]
        if len(named) != 1:
            raise InputError(
                path, "one .sens file", f"{len(recordings)}", advice=f"choose one, such as {recordings[0]}"
            )
        recordings = named
    if recordings:
        return _recorded(recordings[0], path, as_peers)
    dialect = _dialect(path)
    if dialect is None:
        raise InputError(path, LOOKED_FOR, "neither")
    return _extracted(path, dialect, as_peers)


def _recorded(path: Path, named: Path, as_peers: Collection[str]) -> Scene:
    """The scene of a recording."""
    recording = read_recording(path)
    count = len(recording)
    if count < 2:
        raise InputError(
            path,
            "at least two complete frames",
            f"{count} of the {recording.declared} in its header",
            advice="download it again",
        )
    notes = []
    if count < recording.declared:
        notes.append(
            f"{path.name} is truncated: {count} of the {recording.declared} frames in its header are complete."
        )
    colour = _lens(path, "intrinsic of colour", recording.colour_intrinsics, recording.colour_size)
    depth = _lens(path, "intrinsic of depth", recording.depth_intrinsics, recording.depth_size)
    return _Scan(
        path=path,
        name=path.stem if named.is_file() else named.absolute().name,
        pictures={number: recording.colour(number) for number in range(count)},
        names={number: f"color/{number}.jpg" for number in range(count)},
        poses=dict(enumerate(recording.poses.astype(np.float64))),
        camera=ScanCamera(colour, recording.colour_size),
        depths={
            number: DepthMap(held, recording.depth_unit)
            for number in range(count)
            if (held := recording.depth(number)) is not None
        },
        depth_lens=depth,
        labels=read_scan_labels(path.parent, as_peers),
        notes=notes,
    ).scene(as_peers)


def _extracted(folder: Path, dialect: _Dialect, as_peers: Collection[str]) -> Scene:
    """The scene from exported files."""
    pictures, depths, texts = (
        _numbered(folder / place, endings) for place, endings in (dialect.colour, dialect.depth, dialect.pose)
    )
    if not pictures:
        raise InputError(folder / dialect.colour[0], "images named by numbers (0.jpg, 1.jpg, ...)", "none")
    poses = {number: read_pose(texts[number]).matrix for number in pictures if number in texts}
    camera = find_camera(folder, "color", read_header(next(iter(pictures.values()))).size)
    if camera is None:
        places = ", ".join(place.format("color") for place in PLACES)
        raise InputError(folder, f"the intrinsics of the colour camera in {places}", "none")
    notes, depth_camera = [], None
    if depths:
        depth_camera = find_camera(folder, "depth", _map_size(next(iter(depths.values()))))
        if depth_camera is None:
            notes.append("The depth camera has no intrinsics here; its maps are assumed to match the images.")
    return _Scan(
        path=folder,
        name=folder.absolute().name,
        pictures=pictures,
        names={number: picture.relative_to(folder).as_posix() for number, picture in pictures.items()},
        poses=poses,
        camera=camera,
        depths={number: DepthMap(held) for number, held in depths.items()},
        depth_lens=depth_camera.lens if depth_camera else None,
        labels=read_scan_labels(folder, as_peers),
        notes=notes,
    ).scene(as_peers)


@dataclass(frozen=True)
class _Scan:
    """A scan with its parts by frame number.

    Attributes:
        path: of the recording or folder.
        name: of the scene.
        pictures: by number.
        names: of the frames, by number.
        poses: by number; some may be missing or not finite.
        camera: of the images.
        depths: by number, as the depth camera measured them.
        depth_lens: of the depth camera, which has the pose of the colour camera; None if maps match the images.
        labels: of the frames.
        notes: what the user should know.
    """

    path: Path
    name: str
    pictures: Mapping[int, Stored]
    names: Mapping[int, str]
    poses: Mapping[int, np.ndarray]
    camera: ScanCamera
    depths: Mapping[int, DepthMap]
    depth_lens: Lens | None
    labels: ScanLabels
    notes: Sequence[str]

    def scene(self, as_peers: Collection[str]) -> Scene:
        """The scene, without frames that have no finite pose.

        Raises:
            InputError: a pose is not a rigid motion, or fewer than two frames are left.
        """
        posed = [number for number in self.pictures if number in self.poses and np.isfinite(self.poses[number]).all()]
        rigid = checked_poses(
            self.path, [self.poses[number] for number in posed], [f"pose of {self.names[number]}" for number in posed]
        )
        if len(posed) < 2:
            raise InputError(
                self.path,
                "at least two frames with an image and a finite pose",
                f"{len(posed)} of {len(self.pictures)}",
            )
        lens = self.camera.as_peers if ROWS_972 in as_peers else self.camera.lens
        frames = tuple(
            Frame(
                name=self.names[number],
                picture=self.pictures[number],
                lens=lens,
                world_from_camera=pose,
                depth=self._depth(number),
                labels=self.labels.maps.get(number),
                instances=InstanceMap(self.labels.instances[number]) if number in self.labels.instances else None,
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
            classes=(LSM8 if LSM8_LABELS in as_peers else SCANNET20) if labelled else None,
            unread_labels=self.labels.unread,
            notes=(
                *self.notes,
                *self._without(self.pictures, posed, "a finite pose (tracking was lost) and are left out"),
                *(self._without(posed, self.depths, "depth") if self.depths else ["There is no depth."]),
                *(self._without(posed, self.labels.maps, "labels") if self.labels.maps else []),
                *self.labels.notes,
                *(f"Read as in other papers' code: {READINGS[one]}." for one in APPLICABLE if one in as_peers),
            ),
        )

    def _depth(self, number: int) -> MapSource | None:
        """The source of a frame's depth."""
        held = self.depths.get(number)
        if held is None or self.depth_lens is None:
            return held
        return DepthThroughLens(held, self.depth_lens, self.camera.lens)

    def _without(self, numbers: Collection[int], there: Collection[int], what: str) -> list[str]:
        """A note about frames that lack something, empty if there are none."""
        names = [self.names[number] for number in numbers if number not in there]
        return note_lacking(names, len(numbers), f"frames are without {what}")


def _recordings(folder: Path) -> list[Path]:
    """The recordings in a folder."""
    return not_hidden(one for one in folder.glob("*.sens") if one.is_file()) if folder.is_dir() else []


def _dialect(folder: Path) -> _Dialect | None:
    """How the frames of a folder are named, None if unknown, or if there are no cameras."""
    for dialect in DIALECTS:
        place = dialect.pose[0]
        if place == "pose":
            known = (folder / "color").is_dir() and (folder / place).is_dir()
        else:
            # Other data sets use these names too; ScanNet's come with intrinsics, and with PGMs or labels.
            known = any((folder / place).glob("frame-*.pose.txt")) and has_intrinsics(folder)
            known = known and (bool(place) or any(folder.glob("frame-*.depth.pgm")) or has_labels(folder))
        if known:
            return dialect
    return None


def _numbered(folder: Path, endings: Sequence[str]) -> dict[int, Path]:
    """The files of a folder that are named by a number, perhaps after `frame-`, sorted by number."""
    return numbered_files(folder, "", endings) or numbered_files(folder, "frame-", endings)


def has_labels(folder: Path) -> bool:
    """Whether a folder contains label maps, extracted or not."""
    return (folder / FILTERED).is_dir() or bool(not_hidden(folder.glob(f"{UNZIPPED}*")))


def read_scan_labels(folder: Path, as_peers: Collection[str]) -> ScanLabels:
    """The label maps of a scan.

    Raises:
        InputError: the zip file or a map cannot be read.
    """
    maps, where = _label_maps(folder)
    if not maps:
        sentence = f"There are no labels ({FILTERED}/ or SCAN{UNZIPPED[1:]}.zip): only colour and depth are read."
        return ScanLabels({}, (sentence,))
    first = maps[min(maps)]
    if read_numbers(first).dtype == np.uint8:
        if where == FILTERED:
            advice = f"if they are NYU40's, name the folder {UNFILTERED}"
            raise InputError(first, "16-bit ids, as ScanNet has them", "8 bits", advice=advice)
        # scannet_frames_25k
        labels = labels_of_ids({number: number for number in range(len(NYU40_NAMES) + 1)}, as_peers)
        return ScanLabels(_meant(maps, labels), ("The 8-bit labels are NYU40's, as in scannet_frames_25k.",))
    table = find_table(folder)
    if table is None:
        sentence = f"{FILE_NAME} is neither with the scan nor above it, so the labels cannot be read."
        return ScanLabels({}, (sentence,))
    try:
        things = _maps_in(folder, THINGS, UNZIPPED_THINGS)
        return ScanLabels(_meant(maps, read_table(table).labels(as_peers)), instances=things)
    except InputError as error:
        return ScanLabels({}, unread=error)


def _meant(maps: Mapping[int, Stored], labels: np.ndarray) -> dict[int, MapSource]:
    """Label maps by frame number, given the label of each id."""
    return {number: IdMap(path, labels) for number, path in maps.items()}


def _label_maps(folder: Path) -> tuple[dict[int, Stored], str]:
    """The label maps by frame number, and their kind."""
    if found := _maps_in(folder, FILTERED, UNZIPPED):
        return found, FILTERED
    return dict(numbered_files(folder / UNFILTERED, endings=(".png",))), UNFILTERED


def _maps_in(folder: Path, name: str, unzipped: str) -> dict[int, Stored]:
    """The maps of a kind by frame number. Extracted maps are preferred to those in a zip file."""
    for place in (folder, *not_hidden(folder.glob(unzipped))):
        if found := numbered_files(place / name, endings=(".png",)):
            return dict(found)
    inside: dict[int, Stored] = {}
    for archive in not_hidden(folder.glob(f"{unzipped}.zip"))[:1]:
        inside = {
            int(Path(member).stem): held
            for member, held in members(archive).items()
            if member.lower().endswith(".png") and Path(member).stem.isdecimal()
        }
    return dict(sorted(inside.items()))


def _lens(path: Path, key: str, matrix: np.ndarray, size: tuple[int, int]) -> Lens:
    """The pinhole from a K with the centre of the first pixel at (0, 0)."""
    (fx, _, cx), (_, fy, cy), _ = matrix.tolist()
    with input_error(path, "a possible camera", key):
        return Lens(size, (fx, fy), (cx + HALF, cy + HALF))


def _map_size(path: Path) -> tuple[int, int]:
    """(height, width) of a depth map."""
    if path.suffix.lower() != ".pgm":
        return read_header(path).size
    height, width = read_uint16(path).shape
    return height, width

"""RGB-D frames in folders with poses in text files: layouts without a name of their own, in which folders are named for their content.

    images     color/ or rgb/ or image/ or images/; frame*.jpg of results/ (NICE-SLAM's); or 000.jpg beside 000.txt (EmbodiedScan's)
    depth      depth/; depth*.png of results/; or 000.png beside 000.txt; or .npy, .pgm or .tiff of these names. May be missing
    poses      pose/ or poses/ with a file per frame (a matrix, or tx ty tz qx qy qz qw); or a trajectory: traj.txt, trajectory.txt,
               poses.txt, trajectory.log (Redwood), extrinsics/ (SUN3D). All are camera to world with OpenCV axes
    intrinsics intrinsics.txt, camera-intrinsics.txt, cam_params.json and the like, here or in the folder above; or calib/ with a YAML file per
               frame (RTAB-Map). The centre of the first pixel is at (0, 0), so half a pixel is added

RTAB-Map puts the name of its database before all of these (rtabmap_rgb/, rtabmap_camera_poses.txt).

The files of a frame are paired by name, by the numbers in their names, or, if there are equally many, by order. The depth unit comes from the
file of intrinsics, from the data set (millimetres in Redwood, SUN3D and RTAB-Map), or from the user; otherwise depth is left out.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import HALF, Lens
from semgs.data.layouts.parts.calibrations import YAML, Calibration, calibration_from_details, read_calibration
from semgs.data.layouts.parts.readable_depths import fault_of_depth
from semgs.data.layouts.parts.text_numbers import notes_on_names
from semgs.data.layouts.parts.trajectories import FoundPose, Trajectory, associate, read_pose, read_trajectory
from semgs.data.layouts.parts.usable_frames import PICTURES, Shot, ShotList, first_file, note_lacking, sequence_name
from semgs.data.maps import MILLIMETRE, DepthMap
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.files.errors import InputError
from semgs.files.images.pictures import TIFFS, is_float_tiff
from semgs.files.paths import not_hidden
from semgs.files.stored import Stored
from semgs.files.text import natural_order
from semgs.runtime.notes import Kind

LAYOUT = "RGB-D folders"
LOOKED_FOR = "color/ (rgb/, images/) with pose/ or traj.txt (RGB-D frames with poses in text)"
DETAILS = ("intrinsics", "depth_unit")

UNKNOWN_DEPTH_UNIT = Kind(
    "{count} depth maps are left out because their unit is unknown (--depth-unit 0.001 for millimetres).",
    "{count} depth maps are left out because their unit is unknown.",
)

COLOURS = ("color", "colour", "rgb", "image", "images")
DEPTHS = ("depth", "depths")
POSES = ("pose", "poses", "extrinsics")
TRAJECTORIES = (
    "traj.txt",
    "traj_w_c.txt",
    "trajectory.txt",
    "trajectory.log",
    "poses.txt",
    "pose.txt",
    "groundtruth.txt",
)
RESULTS = "results"
OF_FRAMES, OF_THE_CAMERA = "calib", "_camera_poses.txt"
"""RTAB-Map's folder of calibrations, and the end of the name of its poses of the camera; others are those of the robot."""
MAPS = (".png", ".npy", ".pgm", *TIFFS)

CALIBRATIONS = (
    "intrinsics.txt", "intrinsic.txt", "camera-intrinsics.txt", "camera_intrinsics.txt", "K.txt", "calibration.txt", "info.txt",
    "intrinsics.json", "intrinsic.json", "camera-intrinsics.json", "camera_intrinsics.json", "camera-intrinsic.json",
    "camera_intrinsic.json", "camera.json", "cam_params.json",
)  # fmt: skip
"""Files of intrinsics, in the order of the search."""

SCANNET = ("intrinsic/intrinsic_color.txt", "intrinsics_color.txt", "intrinsic_color.txt", "_info.txt", "label-filt")
"""Files that only ScanNet's exporters write; folders with one of them are read as ScanNet's."""

PRIMESENSE = Calibration((525.0, 525.0), (319.5 + HALF, 239.5 + HALF), (480, 640), of_a_sensor=True)
"""The camera of Redwood's recordings, which is not in their files. http://redwood-data.org/indoor/dataset.html"""


@dataclass(frozen=True)
class Files:
    """The files of such a scene.

    Attributes:
        pictures: in the order of the numbers in their names.
        depths: likewise; empty if there are none.
        poses: one file per frame, or one file with all.
        source: "SUN3D", "Redwood", "RTAB-Map", or "" if unknown.
        calibrations: one file per frame, named as its image; empty if there are none.
    """

    pictures: tuple[Path, ...]
    depths: tuple[Path, ...]
    poses: tuple[Path, ...] | Path
    source: str = ""
    calibrations: tuple[Path, ...] = ()


def recognises(path: Path) -> bool:
    """Whether a path is a folder with images and poses in known places."""
    return path.is_dir() and _files(path) is not None and not any((path / name).exists() for name in SCANNET)


def open_rgbd(path: Path, details: SceneDetails) -> Scene:
    """The scene of a folder of RGB-D frames.

    Args:
        path: the folder.
        details: may give intrinsics and the depth unit.

    Raises:
        InputError: the intrinsics are unknown, the files cannot be paired, or fewer than two frames have an image and a pose.
    """
    files = _files(path)
    if files is None:
        raise InputError(path, LOOKED_FOR, "nothing like that")
    calibration_file = first_file((path, *([] if files.calibrations else [path.absolute().parent])), CALIBRATIONS)
    given = calibration_from_details(details)
    lens = given.lens if given else _lens(path, files, calibration_file)
    depths = _paired(path, files.pictures, files.depths, "depth maps") if files.depths else {}
    stated = _depth_unit(calibration_file, given is None) if calibration_file and depths else None
    counts = None if any(map(is_float_tiff, files.depths[:1])) else stated or (MILLIMETRE if files.source else None)
    unit = details.depth_unit or counts
    notes: list[str] = [] if files.depths else [*_unread(path)]
    if depths and unit is None:
        depths = {one: file for one, file in depths.items() if file.suffix.lower() == ".png" and fault_of_depth(file)}
        if len(files.depths) > len(depths):  # the others are left out later, as no unit would help
            notes.append(UNKNOWN_DEPTH_UNIT(count=len(files.depths) - len(depths)))
    rotated = files.source == "SUN3D"
    maps = {picture: DepthMap(file, unit or MILLIMETRE, rotated) for picture, file in depths.items()}
    poses = _poses(path, files)
    if isinstance(files.poses, tuple):
        used = {pose.path for pose in poses.values() if pose is not None}
        lone = [str(one.relative_to(path)) for one in files.poses if one not in used]
        notes += note_lacking(lone, len(files.poses), "poses have no image")
    else:
        notes += notes_on_names(files.poses)
    return ShotList(
        path=path,
        layout=LAYOUT,
        shots=[Shot(one.relative_to(path).as_posix(), one, poses.get(one), maps.get(one)) for one in files.pictures],
        lens=lens,
        name=sequence_name(path),
        unit="metric" if depths and unit else "unknown",
        notes=notes,
    ).scene()


def _files(path: Path) -> Files | None:
    """The files of a scene, None if the folder has another layout."""
    start = _start_of_names(path)
    pictures = next((found for name in COLOURS if (found := _listed(path / f"{start}{name}", PICTURES))), ())
    depths = next((found for name in DEPTHS if (found := _listed(path / f"{start}{name}", MAPS))), ())
    if not pictures and (path / RESULTS).is_dir():
        pictures = _listed(path / RESULTS, PICTURES, "frame")
        depths = _listed(path / RESULTS, MAPS, "depth")
    if not pictures:
        return _side_by_side(path)
    for name in POSES:
        poses = _listed(path / name, (".txt",))
        if len(poses) > 1:
            return Files(pictures, depths, poses)
        if poses:
            return Files(pictures, depths, poses[0], "SUN3D" if name == "extrinsics" else "")
    trajectory = first_file((path,), [f"{start[:-1]}{OF_THE_CAMERA}"] if start else TRAJECTORIES)
    if trajectory is None:
        return None
    calibrations = _listed(path / f"{start}{OF_FRAMES}", YAML)
    source = "Redwood" if trajectory.suffix == ".log" else "RTAB-Map" if calibrations or start else ""
    return Files(pictures, depths, trajectory, source, calibrations)


def _start_of_names(path: Path) -> str:
    """What an export of RTAB-Map begins all names with ("rtabmap_"); empty in other folders."""
    starts = [one.name.removesuffix(OF_THE_CAMERA) + "_" for one in sorted(path.glob(f"*{OF_THE_CAMERA}"))]
    return next((start for start in starts if len(start) > 1 and (path / f"{start}{COLOURS[2]}").is_dir()), "")


def _side_by_side(path: Path) -> Files | None:
    """The files of a folder with 000.jpg, 000.txt and perhaps 000.png for each frame."""
    pictures = _listed(path, (".jpg", ".jpeg"))
    poses = tuple(one.with_suffix(".txt") for one in pictures if one.with_suffix(".txt").is_file())
    if len(poses) < 2:
        return None
    maps = (one.with_suffix(ending) for one in pictures for ending in MAPS)
    return Files(pictures, tuple(one for one in maps if one.is_file()), poses)


def _unread(path: Path) -> list[str]:
    """A note about depth maps in an unsupported format."""
    for folder in (path / name for name in DEPTHS):
        kinds = sorted({one.suffix.lower() for one in not_hidden(folder.iterdir())} - {""}) if folder.is_dir() else []
        if kinds:
            return [
                f"{folder.name}/ has files of other kinds than {', '.join(MAPS)} ({', '.join(kinds)}): depth is left out."
            ]
    return []


def _poses(path: Path, files: Files) -> dict[Path, FoundPose | None]:
    """The pose of each image that has one, from a file per frame or one file for all.

    In one file, poses are matched by id if it has ids and images are named by them, by time if images are named by time, else by order.
    """
    if isinstance(files.poses, tuple):
        texts = _paired(path, files.pictures, files.poses, "poses")
        return {picture: read_pose(text) for picture, text in texts.items()}
    trajectory = read_trajectory(files.poses)
    places = _places(files.pictures, trajectory)
    if places is None and len(trajectory) != len(files.pictures):
        raise InputError(
            files.poses, f"as many poses as images: {len(files.pictures)} in {files.pictures[0].parent}", f"{len(trajectory)} poses",
            advice="there is no other way to match them, unless images are named by times or by ids that the file has, too",
        )  # fmt: skip
    along = range(len(trajectory)) if places is None else map(places.get, range(len(files.pictures)))
    return {picture: trajectory.at(index) for picture, index in zip(files.pictures, along, strict=True)}


def _places(pictures: Sequence[Path], trajectory: Trajectory) -> dict[int, int] | None:
    """For each image the pose of its id or at its time, if images are named so; else None."""
    by_id = {one: index for index, one in enumerate(trajectory.ids or ())}
    found = {index: by_id[number] for index, one in enumerate(pictures) if (number := _number(-1, one)) in by_id}
    if 2 * len(found) > len(pictures) and len(set(found.values())) == len(found):
        return found
    if trajectory.times is None or not all(re.fullmatch(r"\d+\.\d+", one.stem) for one in pictures):
        return None
    return associate(np.array([float(one.stem) for one in pictures]), trajectory.times)


def _paired(path: Path, pictures: Sequence[Path], others: Sequence[Path], what: str) -> dict[Path, Path]:
    """The other file of each image: by name, else by number, else, if there are equally many, by order."""
    keys: tuple[Callable[[Path], Hashable], ...] = (lambda one: one.stem, partial(_number, 0), partial(_number, -1))
    for key in keys:
        mine, theirs = {key(one): one for one in pictures}, {key(one): one for one in others}
        shared = mine.keys() & theirs.keys() - {None}
        unique = len(mine) == len(pictures) and len(theirs) == len(others)
        if unique and 2 * len(shared) >= min(len(pictures), len(others)):
            return {mine[one]: theirs[one] for one in mine if one in shared}
    if len(pictures) == len(others):
        return dict(zip(pictures, others, strict=True))
    raise InputError(
        path, f"{what} that match the images by name, number or order",
        f"{len(pictures)} images ({pictures[0].name}, ...) and {len(others)} {what} ({others[0].name}, ...)",
    )  # fmt: skip


def _lens(path: Path, files: Files, calibration_file: Path | None) -> Callable[[Stored, tuple[int, int]], Lens]:
    """The lens of each image, from a file, from one file for each, or that of the data set."""
    if calibration_file is not None:
        return read_calibration(calibration_file).lens
    if files.source == "Redwood":
        return PRIMESENSE.lens
    if files.calibrations:
        own = _paired(path, files.pictures, files.calibrations, "calibrations")

        def lens_of(picture: Stored, size: tuple[int, int]) -> Lens:
            if picture not in own:
                raise InputError(
                    path, f"a calibration of {picture.name} in {files.calibrations[0].parent.name}", "none"
                )
            return read_calibration(own[picture]).lens(picture, size)

        return lens_of
    raise InputError(
        path, "a file of intrinsics: " + ", ".join(CALIBRATIONS[:5]) + ", cam_params.json or the like", "none",
        advice="or give them: --intrinsics fx fy cx cy",
    )  # fmt: skip


def _depth_unit(calibration_file: Path, needed: bool) -> float | None:
    """Metres per count of depth, if a file of intrinsics says so. If its intrinsics are not needed, as others are given, it may have a form that is not read."""
    try:
        return read_calibration(calibration_file).depth_unit
    except InputError:
        if needed:
            raise
        return None


def _listed(folder: Path, endings: Sequence[str], start: str = "") -> tuple[Path, ...]:
    """The files of a folder with one of the endings, in natural order."""
    if not folder.is_dir():
        return ()
    found = (one for one in folder.iterdir() if one.suffix.lower() in endings and one.name.lower().startswith(start))
    return tuple(
        sorted((one for one in found if not one.name.startswith(".")), key=lambda one: natural_order(one.name))
    )


def _number(which: int, path: Path) -> int | None:
    """The first (0) or last (-1) number in a name, None if there is none."""
    found = re.findall(r"\d+", path.stem)
    return int(found[which]) if found else None

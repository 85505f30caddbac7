"""TUM RGB-D: `rgb.txt`, `depth.txt` and `groundtruth.txt`, with a time on each line. Also ETH3D SLAM, Bonn and others.

Poses are camera to world with OpenCV axes, as time, tx ty tz, qx qy qz qw [s, m]: the scalar of the quaternion comes last, unless a comment names the
columns in another order. Depth is 16-bit PNG, 5000 counts per metre, registered to the colour images. Images, depth maps and poses are associated by time, nearest first, less than
0.02 s apart, like the benchmark's `associate.py`.

Intrinsics have the centre of the first pixel at (0, 0), so half a pixel is added. They come from `calibration.txt` (ETH3D: fx fy cx cy), or
are 525, 525, 319.5, 239.5: the drivers' defaults, as the benchmark recommends. Depth is registered with these, so undistorting the images
would misalign it. https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import HALF
from semgs.data.confined import named_file
from semgs.data.layouts.parts.calibrations import Calibration, calibration_from_details, read_calibration
from semgs.data.layouts.parts.text_numbers import notes_on_names, read_lines, times_per_second
from semgs.data.layouts.parts.trajectories import associate, in_seconds, read_trajectory
from semgs.data.layouts.parts.usable_frames import Shot, ShotList, sequence_name
from semgs.data.maps import DepthMap
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.files.errors import InputError
from semgs.files.images.pictures import is_float_tiff

LAYOUT = "TUM RGB-D"
DETAILS = ("intrinsics", "depth_unit")

RGB, DEPTH, POSES, CALIBRATION = "rgb.txt", "depth.txt", "groundtruth.txt", "calibration.txt"
COUNTS_PER_METRE = 5000
DEFAULT = Calibration((525.0, 525.0), (319.5 + HALF, 239.5 + HALF), (480, 640), of_a_sensor=True)
"""What the benchmark recommends for all of its recordings (640x480)."""


def recognises(path: Path) -> bool:
    """Whether a path is a folder with TUM's lists."""
    return (path / RGB).is_file() and ((path / POSES).is_file() or (path / DEPTH).is_file())


def open_tum(path: Path, details: SceneDetails) -> Scene:
    """The scene of a recording, frames in the order of `rgb.txt`.

    Args:
        path: its folder.
        details: may give intrinsics and the depth unit.

    Raises:
        InputError: a list is damaged, there are no poses, no times match, or the images have another size than the camera.
    """
    if not (path / POSES).is_file():
        raise InputError(
            path / POSES,
            "the poses of the camera",
            "no such file",
            advice="TUM does not publish the poses of some recordings",
        )
    times, names = _listed(path / RGB)
    trajectory = read_trajectory(path / POSES)
    if trajectory.times is None:
        raise InputError(path / POSES, "lines of time, tx ty tz, qx qy qz qw", f"{trajectory.poses.shape[0]} matrices")
    posed = associate(times, trajectory.times)
    if not posed:
        raise InputError(path, "images and poses at the same times", _spans(times, trajectory.times), "times")
    mapped: dict[int, int] = {}
    depths: list[str] = []
    if (path / DEPTH).is_file():
        depth_times, depths = _listed(path / DEPTH)
        mapped = associate(times, depth_times)
    maps = {
        index: DepthMap(file, details.depth_unit or (1.0 if is_float_tiff(file) else 1 / COUNTS_PER_METRE))
        for index, other in mapped.items()
        if (file := named_file(path / DEPTH, path, depths[other])).is_file()
    }
    calibration, why = _calibration(path, details)
    return ShotList(
        path=path,
        layout=LAYOUT,
        shots=[
            Shot(name, named_file(path / RGB, path, name), trajectory.at(posed.get(index)), maps.get(index))
            for index, name in enumerate(names)
        ],
        lens=calibration.lens,
        name=sequence_name(path),
        unit="metric",
        notes=[*why, *notes_on_names(path / POSES)],
    ).scene()


def _calibration(path: Path, details: SceneDetails) -> tuple[Calibration, list[str]]:
    """The intrinsics, and notes about them."""
    given = calibration_from_details(details)
    if given is not None:
        return given, []
    if (path / CALIBRATION).is_file():
        return read_calibration(path / CALIBRATION), []
    return DEFAULT, [
        "Intrinsics are the drivers' defaults, as TUM recommends (525 px, the centre of 640x480), without undistortion."
    ]


def _listed(path: Path) -> tuple[np.ndarray, list[str]]:
    """The times [n] and files in a list."""
    times, names = [], []
    for number, line in read_lines(path):
        time, *rest = re.split(r"[\s,]+", line, maxsplit=1)
        try:
            times.append(float(time))
        except ValueError:
            times.append(np.nan)
        if not rest or not np.isfinite(times[-1]):
            raise InputError(path, "lines of a time and a file", f"{line!r:.60}", f"line {number}")
        names.append(rest[0].strip().strip('"').replace("\\", "/").removeprefix("./"))
    if not names:
        raise InputError(path, "lines of a time and a file", "none")
    return in_seconds(np.array(times), times_per_second(path)), names


def _spans(first: np.ndarray, second: np.ndarray) -> str:
    """The time spans of two streams."""
    return f"images from {first.min():.3f} to {first.max():.3f} s and poses from {np.nanmin(second):.3f} to {np.nanmax(second):.3f} s"

"""TUM RGB-D: `rgb.txt`, `depth.txt` and `groundtruth.txt`, each line with its own time; also ETH3D SLAM, Bonn and whoever writes it.

Poses are camera to world with OpenCV axes, as time, tx ty tz, qx qy qz qw [s, m]: the scalar of the quaternion comes last. Depth is 16-bit
PNG, 5000 counts a metre, registered to the colour pictures. Pictures, depth maps and poses are associated by time, nearest first, less than
0.02 s apart, as the benchmark's `associate.py` does.

Intrinsics have the centre of the first pixel at (0, 0): half a pixel is added. They are those of `calibration.txt` (ETH3D's: fx fy cx cy)
or else 525, 525, 319.5, 239.5, the drivers' defaults that the benchmark recommends: its depth is registered with them, and undoing a
lens's distortion would part the two. https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from semgs.data.asked import Asked
from semgs.data.layouts.parts.association import associated
from semgs.data.layouts.parts.calibrations import Calibration, asked_calibration, read_calibration
from semgs.data.layouts.parts.numbers import lines
from semgs.data.layouts.parts.recordings import Shot, ShotList, sequence_name
from semgs.data.layouts.parts.trajectories import read_trajectory
from semgs.data.lens import HALF
from semgs.data.maps import DepthMap
from semgs.data.scene import Scene
from semgs.files.errors import InputError

LAYOUT = "TUM RGB-D"
LOOKED_FOR = "rgb.txt with groundtruth.txt (TUM RGB-D)"
ASKS = ("intrinsics", "depth_unit")

RGB, DEPTH, POSES, CALIBRATION = "rgb.txt", "depth.txt", "groundtruth.txt", "calibration.txt"
COUNTS_PER_METRE = 5000
DEFAULT = Calibration((525.0, 525.0), (319.5 + HALF, 239.5 + HALF), (480, 640), of_a_sensor=True)
"""What the benchmark recommends for all of its recordings, whose pictures are 640x480."""


def recognises(path: Path) -> bool:
    """Whether a path is a folder with TUM's lists."""
    return (path / RGB).is_file() and ((path / POSES).is_file() or (path / DEPTH).is_file())


def open_tum(path: Path, asked: Asked) -> Scene:
    """The scene of a recording, frames in the order of `rgb.txt`.

    Args:
        path: its folder.
        asked: may give intrinsics and the depth unit.

    Raises:
        InputError: a list is damaged, there are no poses, nothing is at the same time, or the pictures have another size than the camera.
    """
    if not (path / POSES).is_file():
        raise InputError(path / POSES, "the poses of the camera", "no such file", advice="some are kept back by TUM")
    times, names = _listed(path / RGB)
    trajectory = read_trajectory(path / POSES)
    if trajectory.times is None:
        raise InputError(path / POSES, "lines of time, tx ty tz, qx qy qz qw", f"{trajectory.poses.shape[0]} matrices")
    posed = associated(times, trajectory.times)
    if not posed:
        raise InputError(path, "pictures and poses at the same times", _spans(times, trajectory.times), "times")
    mapped: dict[int, int] = {}
    depths: list[str] = []
    if (path / DEPTH).is_file():
        depth_times, depths = _listed(path / DEPTH)
        mapped = associated(times, depth_times)
    unit = asked.depth_unit or 1 / COUNTS_PER_METRE
    maps = {
        index: DepthMap(path / depths[other], unit)
        for index, other in mapped.items()
        if (path / depths[other]).is_file()
    }
    calibration, why = _calibration(path, asked)
    return ShotList(
        path=path,
        layout=LAYOUT,
        shots=[
            Shot(name, path / name, trajectory.at(posed.get(index)), maps.get(index))
            for index, name in enumerate(names)
        ],
        lens=calibration.lens,
        name=sequence_name(path),
        unit="metric",
        notes=why,
    ).scene()


def _calibration(path: Path, asked: Asked) -> tuple[Calibration, list[str]]:
    """The intrinsics, and what to tell of them."""
    given = asked_calibration(asked)
    if given is not None:
        return given, []
    if (path / CALIBRATION).is_file():
        return read_calibration(path / CALIBRATION), []
    return DEFAULT, [
        "Intrinsics are the drivers' defaults, which TUM recommends (525 px, the middle of 640x480), lens distortion not undone."
    ]


def _listed(path: Path) -> tuple[np.ndarray, list[str]]:
    """Times [n] and files of a list.

    Raises:
        InputError: it cannot be read, is empty, or a line is no time and a file.
    """
    times, names = [], []
    for number, line in lines(path):
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
    return np.array(times), names


def _spans(first: np.ndarray, second: np.ndarray) -> str:
    """From when to when two streams are."""
    return f"pictures from {first.min():.3f} to {first.max():.3f} s and poses from {np.nanmin(second):.3f} to {np.nanmax(second):.3f} s"

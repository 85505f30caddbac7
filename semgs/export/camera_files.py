"""Files of cameras to render from: nerfstudio's camera paths, and `transforms.json`.

Poses are camera to world with OpenGL axes (x right, y up, z backward), in the coordinates of the scene's own poses.

- nerfstudio's camera path: `render_height`, `render_width`, and a list `camera_path` of `camera_to_world` (16 numbers, row by row) and `fov`
  (vertical, degrees). `camera_type`, if it is there, is "perspective".
- `transforms.json`: a list `frames` of `transform_matrix`; `w`, `h`, `fl_x` and optionally `fl_y`, `cx`, `cy`, for all frames or in each. Images
  are not needed, and lens distortion is ignored. Panoramas and other cameras that are no pinholes (`camera_model`) are refused.
"""

from __future__ import annotations

from math import degrees, isfinite, pi, radians, tan
from pathlib import Path
from typing import Any

import numpy as np
import torch

from semgs.files.atomic import write_json
from semgs.files.errors import InputError, input_error
from semgs.files.strict_json import read_json
from semgs.geometry.cameras import Cameras

OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])

NO_PINHOLES = (
    "EQUIRECTANGULAR",
    "OMNIDIRECTIONALSTEREO_L",
    "OMNIDIRECTIONALSTEREO_R",
    "VR180_L",
    "VR180_R",
    "ORTHOPHOTO",
)
"""Values of `camera_model` in nerfstudio's `transforms.json` whose images no pinhole has: `fl_x` is no focal length there."""

MOST = 100_000
"""Files with more cameras are refused."""


def read_camera_file(path: Path) -> Cameras:
    """The cameras of a file, [n].

    Raises:
        InputError: it is missing or damaged, contains no camera, its images have several sizes, or its fields of view look like radians.
    """
    content = read_json(path, "a file of cameras")
    if isinstance(content, dict) and isinstance(content.get("camera_path"), list):
        key, entries, read = "camera_path", content["camera_path"], _of_camera_path
    elif isinstance(content, dict) and isinstance(content.get("frames"), list):
        key, entries, read = "frames", content["frames"], _of_frame
    else:
        raise InputError(path, "a list camera_path (nerfstudio's camera path) or frames (transforms.json)", "neither")
    if not 1 <= len(entries) <= MOST:
        raise InputError(path, f"1 to {MOST:,} cameras", f"{len(entries):,}", key=key)
    found = []
    for index, entry in enumerate(entries):
        with input_error(path, "a camera", key=f"{key}[{index}]"):
            if not isinstance(entry, dict):
                raise ValueError(f"{entry!r:.40}, which is no object")
            found.append(read(entry, content))
    if key == "camera_path":
        _check_unit(path, [_number(entry, "fov") for entry in entries])
    sizes = {camera.size for camera in found}
    if len(sizes) > 1:
        shown = ", ".join(f"{height}x{width}" for height, width in sorted(sizes))
        raise InputError(path, "cameras with images of one size", shown, key=key)
    return Cameras(
        torch.stack([camera.world_from_camera for camera in found]),
        torch.stack([camera.intrinsics for camera in found]),
        found[0].size,
    )


def write_camera_file(path: Path, cameras: Cameras) -> None:
    """Write cameras [n] as a `transforms.json` without images, which `read_camera_file` reads.

    Raises:
        OSError: it cannot be written.
    """
    height, width = cameras.size
    frames = [
        {
            "fl_x": float(k[0, 0]), "fl_y": float(k[1, 1]), "cx": float(k[0, 2]), "cy": float(k[1, 2]),
            "transform_matrix": (pose.numpy() @ OPENCV_FROM_OPENGL).tolist(),
        }
        for pose, k in zip(cameras.world_from_camera, cameras.intrinsics, strict=True)
    ]  # fmt: skip
    write_json(path, {"camera_model": "PINHOLE", "w": width, "h": height, "frames": frames})


def _of_camera_path(entry: dict[str, Any], content: dict[str, Any]) -> Cameras:
    """A camera of nerfstudio's camera path."""
    if (kind := content.get("camera_type", "perspective")) != "perspective":
        raise ValueError(f"camera_type is {kind!r}; expected 'perspective'")
    height, width = _count(content, "render_height"), _count(content, "render_width")
    fov = _number(entry, "fov")
    if not 0 < fov < 180:
        raise ValueError(f"fov is {fov:g} degrees; expected more than 0 and less than 180")
    focal_px = height / 2 / tan(radians(fov) / 2)
    return _camera(entry, "camera_to_world", (focal_px, focal_px, width / 2, height / 2), (height, width))


def _check_unit(path: Path, fovs: list[float]) -> None:
    """Check that the fields of view of a camera path are in degrees: so small ones of all cameras are radians."""
    if max(fovs) < pi:
        raise InputError(
            path,
            "fields of view in degrees, as nerfstudio writes them",
            f"a fov of at most {max(fovs):.4g}, which looks like radians",
            key="camera_path",
            advice=f"if they are, multiply each fov by 180 / pi: {max(fovs):.4g} is {degrees(max(fovs)):.1f} degrees",
        )


def _of_frame(entry: dict[str, Any], content: dict[str, Any]) -> Cameras:
    """A camera of `transforms.json`."""
    of = content | entry
    if of.get("camera_model") in NO_PINHOLES:
        raise ValueError(
            f"camera_model is {of['camera_model']!r}; expected that of a pinhole camera, such as 'PINHOLE' or 'OPENCV'"
        )
    height, width = _count(of, "h"), _count(of, "w")
    fx = _number(of, "fl_x")
    numbers = (fx, _number(of, "fl_y", fx), _number(of, "cx", width / 2), _number(of, "cy", height / 2))
    return _camera(of, "transform_matrix", numbers, (height, width))


def _camera(
    entry: dict[str, Any], key: str, pinhole: tuple[float, float, float, float], size: tuple[int, int]
) -> Cameras:
    """A camera with a pose under `key`, and (fx, fy, cx, cy) [px]."""
    try:
        pose = np.asarray(entry.get(key), dtype=np.float64)
    except (TypeError, OverflowError) as error:
        raise ValueError(f"{key} is {entry.get(key)!r:.40}; expected 16 numbers") from error
    if pose.size != 16:
        raise ValueError(f"{key} has {pose.size} numbers; expected 16")
    fx, fy, cx, cy = pinhole
    return Cameras(pose.reshape(4, 4) @ OPENCV_FROM_OPENGL, [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], size)


def _number(of: dict[str, Any], key: str, default: float | None = None) -> float:
    """A finite number under a key."""
    value = of.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise ValueError(f"{key} is {value!r}; expected a number")
    return float(value)


def _count(of: dict[str, Any], key: str) -> int:
    """A positive integer under a key."""
    value = _number(of, key)
    if value != int(value) or not 1 <= value <= 16384:
        raise ValueError(f"{key} is {value:g}; expected 1 to 16384 pixels")
    return int(value)

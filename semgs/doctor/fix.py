"""Writes corrected cameras as a `transforms.json`, which lists the scene's own images and depth maps."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.maps import DepthMap, MapSource, MaskMap
from semgs.data.scene import Scene
from semgs.doctor.rig import FLIP, Rig
from semgs.files.atomic import write_json
from semgs.files.errors import InputError

DISTORTION = ("k1", "k2", "p1", "p2", "k3")


def check_fixable(scene: Scene) -> None:
    """Check that corrected cameras of a scene can be written.

    Raises:
        InputError: its images are inside an archive or a recording, or its lens has no place in a `transforms.json`.
    """
    for frame in scene.frames:
        if not isinstance(frame.picture, Path):
            raise InputError(
                scene.path, "images as files, to write corrected cameras for", "images inside an archive or a recording"
            )
        if not isinstance(frame.lens, Lens):
            raise InputError(scene.path, "pinholes with radial and tangential distortion", type(frame.lens).__name__)


def fixed_transforms(scene: Scene, rig: Rig, folder: Path) -> dict[str, Any]:
    """The content of a `transforms.json` with other cameras.

    Frames without a pose are left out. Labels are not listed. Masks are, and depth maps unless the correction is to ignore them or the file cannot say how they
    are stored (`note_on_depth`).

    Args:
        scene: what `check_fixable` has passed.
        rig: the corrected cameras.
        folder: where the file will be; paths are relative to it.
    """
    frames = []
    for index, frame in enumerate(scene.frames):
        if np.isfinite(rig.poses[index]).all():
            frames.append(_entry(frame, rig, index, folder))
    return {"camera_model": "OPENCV", "metric": scene.unit == "metric", "frames": frames}


def note_on_depth(scene: Scene, rig: Rig) -> str:
    """Which depth maps of a scene a `transforms.json` cannot list, in a sentence; "" if it can list them all, or the correction is to ignore them."""
    if rig.along_ray:
        return "The depth maps are not in the new file: it needs z-depth. Divide each depth by |K^-1 (u, v, 1)| of its pixel, and write the maps again."
    if rig.disparity is not None:
        return "The depth maps are not in the new file: it needs z-depth, and they are inverse depth."
    missing = sum(frame.depth is not None and _listed(frame.depth) is None for frame in scene.frames)
    if not missing:
        return ""
    return (
        f"The depth maps of {missing} of {len(scene)} frames are not in the new file, because a transforms.json cannot say how they are stored: "
        "by another camera than the images, with confidences, in rotated bits or in an archive."
    )


def write_fixed(path: Path, scene: Scene, rig: Rig) -> None:
    """Write corrected cameras of a scene; arguments as for `fixed_transforms`.

    Raises:
        OSError: it cannot be written.
    """
    write_json(path, fixed_transforms(scene, rig, path.absolute().parent))


def _entry(frame: Frame, rig: Rig, index: int, folder: Path) -> dict[str, Any]:
    """One entry of `frames`."""
    lens = frame.lens
    assert isinstance(lens, Lens)
    height, width = lens.size
    (fx, fy), (cx, cy) = rig.focal[index].tolist(), rig.centre[index].tolist()
    entry = {
        "file_path": _relative(Path(str(frame.picture)), folder), "w": width, "h": height,
        "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, **dict(zip(DISTORTION, lens.distortion, strict=True)),
        "transform_matrix": (rig.poses[index] @ FLIP).tolist(),
    }  # fmt: skip
    if isinstance(frame.mask, MaskMap):
        entry["mask_path"] = _relative(Path(str(frame.mask.path)), folder)
    depth = _listed(frame.depth)
    if depth is not None and np.isfinite(rig.depth_unit) and not rig.along_ray and rig.disparity is None:
        entry["depth_file_path"] = _relative(Path(str(depth.path)), folder)
        entry["depth_unit_scale_factor"] = depth.unit * rig.depth_unit
    return entry


def _listed(depth: MapSource | None) -> DepthMap | None:
    """A depth map that a `transforms.json` can list: a file with a number of metres per count, and nothing else to say about it."""
    if not isinstance(depth, DepthMap) or depth.rotated or depth.confidence is not None:
        return None
    return depth if isinstance(depth.path, Path) else None


def _relative(path: Path, folder: Path) -> str:
    """The path of a file from a folder. If the folder is a link, `..` leads out of what it links to; the file may be a link with its own name."""
    return os.path.relpath(path.parent.resolve() / path.name, folder.resolve())

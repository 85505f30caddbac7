"""Estimated cameras as files: a `transforms.json` with sparse points, as nerfstudio has them, or a COLMAP model. Both lie beside `images`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from semgs.files.atomic import write_json, write_text
from semgs.sfm.solving import PosedPhoto, Solution

IMAGES, POINTS, MODEL = "images", "sparse_pc.ply", "sparse/0"

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])


def write_transforms(folder: Path, solution: Solution) -> None:
    """Write `transforms.json` and `sparse_pc.ply`; camera axes are OpenGL's, the world is that of the solution.

    Raises:
        OSError: a file cannot be written.
    """
    write_text(folder / POINTS, _ply(solution.points, solution.colours))
    content = {
        "camera_model": "OPENCV",
        "metric": solution.unit == "metric",
        "ply_file_path": POINTS,
        "frames": [_entry(photo) for photo in solution.photos],
    }
    write_json(folder / "transforms.json", content)


def write_colmap(folder: Path, solution: Solution) -> None:
    """Write `sparse/0` with cameras, images and points in COLMAP's binary format.

    Raises:
        OSError: a file cannot be written.
    """
    (folder / MODEL).mkdir(parents=True)
    solution.model.write_binary(folder / MODEL)


def _entry(photo: PosedPhoto) -> dict[str, Any]:
    """A photo in the list of frames."""
    height, width = photo.lens.size
    return {
        "file_path": f"{IMAGES}/{photo.name}",
        "w": width,
        "h": height,
        "fl_x": photo.lens.focal[0],
        "fl_y": photo.lens.focal[1],
        "cx": photo.lens.centre[0],
        "cy": photo.lens.centre[1],
        "k1": photo.lens.distortion[0],
        "transform_matrix": (photo.world_from_camera @ OPENGL_FROM_OPENCV).tolist(),
    }


def _ply(points: np.ndarray, colours: np.ndarray) -> str:
    """Points with colours as a PLY in text."""
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    head += [f"property float {axis}" for axis in "xyz"] + [
        f"property uchar {name}" for name in ("red", "green", "blue")
    ]
    rows = [
        "{:.9g} {:.9g} {:.9g} {} {} {}".format(*point, *colour)
        for point, colour in zip(points.tolist(), colours.tolist(), strict=True)
    ]
    return "\n".join([*head, "end_header", *rows, ""])

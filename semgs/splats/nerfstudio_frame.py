"""The frame in which nerfstudio trains, undone.

nerfstudio turns, moves and scales the cameras of a capture, and writes how into dataparser_transforms.json beside the settings of the run: `transform` [3 4] and `scale`. A
splat that it exports is in that frame. With R, t the transform and s the scale, it has x' = s (R x + t) for a position x of the original capture. If transforms.json has an
`applied_transform` A and an `applied_scale` a, its poses are at a A x: nerfstudio multiplies both into the transform and the scale.
Source: https://github.com/nerfstudio-project/nerfstudio (data/dataparsers/nerfstudio_dataparser.py; Apache-2.0).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float64
from torch import Tensor

from semgs.files.errors import InputError
from semgs.files.strict_json import read_json
from semgs.geometry.gaussians import Gaussians, move_gaussians

FILE_NAME = "dataparser_transforms.json"
TOLERANCE = 1e-3
"""How far the 3x3 part may be from a rotation."""


@dataclass(frozen=True)
class TrainedFrame:
    """From positions of a scene's poses to those of a splat: x' = scale (R x + t).

    Attributes:
        path: the file that says it.
        transform: [R | t], rigid [4 4].
        scale: a positive number.
    """

    path: Path
    transform: Float64[Tensor, "4 4"]
    scale: float

    def undo(
        self, gaussians: Gaussians, origin: Float64[np.ndarray, " 3"] | tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> Gaussians:
        """A splat in the frame of the scene's poses, relative to an origin there, which may be too far out for float32."""
        inverse = torch.linalg.inv(self.transform)
        inverse[:3, 3] -= torch.tensor(origin, dtype=torch.float64)
        return move_gaussians(inverse, gaussians, scale=1 / self.scale)


def find_trained_frame(
    folders: Sequence[Path], applied_transform: np.ndarray | None = None, applied_scale: float | None = None
) -> TrainedFrame | None:
    """What the first of some folders with dataparser_transforms.json says; None if there is none.

    Args:
        folders: of the splat and of the scene.
        applied_transform: of the scene's transforms.json [3 4]; None if it has none.
        applied_scale: likewise.

    Raises:
        InputError: the file has no transform and scale, or they are not a rotation with a translation and a positive number.
    """
    for folder in folders:
        if (folder / FILE_NAME).is_file():
            return read_trained_frame(folder / FILE_NAME, applied_transform, applied_scale)
    return None


def read_trained_frame(
    path: Path, applied_transform: np.ndarray | None = None, applied_scale: float | None = None
) -> TrainedFrame:
    """What a dataparser_transforms.json says. Arguments and errors as for `find_trained_frame`."""
    content = read_json(path)
    if not isinstance(content, dict):
        raise InputError(path, "an object with transform and scale", "something else")
    saved = _matrix(path, content.get("transform"))
    scale = content.get("scale")
    if not isinstance(scale, int | float) or isinstance(scale, bool) or not 0 < scale < np.inf:
        raise InputError(path, "a positive number", f"{scale!r:.40}", "scale")
    if applied_transform is not None:
        applied = np.eye(4)
        applied[:3] = np.asarray(applied_transform, np.float64)[:3]
        saved = saved @ np.linalg.inv(applied)
    rotation = saved[:3, :3]
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > TOLERANCE or np.linalg.det(rotation) < 0:
        raise InputError(path, "a rotation with a translation", "a 3x3 part that is none", "transform")
    return TrainedFrame(path, torch.from_numpy(saved), float(scale) / (applied_scale or 1.0))


def _matrix(path: Path, value: object) -> Float64[np.ndarray, "4 4"]:
    """A 3x4 matrix of finite numbers with the row 0 0 0 1 below."""
    rows = value[:3] if isinstance(value, list) and len(value) in (3, 4) else []
    numbers = [one for row in rows if isinstance(row, list) and len(row) == 4 for one in row]
    good = len(numbers) == 12 and all(type(one) in (int, float) for one in numbers)
    matrix = np.eye(4)
    matrix[:3] = np.array(numbers, np.float64).reshape(3, 4) if good else np.nan
    if not np.isfinite(matrix).all():
        raise InputError(path, "3 rows of 4 finite numbers", f"{value!r:.40}", "transform")
    return matrix

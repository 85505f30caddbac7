"""The fields of each tool's files, and what they mean.

| tool | poses | intrinsics | depth | confidence | images |
|---|---|---|---|---|---|
| Depth Anything 3 (`mini_npz`, `npz`) | `extrinsics` [n 3 4], world to camera | `intrinsics` | `depth` [n h w] | `conf`, from 1 | `image` [n h w 3], 8 bits |
| VGGT (demo_gradio) | `extrinsic` [n 3 4], world to camera | `intrinsic` | `depth` [n h w 1] | `depth_conf`, from 1 | `images` [n 3 h w], 0 to 1 |
| MapAnything (gradio_app) | `extrinsic` [n 4 4], camera to world | `intrinsic` | `depth` [n h w 1] [m] | `final_mask` | `images` [n h w 3], 0 to 1 |
| MapAnything (`infer`, stacked) | `camera_poses` [n 4 4], camera to world | `intrinsics` | `depth_z` [m] | `mask` | `img_no_norm` |
| DUSt3R's results, as the names of its functions | camera to world | `intrinsics` or `focals` | `depthmaps` | `im_conf`, from 1 | `imgs` |

The fields beside `extrinsic` say which of the two it is. All have OpenCV axes. Depth Anything 3, VGGT and DUSt3R put the principal point at half the width
and height, which is the middle of the image, as their COLMAP exports do. MapAnything fits its intrinsics to the rays of pixels whose first one is at (0, 0), so
half a pixel is added. Confidences that start at 1 are 1 + exp(x).

Depth-Anything-3 (utils/export/npz.py, api.py), vggt (demo_gradio.py), map-anything (scripts/gradio_app.py, utils/inference.py, utils/geometry.py), dust3r
(cloud_opt/base_opt.py: get_im_poses, get_focals, get_depthmaps, get_conf).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from semgs.data.cameras.lens import shift_principal_point
from semgs.data.layouts.predictions.npz_file import NpzFile
from semgs.data.layouts.predictions.predicted import (
    Predicted,
    Preprocessing,
    check_depth,
    check_images,
    check_intrinsics,
    check_like_depth,
    check_poses,
    without_axes,
)
from semgs.data.layouts.predictions.preprocessing import depth_anything, dust3r, map_anything, vggt
from semgs.files.errors import InputError

LEAST_CONFIDENCE = 1.5
"""Depth with a lower confidence counts as unknown, if confidences are 1 + exp(x): 1 is the lowest, and there is no highest."""

HALF = 0.5
NAMES = ("image_paths", "image_names", "names", "filelist")
POSES_OF_DUST3R = ("im_poses", "cams2world", "c2ws", "cam2world", "poses")
DEPTHS_OF_DUST3R = ("depthmaps", "depths", "depth")
FOCALS_OF_DUST3R = ("intrinsics", "focals", "focal")


@dataclass(frozen=True)
class Tool:
    """A tool, and one of the layouts of its files.

    Attributes:
        name: of the tool.
        needs: fields that a file has to have; of those in one tuple, any.
        read: makes the common form of a file.
    """

    name: str
    needs: tuple[tuple[str, ...], ...]
    read: Callable[[NpzFile, str], Predicted]

    def wrote(self, file: NpzFile) -> bool:
        """Whether a file has the fields of this tool."""
        return all(file.first_of(names) for names in self.needs)


def _read_depth_anything(file: NpzFile, tool: str) -> Predicted:
    """A `mini_npz` or `npz` of Depth Anything 3. Neither says whether the model was a metric one, unless `is_metric` was added."""
    metric = "is_metric" in file.names and bool(file.truths("is_metric", shape="whether depth is metric").all())
    unit = "metric" if metric else "unknown"
    return _predicted(
        file, tool, ("extrinsics", "intrinsics", "depth", "conf"), ("image", "images"), depth_anything, unit=unit
    )


def _read_vggt(file: NpzFile, tool: str) -> Predicted:
    """VGGT's `predictions.npz`."""
    return _predicted(file, tool, ("extrinsic", "intrinsic", "depth", "depth_conf"), ("images",), vggt)


def _read_map_anything_app(file: NpzFile, tool: str) -> Predicted:
    """The `predictions.npz` of MapAnything's demo."""
    return _predicted(
        file, tool, ("extrinsic", "intrinsic", "depth", "final_mask"), ("images",), map_anything,
        to_world=True, masked=True, unit="metric", upright=True, shift=HALF,
    )  # fmt: skip


def _read_map_anything(file: NpzFile, tool: str) -> Predicted:
    """What MapAnything's `infer` returns, the photos stacked."""
    return _predicted(
        file, tool, ("camera_poses", "intrinsics", "depth_z", "mask"), ("img_no_norm",), map_anything,
        to_world=True, masked=True, unit="metric", upright=True, shift=HALF,
    )  # fmt: skip


def _read_dust3r(file: NpzFile, tool: str) -> Predicted:
    """DUSt3R's results."""
    fields = [
        file.first_of(names) or ""
        for names in (POSES_OF_DUST3R, FOCALS_OF_DUST3R, DEPTHS_OF_DUST3R, ("im_conf", "confs", "conf"))
    ]
    return _predicted(file, tool, fields, ("imgs", "images", "rgb"), dust3r, to_world=True, upright=True)


TOOLS = (
    Tool("VGGT", (("extrinsic",), ("intrinsic",), ("depth",), ("depth_conf",)), _read_vggt),
    Tool("MapAnything", (("extrinsic",), ("intrinsic",), ("depth",), ("final_mask",)), _read_map_anything_app),
    Tool("MapAnything", (("camera_poses",), ("intrinsics",), ("depth_z",)), _read_map_anything),
    Tool("Depth Anything 3", (("extrinsics",), ("intrinsics",), ("depth",)), _read_depth_anything),
    Tool("DUSt3R", (POSES_OF_DUST3R, FOCALS_OF_DUST3R, DEPTHS_OF_DUST3R), _read_dust3r),
)
"""In the order in which they are tried."""


def tool_of(file: NpzFile) -> Tool | None:
    """The tool that wrote a file, None if its fields belong to none."""
    return next((tool for tool in TOOLS if tool.wrote(file)), None)


def read_predicted(file: NpzFile) -> Predicted:
    """The cameras and depth in a file.

    Raises:
        InputError: its fields belong to no known tool, or one is damaged, or they do not fit one another.
    """
    tool = tool_of(file)
    if tool is None:
        expected = "; or ".join(f"{', '.join(names[0] for names in one.needs)} ({one.name})" for one in TOOLS)
        found = ", ".join(sorted(file.names)) or "no arrays"
        raise InputError(file.path, f"the fields {expected}", found)
    return tool.read(file, tool.name)


def _predicted(
    file: NpzFile,
    tool: str,
    fields: Sequence[str],
    images: Sequence[str],
    preprocessing: Preprocessing,
    *,
    to_world: bool = False,
    masked: bool = False,
    unit: str = "unknown",
    upright: bool = False,
    shift: float = 0.0,
) -> Predicted:
    """The common form of a file.

    Args:
        file: the file.
        tool: the name of its tool.
        fields: the names of those with poses, intrinsics, depth, and with the confidence or the mask, which may be missing.
        images: the fields that may have the images.
        preprocessing: what the tool does with photos.
        to_world: whether poses are camera to world, not world to camera.
        masked: whether `sure` is a mask, not a confidence from 1.
        unit: "metric" or "unknown".
        upright: whether the tool turns photos as their EXIF orientation says.
        shift: what is added to principal points [px].
    """
    poses, intrinsics, depth, sure = fields
    depths = check_depth(file.path, depth, file.numbers(depth, shape="depth maps"))
    matrices = _intrinsics(file, intrinsics, depths)
    because = ""
    if sure in file.names:
        read = file.truths if masked else file.numbers
        values = check_like_depth(file.path, sure, read(sure, shape="a value for each depth"), depths)
        because = "outside of its mask" if masked else f"with a confidence below {LEAST_CONFIDENCE:g}"
        depths = np.where(values if masked else values >= LEAST_CONFIDENCE, depths, np.float32(0))
    unsure = float((depths == 0).mean())
    pictures = file.first_of(images)
    names = file.first_of(NAMES)
    listed = None if names is None else file.texts(names)
    if listed is not None and len(listed) != len(depths):
        raise InputError(file.path, f"{len(depths)} names, as many as depth maps", f"{len(listed)}", names)
    return Predicted(
        path=file.path,
        tool=tool,
        world_from_camera=check_poses(
            file.path, poses, file.numbers(poses, shape="poses"), len(depths), to_world=to_world
        ),
        intrinsics=np.stack([shift_principal_point(matrix, shift) for matrix in matrices]),
        depth=depths,
        unit=unit,
        preprocessing=preprocessing,
        upright=upright,
        poses_key=poses,
        to_world=to_world,
        unsure=unsure,
        unsure_because=because,
        images=None
        if pictures is None or not file.fits(pictures)
        else check_images(file.path, pictures, file.numbers(pictures, shape="images"), depths),
        names=listed,
    )


def _intrinsics(file: NpzFile, key: str, depth: np.ndarray) -> np.ndarray:
    """Intrinsics [n 3 3], from matrices, or from focal lengths with the principal point in the middle or in `principal_points`."""
    values = file.numbers(key, shape="intrinsics")
    count, (height, width) = len(depth), depth.shape[1:]
    if key not in ("focals", "focal") or values.shape == (count, 3, 3):
        return check_intrinsics(file.path, key, values, depth)
    focals = without_axes(values, 1) if values.size == count else values
    if focals is None or focals.shape not in ((count,), (count, 2)):
        raise InputError(
            file.path, f"{count} focal lengths, as many as depth maps", f"an array of shape {values.shape}", key
        )
    middles = np.tile([width / 2, height / 2], (count, 1))
    place = file.first_of(("principal_points", "pp"))
    if place is not None:
        middles = file.numbers(place, shape="principal points").astype(np.float64)
        if middles.shape != (count, 2):
            raise InputError(file.path, f"{count} principal points", f"an array of shape {middles.shape}", place)
    matrices = np.tile(np.eye(3), (count, 1, 1))
    matrices[:, [0, 1], [0, 1]] = focals if focals.ndim == 2 else focals[:, None]
    matrices[:, :2, 2] = middles
    return check_intrinsics(file.path, key, matrices, depth)

"""COLMAP models of a scene: its input views and points, for programs that train 3D Gaussians.

    sparse/0/cameras.bin, images.bin, points3D.bin
    images/000_NAME.png, ...

The files are binary, which every trainer reads, and a third of the size of text. Poses are world to camera, and the centre of the first pixel is at (0.5, 0.5), as
COLMAP has them (https://colmap.github.io/format.html).

A point is the middle of a Gaussian that two or more input views see: a view sees it if its own depth, at the pixel that the point projects to, is the same to 5 %. The
track has that place, to fractions of a pixel, in each of these views.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
import torch
from jaxtyping import Bool, Float64
from torch import Tensor

from semgs.export.points import Points
from semgs.files.atomic import write_bytes
from semgs.files.contents import read_bytes
from semgs.files.images.pictures import read_header
from semgs.files.strict_json import read_json
from semgs.geometry.cameras import project
from semgs.geometry.rotations import quaternion_from_matrix
from semgs.scene.scene_file import SavedScene

SAME = 0.05
"""A view sees a point if its own depth there differs by at most this share."""

PINHOLE = 1
"""Number of the camera model with fx, fy, cx, cy."""


@dataclass(frozen=True)
class Tracks:
    """Where the input views see the Gaussians of a scene.

    Attributes:
        pixels: the place of each Gaussian in each view [px].
        seen: whether the view sees it.
    """

    pixels: Float64[Tensor, "v g 2"]
    seen: Bool[Tensor, "v g"]

    @property
    def matched(self) -> Bool[Tensor, " g"]:
        """The Gaussians that two or more views see."""
        return self.seen.sum(0) >= 2

    def only(self, keep: Bool[Tensor, " g"]) -> Tracks:
        """Those of some Gaussians."""
        return Tracks(self.pixels[:, keep], self.seen[:, keep])


def tracks_of(scene: SavedScene) -> Tracks:
    """Where the input views see a scene's Gaussians."""
    views, (height, width) = len(scene.frames), scene.cameras.size
    means = scene.gaussians.means.double().expand(views, -1, 3)
    pixels, depths = project(means, scene.cameras).split([2, 1], -1)
    depths = depths[..., 0]
    inside = (depths > 0) & ((pixels >= 0) & (pixels < torch.tensor([width, height]))).all(-1)
    column, row = torch.where(inside[..., None], pixels, 0).long().unbind(-1)
    own = scene.depths[torch.arange(views)[:, None], row, column]
    return Tracks(pixels, inside & ((depths - own).abs() <= SAME * own))


def image_names(frames: Sequence[str]) -> list[str]:
    """A file name for each input view: its number and the name of its frame."""
    return [f"{view:03d}_{PurePosixPath(frame).stem}.png" for view, frame in enumerate(frames)]


def save_model(folder: Path, scene: SavedScene, points: Points, tracks: Tracks) -> None:
    """Write cameras.bin, images.bin and points3D.bin.

    Args:
        folder: an existing one.
        scene: its cameras are written.
        points: to write.
        tracks: of these points, each seen by two views or more.

    Raises:
        OSError: a file cannot be written.
    """
    views, (height, width) = len(scene.frames), scene.cameras.size
    cameras, images = [struct.pack("<Q", views)], [struct.pack("<Q", views)]
    poses = scene.cameras.camera_from_world
    quaternions = quaternion_from_matrix(poses[:, :3, :3])
    for view, (name, k) in enumerate(zip(image_names(scene.frames), scene.cameras.intrinsics.tolist(), strict=True)):
        lens = (k[0][0], k[1][1], k[0][2], k[1][2])
        cameras.append(struct.pack("<IiQQ4d", view + 1, PINHOLE, width, height, *lens))
        pose = (*quaternions[view].tolist(), *poses[view, :3, 3].tolist())
        images.append(struct.pack("<I7dI", view + 1, *pose, view + 1) + os.fsencode(name) + b"\0")
        seen = tracks.seen[view].nonzero()[:, 0]
        sightings = np.empty(len(seen), [("x", "<f8"), ("y", "<f8"), ("point", "<i8")])
        sightings["x"], sightings["y"] = tracks.pixels[view, seen].numpy().T
        sightings["point"] = (seen + 1).numpy()
        images.append(struct.pack("<Q", len(seen)) + sightings.tobytes())
    write_bytes(folder / "cameras.bin", b"".join(cameras))
    write_bytes(folder / "images.bin", b"".join(images))
    write_bytes(folder / "points3D.bin", _points(points, tracks))


def _points(points: Points, tracks: Tracks) -> bytes:
    """The content of points3D.bin. The position of a sighting is its number among those of its image."""
    places = tracks.seen.cumsum(1) - 1
    means, colours = points.means.double().tolist(), points.colours.tolist()
    parts = [struct.pack("<Q", len(points))]
    for index, (mean, colour, seen) in enumerate(zip(means, colours, tracks.seen.T, strict=True)):
        views = seen.nonzero()[:, 0].tolist()
        track = [number for view in views for number in (view + 1, int(places[view, index]))]
        parts.append(struct.pack(f"<Q3d3BdQ{len(track)}I", index + 1, *mean, *colour, 0.0, len(views), *track))
    return b"".join(parts)


def photos_of(folder: Path, scene: SavedScene) -> list[Path] | None:
    """The photos of the input views, at the size of the scene; None if one is missing. Arguments and errors as for `photo_paths`."""
    found = photo_paths(folder, scene)
    complete = all(path.is_file() and read_header(path).size == scene.cameras.size for path in found)
    return found if found and complete else None


def photo_paths(folder: Path, scene: SavedScene) -> list[Path]:
    """Where `semgs reconstruct` writes the photos of the input views; empty if the folder has no report about these views.

    Args:
        folder: the output folder.
        scene: the scene in it.

    Raises:
        InputError: the report in the folder is damaged.
    """
    report = folder / "report.json"
    if not report.is_file():
        return []
    content = read_json(report)
    views = content.get("views") if isinstance(content, dict) else None
    listed = [view for view in views or () if isinstance(view, dict) and view.get("role") == "context"]
    if [view.get("name") for view in listed] != list(scene.frames):
        return []
    return [folder / "renders" / f"context_{view.get('position')!s:0>3}_input.png" for view in listed]


def copy_input_photos(folder: Path, scene: SavedScene, photos: Sequence[Path]) -> None:
    """Copy the photos of the input views, under the names that the model has.

    Raises:
        InputError: a photo cannot be read.
        OSError: a file cannot be written.
    """
    for name, photo in zip(image_names(scene.frames), photos, strict=True):
        write_bytes(folder / name, read_bytes(photo))

"""Opens a splat of another program as a scene: with the cameras of its photos, or with cameras that are chosen from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import cos, radians, sqrt
from pathlib import Path
from statistics import median

import torch
from jaxtyping import Float64
from torch import Tensor

from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.spread import spread
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.files.paths import typed_path
from semgs.geometry.gaussians import Gaussians
from semgs.objectives.metrics import psnr_seen
from semgs.rendering.rendering import SEEN_ALPHA, Rendering
from semgs.scene.opened import OpenedScene
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import Up, UpDirection, axis_direction, up_near
from semgs.splats.load import load_splat
from semgs.splats.nerfstudio_frame import FILE_NAME, find_trained_frame
from semgs.splats.splat import Splat
from semgs.splats.splat_cameras import SIZE, cameras_around
from semgs.splats.splat_scene import note_on_look, render_plain, splat_scene

MOST_VIEWS = 8
"""Cameras of a scene that are used, evenly chosen."""

TILTED = 3.0
"""If up is further than this from what is usual, the cameras are put about it again [degrees]."""

NEAR_FAR = (0.1, 100.0)
"""Placeholder for the bounds of views that are read for their cameras; those of the scene come from the splat's depth."""


def open_splat(
    path: str | Path, cameras: str | Path | None = None, up: Up = "auto", activated: bool | None = None
) -> OpenedScene:
    """Open a splat of another program.

    Args:
        path: as for `load_splat`.
        cameras: a scene of any layout that `open_scene` reads, in the coordinates of the splat, or in those that nerfstudio's
            dataparser_transforms.json leads to. None puts cameras around the splat, or inside if it is a room.
        up: the direction that is up in its coordinates. Without cameras, "auto" finds it near to what is usual in the format; that is uncertain.
        activated: as for `load_splat`.

    Raises:
        InputError: it cannot be used, or the cameras do not see it.
        ImportError: it is SPZ of version 4, and zstandard is not installed.
    """
    file = typed_path(path)
    splat = load_splat(file, activated)
    if cameras is None:
        opened = _without_cameras(file, splat, up)
    else:
        opened = _with_cameras(file, splat, typed_path(cameras), up)
    return replace(opened, note=" ".join((*splat.notes, opened.note)).strip())


def _without_cameras(file: Path, splat: Splat, up: Up) -> OpenedScene:
    """A splat with cameras that are chosen from it: first about the direction that is usually up, then about the one that fits what they see."""
    direction = axis_direction(splat.up if up == "auto" else up)
    scene, pivot = _surrounded(file, splat, direction)
    if up != "auto":
        return OpenedScene(scene, UpDirection(direction, "as given"), pivot, splat=True)
    found = up_near(scene, direction, f"no field of {splat.format} says it, {splat.up.upper()} is usual")
    if float(found.direction @ direction) < cos(radians(TILTED)):
        scene, pivot = _surrounded(file, splat, found.direction)
    return OpenedScene(scene, found, pivot, splat=True)


def _surrounded(file: Path, splat: Splat, up: Float64[Tensor, " 3"]) -> tuple[SavedScene, Float64[Tensor, " 3"]]:
    """The scene with cameras on a circle about a direction, and its middle."""
    around = cameras_around(splat.gaussians, up)
    try:
        scene = splat_scene(splat.gaussians, around.cameras, source=file.stem, model=splat.format)
    except ValueError as error:
        raise InputError(
            file, "a splat that cameras around it can see", str(error), advice="give cameras with --cameras"
        ) from error
    return scene, around.pivot


def _with_cameras(file: Path, splat: Splat, path: Path, up: Up) -> OpenedScene:
    """A splat with cameras of a scene, in the coordinates of that scene."""
    scene = open_scene(path, needs_labels=False)
    gaussians = in_frame_of(file, splat.gaussians, scene)
    chosen = spread(range(len(scene)), MOST_VIEWS)
    views = scene.read(chosen, _size(scene), NEAR_FAR)
    x, y, z = map(float, scene.origin)
    rendered = render_plain(gaussians, views.cameras)
    try:
        saved = splat_scene(
            gaussians,
            views.cameras,
            rendered=rendered,
            frames=[scene.frames[index].name for index in chosen],
            source=file.stem,
            model=splat.format,
            unit="metric" if scene.unit == "metric" else "unknown",
            origin=(x, y, z),
        )
    except ValueError as error:
        raise InputError(
            file,
            f"a splat in the coordinates of {path}",
            str(error),
            advice=f"if nerfstudio trained it, put its {FILE_NAME} into the folder of the splat",
        ) from error
    photos = (255 * views.images).round().to(torch.uint8).movedim(1, -1).numpy()
    return OpenedScene(saved, up, photos=tuple(photos), splat=True, note=note_on_look(_likeness(rendered, views)))


def _likeness(rendered: Sequence[Rendering], views: Views) -> float:
    """The median over views of the PSNR of a splat against its photos, where it shows something: it may be only a part of what they show [dB]."""
    found = []
    for index, view in enumerate(rendered):
        shown = view.alphas[0] >= SEEN_ALPHA
        if views.hidden is not None:
            shown = shown & ~views.hidden[index]
        found.append(psnr_seen(view.images[0], views.images[index], shown))
    known = [float(one) for one in found if one is not None]
    return median(known) if known else 0.0


def in_frame_of(file: Path, gaussians: Gaussians, scene: Scene) -> Gaussians:
    """A splat in the coordinates of a scene, relative to its origin."""
    folders = [file.parent, scene.path if scene.path.is_dir() else scene.path.parent]
    trained = find_trained_frame(folders, scene.applied_transform, scene.applied_scale)
    if trained is not None:
        return trained.undo(gaussians, scene.origin)
    if scene.origin.any():
        means = (gaussians.means.double() - torch.from_numpy(scene.origin)).float()
        gaussians = replace(gaussians, means=means)
    return gaussians


def _size(scene: Scene) -> tuple[int, int]:
    """The size of the views: that of the first frame, at most as many pixels as `SIZE`."""
    height, width = scene.frames[0].lens.size
    scale = min(1.0, sqrt(SIZE[0] * SIZE[1] / (height * width)))
    return max(1, round(scale * height)), max(1, round(scale * width))

"""Opens a splat of another program as a scene: with the cameras of its photos, or with cameras that are chosen from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import acos, cos, degrees, radians, sqrt
from pathlib import Path
from statistics import median

import numpy as np
import torch
from jaxtyping import Float64
from torch import Tensor

from semgs.data.resampling import default_size
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.spread import spread
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.files.paths import typed_path
from semgs.files.strict_json import read_json
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Gaussians, move_gaussians
from semgs.objectives.metrics import psnr_seen
from semgs.rendering.rendering import SEEN_ALPHA, Rendering
from semgs.scene.opened import OpenedScene
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import Up, UpDirection, axis_direction, up_near
from semgs.splats.fit_by_features import find_similarity, move_by, scale_of
from semgs.splats.load import load_splat
from semgs.splats.nerfstudio_frame import FILE_NAME, find_trained_frame
from semgs.splats.splat import Splat
from semgs.splats.splat_cameras import SIZE, cameras_around
from semgs.splats.splat_scene import (
    FEW_LIKE_OWN,
    likeness_to_own,
    note_on_look,
    render_plain,
    share_like_own,
    splat_scene,
)

EXPORT_RECORD = "export.json"
"""What `semgs export` writes beside its files."""

TRIED_VIEWS = 4
"""So many photos decide between two frames."""

MOST_VIEWS = 8
"""Cameras of a scene that are used, evenly chosen."""

TILTED = 3.0
"""If up is further than this from what is usual, the cameras are put about it again [degrees]."""

UPS = (torch.tensor([0.0, 1.0, 0.0], dtype=torch.float64), torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64))
"""Axes about which cameras are put around a splat that does not look like the photos; features are found in whatever way images are turned."""

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
    moved = fit_to_scene(file, splat.gaussians, scene)
    gaussians = moved.gaussians
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
    return OpenedScene(
        saved,
        up,
        photos=tuple(photos),
        splat=True,
        note=f"{moved.note} {_likeness(rendered, views).note}".strip(),
    )


@dataclass(frozen=True)
class _Likeness:
    """How a splat looks like photos from their cameras, where it shows something, as it may be only a part of what they show.

    Attributes:
        decibels: the median PSNR of the views [dB].
        own: `share_like_own`.
        correlation: `likeness_to_own`.
    """

    decibels: float
    own: float | None
    correlation: float

    @property
    def note(self) -> str:
        """What to say of it."""
        return note_on_look(self.decibels, self.own)

    @property
    def rank(self) -> tuple[float, float]:
        """The greater, the likelier."""
        return self.own or 0.0, self.decibels

    @property
    def own_photos(self) -> bool:
        """Whether most renderings are like their own photo."""
        return (self.own or 0.0) > FEW_LIKE_OWN

    def clearly_beats(self, other: _Likeness) -> bool:
        """Whether it is right where another is not: most renderings are like their own photo, and what a straight line from the greys of one to those of the other leaves of
        the photo's variance, 1 - correlation^2, is at most half: 3 dB of PSNR once brightness and contrast are those of the photo."""
        left, left_by_other = 1 - self.correlation**2, 1 - other.correlation**2
        return self.own_photos and left <= left_by_other / 2


def _likeness(rendered: Sequence[Rendering], views: Views) -> _Likeness:
    """How renderings look like their photos."""
    images, shown = (
        torch.cat([view.images for view in rendered]),
        torch.cat([view.alphas for view in rendered]) >= SEEN_ALPHA,
    )
    if views.hidden is not None:
        shown = shown & ~views.hidden
    found = [psnr_seen(*one) for one in zip(images, views.images, shown, strict=True)]
    known = [float(one) for one in found if one is not None]
    compared = (images, views.images, shown)
    return _Likeness(median(known) if known else 0.0, share_like_own(*compared), likeness_to_own(*compared))


@dataclass(frozen=True)
class MovedSplat:
    """A splat in the coordinates of a scene, relative to its origin, and a note if it was moved there by what lies beside it."""

    gaussians: Gaussians
    note: str = ""


def fit_to_scene(file: Path, gaussians: Gaussians, scene: Scene) -> MovedSplat:
    """A splat in the coordinates of a scene: as `in_frame_of`, or, if it is an export of ours that was turned and centred, by what export.json says of it, whichever
    looks more like the photos. If features that photos and renderings share say that it is elsewhere, it is moved by the similarity that they say, provided that it clearly
    looks more like the photos then.

    Raises:
        InputError: a photo cannot be read, or dataparser_transforms.json is damaged.
    """
    plain, scene_from_file = in_frame_of(file, gaussians, scene), exported_frame(file)
    chosen = spread(range(len(scene)), TRIED_VIEWS)
    views = scene.read(chosen, default_size(scene.frames[chosen[0]].lens.size), NEAR_FAR)
    moved, looks = MovedSplat(plain), _likeness(render_plain(plain, views.cameras), views)
    if scene_from_file is not None and not torch.equal(scene_from_file, torch.eye(4, dtype=torch.float64)):
        scene_from_file[:3, 3] -= torch.from_numpy(scene.origin)
        exported = move_gaussians(scene_from_file, gaussians)
        as_exported = _likeness(render_plain(exported, views.cameras), views)
        if as_exported.rank > looks.rank:
            note = f"The splat is moved by scene_from_file of {EXPORT_RECORD} beside it: then it looks like the photos (PSNR {as_exported.decibels:.1f} dB, not {looks.decibels:.1f})."
            moved, looks = MovedSplat(exported, note), as_exported
    similarity = find_similarity(moved.gaussians, views, UPS if looks.note else ())
    if similarity is None:
        return moved
    if torch.equal(similarity, torch.eye(4, dtype=torch.float64)):
        same = "Features that renderings and photos share are in the same places: the cameras fit."
        return replace(moved, note=f"{moved.note} {same}".strip()) if looks.note and not looks.own_photos else moved
    found = move_by(similarity, moved.gaussians)
    as_found = _likeness(render_plain(found, views.cameras), views)
    if not as_found.clearly_beats(looks):
        return moved
    return MovedSplat(found, f"{moved.note} {_note_on_motion(similarity, scene.origin, as_found, looks)}".strip())


def _note_on_motion(
    similarity: Float64[Tensor, "4 4"], origin: Float64[np.ndarray, " 3"], after: _Likeness, before: _Likeness
) -> str:
    """By what a splat was moved, in the coordinates of the scene, and what it changed."""
    scale, x = scale_of(similarity), torch.from_numpy(origin)
    turn = degrees(acos(min(1.0, max(-1.0, (float(similarity[:3, :3].trace()) / scale - 1) / 2))))
    shift = ", ".join(f"{float(one):.3g}" for one in similarity[:3, 3] + x - similarity[:3, :3] @ x)
    return (
        f"The photos fit the splat turned by {turn:.1f} degrees, scaled by {scale:.4g} and then moved by ({shift}), found by features that they share, so it is moved there: "
        f"its renderings have {after.decibels:.1f} dB instead of {before.decibels:.1f}."
    )


def exported_frame(file: Path) -> Float64[Tensor, "4 4"] | None:
    """From the coordinates of a file of `semgs export` to those of its scene, as export.json beside it says; None if nothing does.

    Raises:
        InputError: export.json is damaged.
    """
    record = file.parent / EXPORT_RECORD
    if not record.is_file():
        return None
    content = read_json(record)
    listed = content.get("files") if isinstance(content, dict) else None
    for one in listed if isinstance(listed, list) else []:
        if isinstance(one, dict) and one.get("name") == file.name:
            try:
                return Cameras(one.get("scene_from_file", ()), torch.eye(3), (2, 2)).world_from_camera
            except (TypeError, ValueError) as error:
                raise InputError(record, "a rigid motion [4 4]", str(error), "scene_from_file") from error
    return None


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

"""Write rooms as scene folders in the `transforms.json` layout."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64, UInt16
from scipy.spatial.transform import Rotation

from semgs._version import __version__
from semgs.data.maps import MILLIMETRE
from semgs.data.origin.licences import ROOM
from semgs.data.tables.classes import IGNORE
from semgs.data.views import Views
from semgs.files.atomic import write_bytes, write_json
from semgs.files.folders import own_folder
from semgs.files.images.pictures import jpeg_bytes, write_png
from semgs_rooms.assets.asset_library import Library
from semgs_rooms.drawing.room import Room, build_room
from semgs_rooms.drawing.shading import RoomCamera, centres, look, pixel_directions, things
from semgs_rooms.plans.floor_plan import FloorPlan
from semgs_rooms.plans.style import STYLES, Style
from semgs_rooms.sets.carried_cameras import LOWEST, draw_camera, draw_habit, draw_path
from semgs_rooms.sets.room_stream import generator, keep_overlap, shoot

SHADED = "shaded"
"""Lighting method. Earlier releases also had another one and wrote this entry, so files still contain it."""

EDITIONS: dict[Style, str] = {"home": ", second edition of homes", "other": "", "closeup": ""}
"""Added to the version in settings: a version of SemGS that is not released yet may make other rooms than before."""

STEPS_CM = (20, 40)
"""Steps to the side, away from the other input view [cm]."""

TURNS_DEG = (15, 30)
"""Angles around what the middle of the image shows [degrees]."""

CLEARANCE = 0.2
"""Distance to solids that a camera keeps [m]."""

GRID = (12, 16)
"""Rays (rows, columns) whose median depth is that of what a view shows."""

Pose = Float64[np.ndarray, "4 4"]
"""world_from_camera, OpenCV axes."""


@dataclass(frozen=True)
class DrawnScene:
    """The views of a camera on its path through a room.

    Attributes:
        views: with labels and depths.
        plan: of the room.
        files: of the assets in the room.
        names: of the views, as stems of their files; None for numbers.
        things: the number of the piece of furniture at each pixel of the views, from 1; 0 for the room itself.
    """

    views: Views
    plan: FloorPlan
    files: tuple[str, ...] = ()
    names: tuple[str, ...] | None = None
    things: tuple[UInt16[np.ndarray, "h w"], ...] = ()


@dataclass(frozen=True)
class RoomSettings:
    """Everything that determines the bytes of scene k. The number of scenes, their folder and the workers have no influence.

    Attributes:
        seed: of the rooms.
        size: image (height, width) [px].
        frames: of each scene.
        style: of the rooms.
        library: meshes and images to use, None for none. It is identified by the locks of its folders, not by their paths.
        aside: instead of a walk, two input views and views beside them, for the protocol aside of `semgs evaluate`; `frames` does not count.

    Raises:
        ValueError: a field is out of range.
    """

    seed: int
    size: tuple[int, int]
    frames: int = 12
    style: Style = "home"
    library: Library | None = None
    aside: bool = False

    def __post_init__(self) -> None:
        checks = {
            "seed": (self.seed >= 0, "0 or more"),
            "size": (min(self.size) >= 1, "positive height and width"),
            "frames": (self.frames >= 2, "2 or more"),
            "style": (self.style in STYLES, f"one of {', '.join(STYLES)}"),
        }
        for name, (holds, expected) in checks.items():
            if not holds:
                raise ValueError(f"{name} is {getattr(self, name)}; expected {expected}")

    def as_json(self) -> dict:
        """The content of `settings.json`. It includes the version of SemGS and of the style, as another version may make other rooms."""
        assets = None if self.library is None else f"lock {', '.join(self.library.lock_digests)}"
        return {
            "semgs": __version__ + EDITIONS[self.style], "seed": self.seed, "size": list(self.size),
            "frames": self.frames, "style": self.style, "render": SHADED, "assets": assets, **({"aside": True} if self.aside else {}),
        }  # fmt: skip


def draw_scene(settings: RoomSettings, index: int) -> DrawnScene:
    """Generate room `index` of a set with these settings and render a walk through it. The same arguments give the same bits.

    Raises:
        ValueError: the index is negative.
        InputError: a file of the library cannot be read.
        ImportError: embreex is not installed; the message names the extra to install.
    """
    rng = generator(settings.seed, index)
    room = build_room(rng, settings.library, settings.style)
    habit = draw_habit(rng, settings.style)
    camera = draw_camera(rng, settings.size, habit)
    if settings.aside:
        path = keep_overlap(rng, room, draw_path(rng, room, camera, 0.5, habit), camera, habit.overlap)
        named = views_aside(room, path.pose(-0.5), path.pose(0.5), camera)
        return _drawn(rng, room, [*named.values()], camera, tuple(named))
    reach = (settings.frames - 1) / 2
    path = keep_overlap(rng, room, draw_path(rng, room, camera, reach, habit), camera, habit.overlap)
    poses = [path.pose(float(s)) for s in np.linspace(-reach, reach, settings.frames)]
    return _drawn(rng, room, poses, camera)


def _drawn(
    rng: np.random.Generator,
    room: Room,
    poses: Sequence[Float64[np.ndarray, "4 4"]],
    camera: RoomCamera,
    names: tuple[str, ...] | None = None,
) -> DrawnScene:
    """What a camera sees from some poses in a room."""
    numbers = tuple(things(room, pose, camera) for pose in poses)
    return DrawnScene(shoot(rng, room, poses, camera), room.plan, room.files, names, numbers)


def write_scene(folder: str | Path, settings: RoomSettings, index: int = 0) -> None:
    """Write room `index` of a set with these settings as a `transforms.json` folder. The folder appears only once it is complete.

    Images are JPEGs in `images/`, depths uint16 PNGs in millimetres in `depth/`, labels uint8 PNGs of ScanNet's 20 classes in
    `labels/`, 255 = ignore, and uint16 PNGs of the numbers of furniture pieces in `instances/`, 0 for none. `room.json` says which room it is, how many pixels each class has and, with a library, which of its
    files are in the room.

    Raises:
        ValueError: the index is negative.
        InputError: the folder already exists, or a file of the library cannot be read.
        ImportError: embreex is not installed; the message names the extra to install.
        OSError: the disk is full.
    """
    walk = draw_scene(settings, index)
    record: dict[str, Any] = {
        "style": settings.style, "render": SHADED, "seed": settings.seed, "index": index, "kind": walk.plan.kind,
        "size_m": [round(float(side), 3) for side in walk.plan.size], "pixels": class_pixels(walk.views),
    }  # fmt: skip
    if settings.library is not None:
        record["assets"] = list(walk.files)
    with own_folder(folder, "rooms") as fresh:
        write_views(fresh, walk.views, names=walk.names, things=walk.things)
        write_json(fresh / ROOM, record)


def class_pixels(views: Views) -> dict[str, int]:
    """Number of pixels of each class, and of pixels without a class as "ignored".

    Raises:
        ValueError: the views have no labels.
    """
    if views.labels is None:
        raise ValueError("the views have no labels")
    counts = torch.bincount(views.labels.flatten().long(), minlength=IGNORE + 1)
    named = {name: int(counts[label]) for label, name in enumerate(views.classes.names)}
    return {**named, "ignored": int(counts[IGNORE])}


def write_views(
    folder: Path,
    views: Views,
    quality: int = 92,
    names: Sequence[str] | None = None,
    things: Sequence[UInt16[np.ndarray, "h w"]] = (),
) -> None:
    """Write unbatched views with labels and depths, and perhaps numbers of things, into an existing folder, under names or as 000, 001, ....

    Raises:
        ValueError: labels or depths are missing.
    """
    if views.labels is None or views.depths is None:
        raise ValueError("the views have no labels or no depths; both are needed")
    for name in ("images", "depth", "labels", *(["instances"] if things else [])):
        (folder / name).mkdir()
    frames = []
    for i in range(len(views)):
        picture = (views.images[i].permute(1, 2, 0) * 255).round().byte().numpy()
        stem = f"{i:03d}" if names is None else names[i]
        write_bytes(folder / "images" / f"{stem}.jpg", jpeg_bytes(picture, quality))
        write_png(folder / "depth" / f"{stem}.png", np.round(views.depths[i].numpy() / MILLIMETRE).astype(np.uint16))
        write_png(folder / "labels" / f"{stem}.png", views.labels[i].numpy())
        pose = views.cameras.world_from_camera[i].clone()
        pose[:3, 1:3] *= -1  # OpenGL axes, as the format wants
        matrix = [[round(x, 9) for x in line] for line in pose.tolist()]
        files = {"file_path": f"images/{stem}.jpg", "depth_file_path": f"depth/{stem}.png"}
        if things:
            write_png(folder / "instances" / f"{stem}.png", things[i])
            files["instance_file_path"] = f"instances/{stem}.png"
        frames.append({**files, "label_file_path": f"labels/{stem}.png", "transform_matrix": matrix})
    intrinsics = views.cameras.intrinsics[0]
    places = {"fl_x": (0, 0), "fl_y": (1, 1), "cx": (0, 2), "cy": (1, 2)}
    height, width = views.size
    content = {
        "camera_model": "PINHOLE", "w": width, "h": height,
        **{name: round(float(intrinsics[place]), 6) for name, place in places.items()},
        "metric": True, "depth_unit_scale_factor": MILLIMETRE, "label_set": views.classes.name, "label_ignore": IGNORE,
        "frames": frames,
    }  # fmt: skip
    write_json(folder / "transforms.json", content)


def views_aside(room: Room, first: Pose, second: Pose, camera: RoomCamera) -> dict[str, Pose]:
    """Poses by name: input_0 and input_1, then for each of them aside_I_20cm, aside_I_40cm, aside_I_15deg and aside_I_30deg, as far as the room has place for them.

    All go to the side of the camera, away from the other input view. Angles are around the vertical through the point straight ahead at the median depth, so the view still
    shows it.
    """
    poses = {"input_0": first, "input_1": second}
    for number, (pose, other) in enumerate(((first, second), (second, first))):
        right = pose[:3, 0]
        outward = -right if (other[:3, 3] - pose[:3, 3]) @ right > 0 else right
        beside = {f"{step}cm": _moved(pose, step / 100 * outward) for step in STEPS_CM}
        pivot = pose[:3, 3] + _median_depth(room, pose, camera) * pose[:3, 2]
        for angle in TURNS_DEG:
            both = [_turned(pose, pivot, sign * angle) for sign in (1, -1)]
            beside[f"{angle}deg"] = max(both, key=lambda one: float((one[:3, 3] - pose[:3, 3]) @ outward))
        poses |= {f"aside_{number}_{name}": one for name, one in beside.items() if _has_place(room, one[:3, 3])}
    return poses


def _moved(pose: Pose, by: Float64[np.ndarray, " 3"]) -> Pose:
    """A pose moved without a turn."""
    moved = pose.copy()
    moved[:3, 3] += by
    return moved


def _turned(pose: Pose, pivot: Float64[np.ndarray, " 3"], degrees: float) -> Pose:
    """A pose turned around the vertical through a point."""
    turn = Rotation.from_rotvec([0, 0, degrees], degrees=True).as_matrix()
    turned = np.eye(4)
    turned[:3, :3] = turn @ pose[:3, :3]
    turned[:3, 3] = pivot + turn @ (pose[:3, 3] - pivot)
    return turned


def _median_depth(room: Room, pose: Pose, camera: RoomCamera) -> float:
    """The median z-depth of what a camera sees [m]."""
    pixels = centres(GRID) * (camera.size[1] / GRID[1], camera.size[0] / GRID[0])
    _, depths = look(room, pose, pixel_directions(pose, camera.intrinsics, pixels))
    return float(np.median(depths))


def _has_place(room: Room, place: Float64[np.ndarray, " 3"]) -> bool:
    """Whether a camera can be at a place."""
    places = place[None]
    return bool(room.inside(places).all() and place[2] >= LOWEST and (room.clearance(places) >= CLEARANCE).all())

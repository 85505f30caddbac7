"""Things and free floor of a saved scene, which knows its cameras, its classes and its unit; and objects.json.

    {"format": "semgs.objects", "version": 1, "unit": "metric", "seen_from": [x, y, z],
     "objects": [{"instance": 1, "class": "chair", "number": 4, "confidence": 0.83,
                  "likeliest": [{"class": "chair", "confidence": 0.83}, {"class": "sofa", "confidence": 0.09}], "centre": [x, y, z], "size": [length, width, height],
                  "quaternion": [w, x, y, z], "yaw_degrees": 30.0, "distance": 1.9, "gaussians": 812}]}

Positions are in the frame that export.json has for the file. The quaternion takes the axes of the box (length, width, height) to that frame; `yaw_degrees` is the angle
from x to the length of the box, and null if z is not up in the file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float64
from torch import Tensor

from semgs.files.atomic import write_json
from semgs.geometry.rotations import quaternion_from_matrix
from semgs.rendering.rendering import class_numbers
from semgs.robotics.boxes import SIGNS
from semgs.robotics.floor import FLOOR, NoFloorError, floor_height
from semgs.robotics.objects import SURE, Objects, Thing, objects
from semgs.robotics.occupancy import Occupancy, occupancy
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import FramedScene, UpDirection

Z_IS_UP = 0.985
"""Cosine of the largest angle (10 degrees) between z and up in a frame for maps: finding up is not more exact than that in some scenes."""

GET_METRES = "reconstruct it again, with --scale-from if its cameras were estimated, or with --unit metric if its poses are in metres"
"""What to do about a scene whose unit is unknown."""


@dataclass(frozen=True)
class PlacedThing:
    """A thing in the frame of a file.

    Attributes:
        thing: the thing.
        centre: of its box [m].
        axes: the directions of length, width and height of its box, in columns.
    """

    thing: Thing
    centre: Float64[np.ndarray, " 3"]
    axes: Float64[np.ndarray, "3 3"]

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """The rotation of the box (w, x, y, z)."""
        w, x, y, z = quaternion_from_matrix(torch.from_numpy(self.axes.copy())).tolist()
        return w, x, y, z

    @property
    def corners(self) -> Float64[np.ndarray, "8 3"]:
        """The corners of the box, in the order of `Box.corners` [m]."""
        return SIGNS * np.array(self.thing.box.size) / 2 @ self.axes.T + self.centre


def things_of(scene: SavedScene, up: UpDirection, **options: Any) -> Objects:
    """The things of a scene, with distances from its first camera; options as for `semgs.objects`. Those whose class is less likely than `SURE` have two
    names or are unknown objects.

    Args:
        scene: in metres, with classes.
        up: the direction that is up in it.

    Raises:
        ValueError: the unit is unknown, or the scene has no classes.
        ImportError: scikit-learn or trimesh is not installed.
    """
    check_metric(scene)
    if scene.classes is None:
        raise ValueError("the scene has no classes, and things are found by class")
    return objects(
        scene.gaussians,
        scene.classes,
        up=up.direction.tolist(),
        seen_from=scene.cameras.centres[0].tolist(),
        temperature=None if scene.temperatures is None else scene.temperatures.gaussians,
        **{"sure": SURE, "floor": floor_of(scene, up), **options},
    )


def occupancy_of(scene: SavedScene, up: UpDirection, **options: Any) -> Occupancy:
    """The occupancy of a scene; options as for `semgs.occupancy`.

    Args:
        scene: in metres.
        up: the direction that is up in it.

    Raises:
        ValueError: the unit is unknown, or as `semgs.occupancy`.
        NoFloorError: no floor was found.
    """
    check_metric(scene)
    return occupancy(
        scene.gaussians,
        scene.cameras,
        up=up.direction.tolist(),
        classes=scene.classes,
        depths=scene.depths,
        depth_spread=scene.depth_spread,
        stride=scene.stride if scene.places is None else 0,
        **options,
    )


def floor_of(scene: SavedScene, up: UpDirection) -> float | None:
    """The height of the floor along the direction that is up; None if no floor was found, or the unit is unknown.

    Args:
        scene: the scene.
        up: the direction that is up in it.
    """
    if scene.unit != "metric":
        return None
    gaussians = scene.gaussians
    on_floor = None
    if gaussians.semantic is not None and scene.classes is not None and FLOOR in scene.classes.names:
        on_floor = (class_numbers(gaussians.semantic.features) == scene.classes.index(FLOOR)).numpy()
    heights = (gaussians.means.double() @ up.direction).numpy()
    eyes = (scene.cameras.centres @ up.direction).numpy()
    try:
        return floor_height(heights, gaussians.opacities.double().numpy(), eyes, on_floor)
    except NoFloorError:
        return None


def check_metric(scene: SavedScene) -> None:
    """Check that lengths are in metres.

    Raises:
        ValueError: the unit is unknown.
    """
    if scene.unit != "metric":
        raise ValueError(f"the unit of the scene is unknown, and things and free floor need metres; {GET_METRES}")


def place_things(found: Objects, file_from_scene: Float64[Tensor, "4 4"] | None = None) -> tuple[PlacedThing, ...]:
    """The things in the frame of a file.

    Args:
        found: the things of a scene.
        file_from_scene: from the frame of its Gaussians to that of the file; None for the frame of the Gaussians.
    """
    moved = np.eye(4) if file_from_scene is None else file_from_scene.numpy()
    file_from_level = moved[:3, :3] @ found.level_from_world.T
    return tuple(
        PlacedThing(thing, file_from_level @ thing.box.centre + moved[:3, 3], file_from_level @ thing.box.axes)
        for thing in found.things
    )


def file_from_scene(framed: FramedScene, scene: SavedScene) -> Float64[Tensor, "4 4"]:
    """From the frame of a scene's Gaussians, relative to its origin, to that of a file."""
    source_from_scene = torch.eye(4, dtype=torch.float64)
    source_from_scene[:3, 3] = torch.tensor(scene.origin, dtype=torch.float64)
    return framed.file_from_source @ source_from_scene


def prim_names(names: Sequence[str]) -> list[str]:
    """Names of prims for names of classes: other characters than letters of ASCII, digits and _ become _, and no two are equal in letters of any case."""
    found: list[str] = []
    taken: set[str] = set()
    for name in names:
        plain = "".join(one if one.isascii() and one.isalnum() else "_" for one in name) or "_"
        plain = plain if not plain[0].isdigit() else f"_{plain}"
        unique, number = plain, 1
        while unique.lower() in taken:
            number += 1
            unique = f"{plain}_{number}"
        taken.add(unique.lower())
        found.append(unique)
    return found


def save_objects(path: Path, things: Sequence[PlacedThing], framed: FramedScene) -> None:
    """Write objects.json.

    Args:
        path: the file.
        things: in the frame of the file.
        framed: the scene in the same frame.

    Raises:
        OSError: it cannot be written.
    """
    listed = [
        {
            "instance": one.thing.instance,
            "class": one.thing.name,
            "number": one.thing.label,
            "confidence": round(one.thing.confidence, 4),
            "likeliest": [{"class": name, "confidence": round(share, 4)} for name, share in one.thing.likeliest],
            "centre": _metres(one.centre),
            "size": _metres(one.thing.box.size),
            "quaternion": [round(number, 6) for number in one.quaternion],
            "yaw_degrees": _yaw(one) if framed.axes == "z" else None,
            "distance": round(one.thing.distance, 4),
            "gaussians": one.thing.count,
        }
        for one in things
    ]
    content = {
        "format": "semgs.objects",
        "version": 1,
        "unit": framed.scene.unit,
        "seen_from": _metres(framed.scene.cameras.centres[0].tolist()),
        "objects": listed,
    }
    write_json(path, content)


def _yaw(one: PlacedThing) -> float:
    """The angle from x to the length of the box, -90 to 90 [degrees]."""
    yaw = degrees(np.arctan2(one.axes[1, 0], one.axes[0, 0]))
    return round((yaw + 90) % 180 - 90, 3)


def _metres(numbers: Sequence[float] | Float64[np.ndarray, " 3"]) -> list[float]:
    """Numbers to a tenth of a millimetre."""
    return [round(float(number), 4) for number in numbers]

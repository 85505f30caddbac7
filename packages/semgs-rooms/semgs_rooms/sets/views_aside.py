"""Views beside two input views, as a visitor takes them who steps to the side or around what they show."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from semgs_rooms.drawing.room import Room
from semgs_rooms.drawing.shading import RoomCamera, centres, look, pixel_directions
from semgs_rooms.sets.carried_cameras import LOWEST

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

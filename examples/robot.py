"""The nearest things and the free floor ahead, from three photos with poses in a robot's base frame.

    python examples/robot.py SCENE

The poses of SCENE are in a room's frame with z up, in metres. `base_from_room` replaces the robot: its base is below
the first camera, x points where that looks, y left. On a robot, tf gives `base_link` from the camera's optical frame.
"""

import sys
from math import atan2, cos, sin

import numpy as np
import torch

from semgs import Cameras, Views, load, objects, occupancy, open_scene

LANE = np.array([3.0, 0.6])  # length and width of the lane ahead [m]


def base_from_room(camera: torch.Tensor) -> torch.Tensor:
    """The motion [4 4] from the room's frame to the base frame of a robot below a camera [4 4]."""
    (x, y), yaw = camera[:2, 3].tolist(), atan2(camera[1, 2], camera[0, 2])
    rows = [[cos(yaw), -sin(yaw), 0, x], [sin(yaw), cos(yaw), 0, y], [0, 0, 1, 0], [0, 0, 0, 1]]
    return torch.tensor(rows, dtype=torch.float64).inverse()


room = open_scene(sys.argv[1]).read([0, 1, 2])
poses = base_from_room(room.cameras.world_from_camera[0]) @ room.cameras.world_from_camera
views = Views(room.images, Cameras(poses, room.cameras.intrinsics, room.size), room.depth_range)
made = load("small")(views)
things = objects(made.gaussians).things
for name in ("chair", "table", "door"):
    nearest = min((thing.distance for thing in things if thing.name == name), default=None)
    print(f"nearest {name}:", "none in view" if nearest is None else f"{nearest:.2f} m")
plan = occupancy(made.gaussians, views.cameras, depth_spread=made.depth_spread, stride=made.stride)
rows, columns = np.indices(plan.cells.shape)
x, y = (start + plan.resolution * (n + 0.5) for start, n in zip(plan.origin, (columns, rows), strict=False))
lane = plan.cells[(x > 0) & (x < LANE[0]) & (abs(y) < LANE[1] / 2)]
free, known = (plan.resolution**2 * np.sum(cells) / LANE.prod() for cells in (lane == 0, lane >= 0))
print(f"{LANE[1]} x {LANE[0]} m ahead: {free:.0%} free floor, {1 - known:.0%} unseen, the rest occupied")

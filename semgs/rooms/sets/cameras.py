"""Cameras carried through a room by people and robots: intrinsics, and paths with position and orientation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from semgs.data.classes import IGNORE
from semgs.rooms.drawing.room import Room
from semgs.rooms.drawing.shading import centres, look, pixel_directions

PROBE = (12, 16)
"""Probe rays (rows, columns) from which a view is scored."""
CANDIDATES = 10
"""Number of collision-free paths that are scored."""
CLEARANCE = 0.5
"""Minimum distance to solids in the distance field, whose error is below 0.1 m [m]."""
NEAREST = 0.5
"""Minimum z-depth of a probe ray [m]."""
LOWEST = 0.3
"""Minimum height above the floor [m]."""
ROBOT, HAND = (0.32, 0.6), (1.0, 1.8)
"""Camera heights on robots and in people's hands [m]."""
ROBOTS = 0.2
"""Share of robot paths."""
SMALL = (12, 16, 17, 18)
"""Classes of small things in few rooms (desk, toilet, sink, bathtub); the more of them a view shows, the higher its score."""
RARE = (5, 9, 10, 12, 14, 16, 17, 19)
"""Classes that fill few pixels (sofa, bookshelf, picture, desk, refrigerator, toilet, sink, otherfurniture); showing one raises
a view's score."""
WALL_LABEL, FLOOR_LABEL = 0, 1


@dataclass(frozen=True)
class CameraPath:
    """A smooth camera path, as a function of s.

    Attributes:
        middle: position at s = 0 [m].
        travel: displacement per unit of s [m].
        bend: displacement per s squared [m].
        yaw, pitch, roll: at s = 0 [rad]; yaw from x towards y, pitch positive upwards.
        yaw_rate, pitch_rate, roll_rate: change per unit of s [rad].
        tremor: amplitude of camera shake [rad].
        phase: of the shake [rad].
    """

    middle: Float64[np.ndarray, 3]
    travel: Float64[np.ndarray, 3]
    bend: Float64[np.ndarray, 3]
    yaw: float
    pitch: float
    roll: float
    yaw_rate: float
    pitch_rate: float
    roll_rate: float
    tremor: float
    phase: float

    def place(self, s: float) -> Float64[np.ndarray, 3]:
        """Camera position [m]."""
        return self.middle + s * self.travel + s * s * self.bend

    def pose(self, s: float) -> Float64[np.ndarray, "4 4"]:
        """world_from_camera, OpenCV axes."""
        shake = self.tremor * np.sin(np.array([5.1, 6.7, 4.3]) * s + self.phase + np.array([0.0, 2.0, 4.0]))
        yaw = self.yaw + self.yaw_rate * s + shake[0]
        pitch = self.pitch + self.pitch_rate * s + shake[1]
        roll = self.roll + self.roll_rate * s + shake[2]
        forward = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
        right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
        down = np.cross(forward, right)
        result = np.eye(4)
        result[:3, 0] = np.cos(roll) * right + np.sin(roll) * down
        result[:3, 1] = -np.sin(roll) * right + np.cos(roll) * down
        result[:3, 2] = forward
        result[:3, 3] = self.place(s)
        return result

    def paced(self, factor: float) -> CameraPath:
        """The same path around the same middle, `factor` times as fast."""
        return replace(
            self, travel=factor * self.travel, bend=factor * factor * self.bend, yaw_rate=factor * self.yaw_rate,
            pitch_rate=factor * self.pitch_rate, roll_rate=factor * self.roll_rate,
        )  # fmt: skip


def draw_intrinsics(rng: np.random.Generator, size: tuple[int, int]) -> Float64[np.ndarray, "3 3"]:
    """Random pinhole intrinsics [px]: focal length 0.7 to 1.3 of the longer side, principal point off the centre, sometimes fx and
    fy up to a third apart."""
    height, width = size
    focal = rng.uniform(0.7, 1.3) * max(height, width)
    if rng.random() < 0.5:
        focal = rng.uniform(0.75, 1.0) * max(height, width)
    ratio = float(np.exp(rng.uniform(-0.29, 0.29))) if rng.random() < 0.35 else rng.uniform(0.99, 1.01)
    fx, fy = focal * np.sqrt(ratio), focal / np.sqrt(ratio)
    x, y = width * (0.5 + rng.uniform(-0.03, 0.03)), height * (0.5 + rng.uniform(-0.03, 0.03))
    return np.array([[fx, 0, x], [0, fy, y], [0, 0, 1]])


def draw_path(
    rng: np.random.Generator,
    room: Room,
    intrinsics: Float64[np.ndarray, "3 3"],
    size: tuple[int, int],
    reach: float,
) -> CameraPath:
    """A random collision-free path that shows much of the room.

    Args:
        rng: source of all random choices.
        room: the room.
        intrinsics: of the camera [px].
        size: image (height, width) [px].
        reach: the path must be free from s = -reach to s = reach.
    """
    paths: list[CameraPath] = []
    heights = ROBOT if rng.random() < ROBOTS else HAND
    for middle in (place for _ in range(6) for place in _free_places(rng, room, heights, 150)[:60]):
        path = _draw(rng, room, middle, reach)
        if free(room, path, reach):
            paths.append(path)
        if len(paths) == CANDIDATES:
            break
    if not paths:
        return _last_resort(rng, room, reach)
    scores = np.array([_score(rng, room, path, intrinsics, size, reach) for path in paths])
    return paths[int(scores.argmax())]


def free(room: Room, path: CameraPath, reach: float) -> bool:
    """Whether the path keeps its clearance between s = -reach and s = reach."""
    length = 2 * reach * float(np.linalg.norm(path.travel))
    steps = np.linspace(-reach, reach, max(9, int(np.ceil(length / 0.15)) + 1))
    places = np.array([path.place(float(s)) for s in steps])
    inside = room.inside(places).all() and (places[:, 2] >= LOWEST).all()
    return bool(inside and (room.clearance(places) >= CLEARANCE).all())


def overlap(
    room: Room,
    first: Float64[np.ndarray, "4 4"],
    second: Float64[np.ndarray, "4 4"],
    intrinsics: Float64[np.ndarray, "3 3"],
    size: tuple[int, int],
) -> float:
    """Share of what the first camera sees that the second sees too, 0..1."""
    directions = pixel_directions(first, intrinsics, _probe_pixels(size))
    _, depths = look(room, first, directions)
    points = first[:3, 3] + directions * depths[:, None]
    inside = (points - second[:3, 3]) @ second[:3, :3]
    ahead = inside[:, 2] > 0.1
    pixels = inside @ intrinsics.T
    pixels = pixels[:, :2] / np.where(ahead, inside[:, 2], 1.0)[:, None]
    in_view = ahead & ((pixels > 0) & (pixels < (size[1], size[0]))).all(axis=-1)
    ways = points - second[:3, 3]
    seen = room.caster.reached(np.broadcast_to(second[:3, 3], ways.shape), ways, 0.98)
    return float((in_view & seen).mean())


def _probe_pixels(size: tuple[int, int]) -> Float64[np.ndarray, "n 2"]:
    return centres(PROBE) * (size[1] / PROBE[1], size[0] / PROBE[0])


def _free_places(
    rng: np.random.Generator, room: Room, heights: tuple[float, float], count: int
) -> Float64[np.ndarray, "n 3"]:
    """`count` random places between two heights, without those too close to something."""
    x, y, z = room.plan.size
    height = rng.uniform(heights[0], min(heights[1], z - 0.6), count)
    across = rng.uniform(-0.5, 0.5, (count, 2)) * (x - 1.0, y - 1.0)
    places = np.column_stack((across, height))
    return places[room.clearance(places) >= CLEARANCE]


def _draw(rng: np.random.Generator, room: Room, middle: Float64[np.ndarray, " 3"], reach: float) -> CameraPath:
    """A random path through a place, not yet checked: usually sideways, else forwards or backwards.

    A unit of s is 5-40 cm (less if the room is too short for twice the reach) and 1-15 degrees.
    """
    x, y, _ = room.plan.size
    aim = np.array([rng.uniform(-0.5, 0.5) * x, rng.uniform(-0.5, 0.5) * y, rng.uniform(0.2, 1.3)])
    if room.plan.footprints and rng.random() < 0.8:
        print_ = room.plan.footprints[int(rng.integers(len(room.plan.footprints)))]
        aim[:2] = print_.mean(axis=0) + rng.uniform(-0.4, 0.4, 2)
    way = aim - middle
    distance = max(float(np.hypot(way[0], way[1])), 0.3)
    yaw = float(np.arctan2(way[1], way[0])) + rng.uniform(-0.35, 0.35)
    pitch = float(np.arctan2(way[2], distance)) * 0.6 + rng.uniform(-0.15, 0.12)
    rise = 0.2 if middle[2] > ROBOT[1] else 0.02  # robots roll
    longest = min(0.4, 0.3 * float(np.hypot(x, y)) / (2 * reach))
    step = float(np.exp(rng.uniform(np.log(min(0.05, longest / 2)), np.log(longest))))
    turned = np.pi / 2 * rng.choice([-1, 1]) if rng.random() < 0.65 else rng.choice([0.0, np.pi])
    heading = yaw + turned + rng.uniform(-0.5, 0.5)
    travel = step * np.array([np.cos(heading), np.sin(heading), rng.uniform(-rise, rise)])
    sideways = float(-np.sin(yaw) * travel[0] + np.cos(yaw) * travel[1])
    turn = -sideways / distance * rng.uniform(-0.2, 1.2) + rng.uniform(-0.06, 0.06)
    turn = float(np.clip(turn, -0.26, 0.26))
    if abs(turn) < 0.0175:
        turn = 0.0175 if turn >= 0 else -0.0175
    bend = step * rng.uniform(-0.06, 0.06, 3) * (1, 1, rise)
    return CameraPath(
        middle=middle,
        travel=travel,
        bend=bend,
        yaw=yaw,
        pitch=float(np.clip(pitch, -0.75, 0.25)),
        roll=float(rng.normal(0, 0.035)),
        yaw_rate=turn,
        pitch_rate=float(rng.uniform(-0.03, 0.03)),
        roll_rate=float(rng.uniform(-0.01, 0.01)),
        tremor=float(rng.uniform(0.0, 0.012)),
        phase=float(rng.uniform(0, 6.28)),
    )


def _score(
    rng: np.random.Generator,
    room: Room,
    path: CameraPath,
    intrinsics: Float64[np.ndarray, "3 3"],
    size: tuple[int, int],
    reach: float,
) -> float:
    """Score of a path: higher for more classes, above all rare ones; lower for walls and ceilings, or if something is too close."""
    directions = pixel_directions(np.eye(4), intrinsics, _probe_pixels(size))
    score = float(rng.uniform(0, 1.5))
    for s in (-reach, 0.0, reach):
        pose = path.pose(s)
        labels, depths = look(room, pose, directions @ pose[:3, :3].T)
        shares = np.bincount(labels, minlength=IGNORE + 1)[:20] / len(labels)
        shown = np.flatnonzero(shares > 0.01)
        score += min(len(shown), 7) / 3 + 0.6 * min(sum(c in RARE for c in shown), 3) / 3
        score += 8 * min(float(shares[list(SMALL)].sum()), 0.12)
        score -= 4 * max(0.0, shares[FLOOR_LABEL + 1 :].max() - 0.45)
        score -= 4 * max(0.0, shares[WALL_LABEL] - 0.45) + 2 * max(0.0, shares[FLOOR_LABEL] - 0.5)
        score -= 3 * max(0.0, 1 - shares.sum() - 0.2)
        score += 1.2 * min(1 - shares[WALL_LABEL] - shares[FLOOR_LABEL] - max(0.0, 1 - shares.sum()), 0.6)
        if depths.min() < NEAREST:
            score -= 5
    return score


def _last_resort(rng: np.random.Generator, room: Room, reach: float) -> CameraPath:
    """A path through the place with the most clearance, slowed down until it is free."""
    x, y, z = room.plan.size
    places = rng.uniform((-x / 2 + 0.3, -y / 2 + 0.3, 0.5), (x / 2 - 0.3, y / 2 - 0.3, z - 0.5), (4000, 3))
    path = _draw(rng, room, places[int(room.clearance(places).argmax())], reach)
    for _ in range(8):
        if free(room, path, reach):
            break
        path = path.paced(0.5)
    return path

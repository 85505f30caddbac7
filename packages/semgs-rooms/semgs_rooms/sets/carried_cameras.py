"""Cameras carried through a room by people and robots: intrinsics, and paths with position and orientation."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from semgs.data.tables.classes import IGNORE
from semgs_rooms.drawing.room import Room
from semgs_rooms.drawing.shading import RoomCamera, centres, look, pixel_directions
from semgs_rooms.pieces.solids import Solids
from semgs_rooms.plans.style import Style

Glimpse = tuple[Float64[np.ndarray, " 20"], float]
"""The share of each class in a frame, and the nearest z-depth [m]."""

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
NEAR, NEAR_HEIGHTS = 0.9, (0.6, 1.8)
"""Maximum distance of a close camera from the box around its subject, and its heights in people's hands [m]."""
NEAREST_CLOSE = 0.4
"""Minimum z-depth of a probe ray of a close camera [m]."""
SUBJECT_SHARES, FILLED = (0.3, 0.9), (0.5, 1.0)
"""Ranges of the share of the frame that a close camera is to fill with its subject: in homes, and in close-ups."""
SMALL = (12, 16, 17, 18)
"""Classes of small things in few rooms (desk, toilet, sink, bathtub); the more of them a view shows, the higher its score."""
RARE = (5, 9, 10, 12, 14, 16, 17, 19)
"""Classes that fill few pixels (sofa, bookshelf, picture, desk, refrigerator, toilet, sink, otherfurniture); showing one raises
a view's score."""
WALL_LABEL, FLOOR_LABEL = 0, 1
SUBJECTS = (2, 3, 4, 5, 6, 9, 11, 12, 14, 15, 16, 17, 18, 19)
"""Classes of pieces that cameras come close to: all but wall, floor, door, window, picture and curtain."""
SCARCE = (16, 17, 18)
"""Those of them that are in few rooms (toilet, sink, bathtub)."""
LARGE_SUBJECTS = (2, 3, 11, 13, 14, 15, 18)
"""Classes that fill the image in close-ups: cabinet, bed, counter, curtain, refrigerator, shower curtain, bathtub."""
CLOSE, WIDE, TILTED, WIDE_ANGLE, TELE = 0.35, 0.35, 0.2, 0.15, 0.1
"""Shares of cameras in homes that are close, take long steps, are tilted, and have other focal lengths."""


@dataclass(frozen=True)
class Habit:
    """How one camera is used. The defaults are those of every camera in the held-out world.

    Attributes:
        robots: probability that a robot carries it.
        close: whether it shows one piece of furniture from close by, instead of much of the room.
        subjects: classes of these pieces.
        shares: range of the share of the frame that such a piece is to fill.
        roll: added to the roll of its path [rad].
        turn: added to the rotation of its path about z, per step [rad].
        step: range of the length of a step of its path [m].
        length: maximum length of its path, relative to the diagonal of the room.
        overlap: range of the overlap of views one step apart, below which the path is slowed down.
        focal: range of its focal length, relative to the longer side of the image.
    """

    robots: float = 0.2
    close: bool = False
    subjects: tuple[int, ...] = SUBJECTS
    shares: tuple[float, float] = SUBJECT_SHARES
    roll: float = 0.0
    turn: float = 0.0
    step: tuple[float, float] = (0.05, 0.4)
    length: float = 0.3
    overlap: tuple[float, float] = (0.6, 0.9)
    focal: tuple[float, float] = (0.7, 1.3)


USUAL = Habit()


def draw_habit(rng: np.random.Generator, style: Style) -> Habit:
    """A random habit for a camera in a room of this style. The state of `rng` does not change."""
    if style == "other":
        return USUAL
    own = rng.spawn(1)[0]
    habit = Habit(robots=0.25, close=bool(own.random() < CLOSE))
    if style == "closeup":
        habit = replace(habit, robots=0.1, close=True, subjects=LARGE_SUBJECTS, shares=FILLED)
    if own.random() < WIDE:
        turn = float(own.choice([-1, 0, 0, 1]) * own.uniform(0.15, 0.5))
        habit = replace(habit, turn=turn, step=(0.4, 1.0), length=0.6, overlap=(0.25, 0.6))
    if own.random() < TILTED:
        habit = replace(habit, roll=float(own.uniform(-0.26, 0.26)))
    lens = own.random()
    if lens < WIDE_ANGLE + TELE:
        habit = replace(habit, focal=(0.5, 0.7) if lens < WIDE_ANGLE else (1.3, 1.6))
    return habit


@dataclass(frozen=True)
class CloseSubject:
    """A piece of furniture that a camera comes close to: its class and the corners of its box [m]."""

    label: int
    low: Float64[np.ndarray, " 3"]
    high: Float64[np.ndarray, " 3"]


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

    middle: Float64[np.ndarray, " 3"]
    travel: Float64[np.ndarray, " 3"]
    bend: Float64[np.ndarray, " 3"]
    yaw: float
    pitch: float
    roll: float
    yaw_rate: float
    pitch_rate: float
    roll_rate: float
    tremor: float
    phase: float

    def place(self, s: float) -> Float64[np.ndarray, " 3"]:
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

    def change_pace(self, factor: float) -> CameraPath:
        """The same path around the same middle, `factor` times as fast."""
        return replace(
            self, travel=factor * self.travel, bend=factor * factor * self.bend, yaw_rate=factor * self.yaw_rate,
            pitch_rate=factor * self.pitch_rate, roll_rate=factor * self.roll_rate,
        )  # fmt: skip


def draw_camera(rng: np.random.Generator, size: tuple[int, int], habit: Habit = USUAL) -> RoomCamera:
    """A camera with images of this (height, width) and random intrinsics: focal length by the camera's habit, principal point off the
    centre, sometimes fx and fy up to a third apart."""
    height, width = size
    focal = rng.uniform(*habit.focal) * max(height, width)
    if habit.focal == USUAL.focal and rng.random() < 0.5:
        focal = rng.uniform(0.75, 1.0) * max(height, width)
    ratio = float(np.exp(rng.uniform(-0.29, 0.29))) if rng.random() < 0.35 else rng.uniform(0.99, 1.01)
    fx, fy = focal * np.sqrt(ratio), focal / np.sqrt(ratio)
    x, y = width * (0.5 + rng.uniform(-0.03, 0.03)), height * (0.5 + rng.uniform(-0.03, 0.03))
    return RoomCamera(np.array([[fx, 0, x], [0, fy, y], [0, 0, 1]]), size)


def draw_path(
    rng: np.random.Generator, room: Room, camera: RoomCamera, reach: float, habit: Habit = USUAL
) -> CameraPath:
    """A random collision-free path that shows much of the room, or one piece of furniture from close by.

    Args:
        rng: source of all random choices.
        room: the room.
        camera: that is carried.
        reach: the path must be free from s = -reach to s = reach.
        habit: of the camera.
    """
    paths: list[CameraPath] = []
    subject = _subject(rng, room.plan.pieces, room.solids, habit.subjects) if habit.close else None
    heights = ROBOT if rng.random() < habit.robots else (HAND if subject is None else NEAR_HEIGHTS)
    for middle in (place for _ in range(6) for place in _free_places(rng, room, heights, 150, subject)[:60]):
        path = _draw(rng, room, middle, reach, habit, subject)
        if free(room, path, reach):
            paths.append(path)
        if len(paths) == CANDIDATES:
            break
    if not paths:
        return _last_resort(rng, room, reach)
    if subject is None:
        scores = [_score(_glimpses(room, path, camera, reach), float(rng.uniform(0, 1.5))) for path in paths]
    else:
        share = rng.uniform(*habit.shares)
        scores = [_score_close(_glimpses(room, path, camera, reach), subject.label, share) for path in paths]
    return paths[int(np.argmax(scores))]


def free(room: Room, path: CameraPath, reach: float) -> bool:
    """Whether the path keeps its clearance between s = -reach and s = reach."""
    length = 2 * reach * float(np.linalg.norm(path.travel))
    steps = np.linspace(-reach, reach, max(9, int(np.ceil(length / 0.15)) + 1))
    places = np.array([path.place(float(s)) for s in steps])
    inside = room.inside(places).all() and (places[:, 2] >= LOWEST).all()
    return bool(inside and (room.clearance(places) >= CLEARANCE).all())


def view_overlap(
    room: Room, first: Float64[np.ndarray, "4 4"], second: Float64[np.ndarray, "4 4"], camera: RoomCamera
) -> float:
    """Share of what the first camera sees that the second sees too, 0..1."""
    directions = pixel_directions(first, camera.intrinsics, _probe_pixels(camera.size))
    _, depths = look(room, first, directions)
    points = first[:3, 3] + directions * depths[:, None]
    inside = (points - second[:3, 3]) @ second[:3, :3]
    ahead = inside[:, 2] > 0.1
    pixels = inside @ camera.intrinsics.T
    pixels = pixels[:, :2] / np.where(ahead, inside[:, 2], 1.0)[:, None]
    in_view = ahead & ((pixels > 0) & (pixels < camera.size[::-1])).all(axis=-1)
    ways = points - second[:3, 3]
    seen = room.caster.reached(np.broadcast_to(second[:3, 3], ways.shape), ways, 0.98)
    return float((in_view & seen).mean())


def _probe_pixels(size: tuple[int, int]) -> Float64[np.ndarray, "n 2"]:
    return centres(PROBE) * (size[1] / PROBE[1], size[0] / PROBE[0])


def _subject(
    rng: np.random.Generator, pieces: Sequence[tuple[int, int]], solids: Solids, classes: Sequence[int] = SUBJECTS
) -> CloseSubject | None:
    """A random piece of furniture of some classes, given as its range of parts; None if there is none.

    Scarce classes are four times as likely as others in the room. Of a piece with several classes one is the subject.
    """
    by_label: dict[int, list[tuple[int, int]]] = {}
    for first, end in pieces:
        for label in set(solids.labels[first:end].tolist()) & set(classes):
            by_label.setdefault(label, []).append((first, end))
    if not by_label:
        return None
    labels = sorted(by_label)
    weights = np.array([4.0 if label in SCARCE else 1.0 for label in labels])
    label = int(rng.choice(labels, p=weights / weights.sum()))
    first, end = by_label[label][int(rng.integers(len(by_label[label])))]
    own = np.arange(first, end)[solids.labels[first:end] == label]
    half = (np.abs(solids.rotations[own]) * solids.sizes[own, None] / 2).sum(-1)
    return CloseSubject(label, (solids.centres[own] - half).min(axis=0), (solids.centres[own] + half).max(axis=0))


def _free_places(
    rng: np.random.Generator, room: Room, heights: tuple[float, float], count: int, subject: CloseSubject | None = None
) -> Float64[np.ndarray, "n 3"]:
    """`count` random places between two heights, without those too close to something. With a subject they are close to its box."""
    x, y, z = room.plan.size
    height = rng.uniform(heights[0], min(heights[1], z - 0.6), count)
    across = rng.uniform(-0.5, 0.5, (count, 2)) * (x - 1.0, y - 1.0)
    places = np.column_stack((across, height))
    if subject is not None:
        low, high = subject.low - NEAR, subject.high + NEAR
        places[:, :2] = rng.uniform(low[:2], high[:2], (count, 2))
        away = np.linalg.norm(np.maximum(0.0, np.maximum(subject.low - places, places - subject.high)), axis=-1)
        places = places[room.inside(places) & (away <= NEAR)]
    return places[room.clearance(places) >= CLEARANCE]


def _draw(
    rng: np.random.Generator, room: Room, middle: Float64[np.ndarray, " 3"], reach: float, habit: Habit = USUAL,
    subject: CloseSubject | None = None,
) -> CameraPath:  # fmt: skip
    """A random path through a place, not yet checked: usually sideways, else forwards or backwards.

    A unit of s is 5-40 cm, by the habit up to 1 m (less if the room is too short for twice the reach, or close to a subject), and
    1-15 degrees.
    """
    x, y, _ = room.plan.size
    aim = np.array([rng.uniform(-0.5, 0.5) * x, rng.uniform(-0.5, 0.5) * y, rng.uniform(0.2, 1.3)])
    if room.plan.footprints and rng.random() < 0.8:
        footprint = room.plan.footprints[int(rng.integers(len(room.plan.footprints)))]
        aim[:2] = footprint.mean(axis=0) + rng.uniform(-0.4, 0.4, 2)
    down = 0.6  # people look less down than at what they aim at
    if subject is not None:
        aim, down = rng.uniform(subject.low, subject.high), 1.0
    way = aim - middle
    distance = max(float(np.hypot(way[0], way[1])), 0.3)
    yaw = float(np.arctan2(way[1], way[0])) + rng.uniform(-0.35, 0.35)
    pitch = float(np.arctan2(way[2], distance)) * down + rng.uniform(-0.15, 0.12)
    rise = 0.2 if middle[2] > ROBOT[1] else 0.02  # robots roll
    longest = min(habit.step[1], habit.length * float(np.hypot(x, y)) / (2 * reach)) * (1.0 if subject is None else 0.5)
    step = float(np.exp(rng.uniform(np.log(min(habit.step[0], longest / 2)), np.log(longest))))
    aside = np.pi / 2 * rng.choice([-1, 1]) if rng.random() < 0.65 else rng.choice([0.0, np.pi])
    heading = yaw + aside + rng.uniform(-0.5, 0.5)
    travel = step * np.array([np.cos(heading), np.sin(heading), rng.uniform(-rise, rise)])
    sideways = float(-np.sin(yaw) * travel[0] + np.cos(yaw) * travel[1])
    turn = -sideways / distance * rng.uniform(-0.2, 1.2) + rng.uniform(-0.06, 0.06)
    turn = float(np.clip(turn, -0.26, 0.26))
    if abs(turn) < 0.0175:
        turn = 0.0175 if turn >= 0 else -0.0175
    turn += habit.turn
    bend = step * rng.uniform(-0.06, 0.06, 3) * (1, 1, rise)
    pitch = float(np.clip(pitch, -0.75, 0.25) if subject is None else np.clip(pitch, -1.1, 0.4))
    roll = float(rng.normal(0, 0.035)) + habit.roll
    return CameraPath(
        middle, travel, bend, yaw, pitch, roll, turn,
        pitch_rate=float(rng.uniform(-0.03, 0.03)),
        roll_rate=float(rng.uniform(-0.01, 0.01)),
        tremor=float(rng.uniform(0.0, 0.012)),
        phase=float(rng.uniform(0, 6.28)),
    )  # fmt: skip


def _score(glimpses: Iterable[Glimpse], score: float) -> float:
    """Score of a path, from a random start: higher for more classes, above all rare ones; lower for walls and ceilings, or if something
    is too close."""
    for shares, nearest in glimpses:
        visible = np.flatnonzero(shares > 0.01)
        score += min(len(visible), 7) / 3 + 0.6 * min(sum(c in RARE for c in visible), 3) / 3
        score += 8 * min(float(shares[list(SMALL)].sum()), 0.12)
        score -= 4 * max(0.0, shares[FLOOR_LABEL + 1 :].max() - 0.45)
        score -= 4 * max(0.0, shares[WALL_LABEL] - 0.45) + 2 * max(0.0, shares[FLOOR_LABEL] - 0.5)
        score -= 3 * max(0.0, 1 - shares.sum() - 0.2)
        score += 1.2 * min(1 - shares[WALL_LABEL] - shares[FLOOR_LABEL] - max(0.0, 1 - shares.sum()), 0.6)
        if nearest < NEAREST:
            score -= 5
    return score


def _score_close(glimpses: Iterable[Glimpse], label: int, share: float) -> float:
    """Score of a path of a close camera: higher the nearer its subject's class is to a share of the frame."""
    score = 0.0
    for shares, nearest in glimpses:
        score -= abs(float(shares[label]) - share) + max(0.0, float(shares[WALL_LABEL]) - 0.45)
        score -= 5.0 * (nearest < NEAREST_CLOSE)
    return score


def _glimpses(room: Room, path: CameraPath, camera: RoomCamera, reach: float) -> Iterator[Glimpse]:
    """What the camera sees at the start, the middle and the end of a path, by probe rays."""
    directions = pixel_directions(np.eye(4), camera.intrinsics, _probe_pixels(camera.size))
    for s in (-reach, 0.0, reach):
        pose = path.pose(s)
        labels, depths = look(room, pose, directions @ pose[:3, :3].T)
        yield np.bincount(labels, minlength=IGNORE + 1)[:20] / len(labels), float(depths.min())


def _last_resort(rng: np.random.Generator, room: Room, reach: float) -> CameraPath:
    """A path through the place with the most clearance, slowed down until it is free."""
    x, y, z = room.plan.size
    places = rng.uniform((-x / 2 + 0.3, -y / 2 + 0.3, 0.5), (x / 2 - 0.3, y / 2 - 0.3, z - 0.5), (4000, 3))
    path = _draw(rng, room, places[int(room.clearance(places).argmax())], reach)
    for _ in range(8):
        if free(room, path, reach):
            break
        path = path.change_pace(0.5)
    return path

"""Which way is up in a scene, and the frames that viewers expect.

Files of poses rarely say which way is up, and the mean of the cameras' own up directions is tilted by the pitch that they have in common. What does say it
is the scene: many lines in the photos are upright, floors and tables are level, walls are upright, and people and robots hold cameras level. `up_of` searches the
direction that fits best around the mean of the cameras, by the logarithm of the likelihood of what it sees:

- a line in a photo and the camera span a plane, whose normal is orthogonal to up if the line is upright;
- the normal of a surface is parallel to up if it is level, and orthogonal if it is upright; other surfaces and lines have any direction;
- the cameras' x axes are orthogonal to up, to `ROLL` degrees, and `PITCH` is how far cameras usually look down.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, pi, radians, sin, sqrt
from typing import Literal

import torch
from jaxtyping import Bool, Float64
from torch import Tensor

from semgs.geometry.cameras import inverse_rigid
from semgs.geometry.gaussians import move_cameras, move_gaussians
from semgs.scene.own_views import lines, own_labels, own_points
from semgs.scene.scene_file import SavedScene

Up = Literal["auto", "x", "y", "z", "-x", "-y", "-z"]
"""The direction that is up in a scene's frame; "auto" finds it."""

Axes = Literal["-y", "y", "z"]
"""The direction that is up in a file. "-y": x right, z forward, as for 3DGS PLY; "y": x right, z backward (glTF); "z": x forward, y left (ROS, REP 103).
Forward is where the first input view looks."""


@dataclass(frozen=True)
class Round:
    """A round of the search: a grid of directions around the best one so far.

    Attributes:
        pitches, rolls: of the grid [degrees].
        line, surface: standard deviations of lines and surfaces [degrees].
        surfaces, pitch: weights of surfaces and of the usual pitch, against lines.
    """

    pitches: tuple[float, ...]
    rolls: tuple[float, ...]
    line: float
    surface: float
    surfaces: float
    pitch: float


def _steps(step: float, count: int) -> tuple[float, ...]:
    """Steps to both sides of 0."""
    return tuple(step * number for number in range(-count, count + 1))


ROUNDS = (
    Round(tuple(map(float, range(-66, 57, 2))), _steps(2.0, 3), line=4.0, surface=8.0, surfaces=2.0, pitch=0.1),
    Round(_steps(1.0, 4), _steps(1.0, 4), line=1.0, surface=6.0, surfaces=0.3, pitch=0.01),
    Round(_steps(0.125, 8), _steps(0.125, 8), line=0.7, surface=6.0, surfaces=0.3, pitch=0.01),
)
"""The first one is wide: lines along the floor can look like upright ones from another pitch, and surfaces, which say it to a few degrees, decide between them."""

ROUNDS_AROUND = (
    Round(_steps(5.0, 9), _steps(5.0, 9), line=6.0, surface=8.0, surfaces=2.0, pitch=0.0),
    Round(_steps(1.0, 5), _steps(1.0, 5), line=2.0, surface=6.0, surfaces=1.0, pitch=0.0),
    Round(_steps(0.25, 4), _steps(0.25, 4), line=0.7, surface=6.0, surfaces=1.0, pitch=0.0),
)
"""The same around a direction that is usual, if the cameras say nothing."""

SURFACES_AROUND = 5_000
"""So many surfaces are enough there."""

PITCH = (-15.0, 25.0)
"""Mean and standard deviation of the pitch of cameras, up is positive [degrees]."""

ROLL, ROLLS = 2.0, 0.02
"""Standard deviation of the roll of cameras [degrees], and the weight of all x axes against all lines."""

UPRIGHT_LINES, LEVEL_SURFACES, UPRIGHT_SURFACES = 0.3, 0.3, 0.3
"""The shares that are expected; the rest has any direction."""

STEP = 2
"""Normals come from differences over this many Gaussians to both sides."""

DIRECTIONS = 16
"""Directions that are scored at a time."""

MOSTLY_FITS = 0.6
"""With this share of level or upright surfaces a direction is certain, whatever lines say: the best direction for surfaces at random has 0.3 to 0.4."""

LEVEL_FLOOR, FLOOR_PART = 0.4, 0.01
"""A direction is also certain if this share of the floor is within 15 degrees of level, of normals at random 0.03 are, and the floor is at least this share of the
surfaces."""

LEAST_MEAN = 1e-6
"""Directions whose mean is shorter cancel."""

EVERY = 8
"""One surface in so many is used: neighbours say the same."""


@dataclass(frozen=True)
class UpDirection:
    """The direction that is up.

    Attributes:
        direction: in the scene's frame, of unit length.
        reason: what it follows from, for the user.
        certain: whether to rely on it.
    """

    direction: Float64[Tensor, " 3"]
    reason: str
    certain: bool = True

    @property
    def warning(self) -> str:
        """What to say to the user if it is uncertain."""
        return f"which way is up is uncertain ({self.reason}); set it with --up"


@dataclass(frozen=True)
class FramedScene:
    """A scene in the frame of a file.

    Attributes:
        scene: the same scene, in the frame of the file.
        file_from_source: from the coordinates of the source's poses to those of the file [4 4].
        axes: the direction that is up in the file; None if that is unknown, in the source's own frame.
    """

    scene: SavedScene
    file_from_source: Float64[Tensor, "4 4"]
    axes: Axes | None

    @property
    def source_from_file(self) -> Float64[Tensor, "4 4"]:
        """The inverse of `file_from_source`."""
        return inverse_rigid(self.file_from_source)


def axis_direction(axis: Literal["x", "y", "z", "-x", "-y", "-z"]) -> Float64[Tensor, " 3"]:
    """The unit vector along an axis, or against it."""
    direction = torch.zeros(3, dtype=torch.float64)
    direction["xyz".index(axis[-1])] = -1 if axis[0] == "-" else 1
    return direction


def up_of(scene: SavedScene, up: Up | UpDirection = "auto") -> UpDirection:
    """The direction that is up in a scene.

    Args:
        scene: with all of its Gaussians.
        up: if it is known: an axis, or the direction.
    """
    if isinstance(up, UpDirection):
        return up
    if up != "auto":
        return UpDirection(axis_direction(up), "as given")
    cues = _cues(scene)
    found, score = _search(cues, ROUNDS)
    if not len(cues.surfaces) and not len(cues.lines):
        return UpDirection(found, "the cameras say it alone", certain=False)
    return UpDirection(found, cues.fit(found), certain=score > 0 or cues.confirm(found))


def up_near(scene: SavedScene, usual: Float64[Tensor, " 3"], reason: str) -> UpDirection:
    """The direction within 45 degrees of a usual one that fits surfaces best, or the usual one if none fits. It is always uncertain.

    Args:
        scene: with cameras that say nothing, because they were put around a splat.
        usual: of unit length.
        reason: why it is usual.
    """
    level = torch.eye(3, dtype=torch.float64)[int(usual.abs().argmin())]
    right = _unit(level - (level @ usual) * usual)
    normals, may_be_level, may_be_upright = _surfaces(scene)
    kept = slice(None, None, max(1, len(normals) // SURFACES_AROUND))
    cues = Cues(
        lines=torch.zeros(0, 3, dtype=torch.float64),
        surfaces=normals[kept],
        may_be_level=may_be_level[kept],
        may_be_upright=may_be_upright[kept],
        rights=torch.zeros(1, 3, dtype=torch.float64),
        base=torch.stack((usual, right, torch.linalg.cross(usual, right))),
    )
    if len(cues.surfaces):
        found, score = _search(cues, ROUNDS_AROUND)
        if score > 0:
            return UpDirection(found, f"{cues.fit(found)}; {reason}", certain=False)
    return UpDirection(usual, reason, certain=False)


def _search(cues: Cues, rounds: Sequence[Round]) -> tuple[Float64[Tensor, " 3"], float]:
    """The best direction, and its score in the last round."""
    pitch = roll = 0.0
    score = torch.zeros(1, dtype=torch.float64)
    for one in rounds:
        pitches, rolls = torch.meshgrid(pitch + _tensor(one.pitches), roll + _tensor(one.rolls), indexing="ij")
        score = cues.score(pitches.flatten(), rolls.flatten(), one)
        best = score.argmax()
        pitch, roll = float(pitches.flatten()[best]), float(rolls.flatten()[best])
    return cues.directions(_tensor([pitch]), _tensor([roll]))[0], float(score.max())


@dataclass(frozen=True)
class Cues:
    """What says which way is up.

    Attributes:
        lines: normals of the planes through the lines and their cameras, of the length of the line.
        surfaces: normals of the surfaces, of unit length.
        may_be_level, may_be_upright: whether each surface can be, by its class.
        rights: the cameras' x axes.
        base: the mean up of the cameras, their mean right and forward, orthonormal.
    """

    lines: Float64[Tensor, "l 3"]
    surfaces: Float64[Tensor, "s 3"]
    may_be_level: Bool[Tensor, " s"]
    may_be_upright: Bool[Tensor, " s"]
    rights: Float64[Tensor, "v 3"]
    base: Float64[Tensor, "3 3"]

    def directions(self, pitch: Float64[Tensor, " n"], roll: Float64[Tensor, " n"]) -> Float64[Tensor, "n 3"]:
        """The direction that is up if the cameras look up by `pitch` and are turned by `roll` in the mean [degrees]."""
        up, right, forward = self.base
        pitch, roll = torch.deg2rad(pitch)[:, None], torch.deg2rad(roll)[:, None]
        return torch.cos(roll) * (torch.cos(pitch) * up + torch.sin(pitch) * forward) + torch.sin(roll) * right

    def score(self, pitch: Float64[Tensor, " n"], roll: Float64[Tensor, " n"], one: Round) -> Float64[Tensor, " n"]:
        """The weighted log likelihood of directions, against that of directions that nothing depends on. Some directions at a time, since
        each is compared with all lines and surfaces."""
        parts = zip(pitch.split(DIRECTIONS), roll.split(DIRECTIONS), strict=True)
        return torch.cat([self._score(*part, one) for part in parts])

    def _score(self, pitch: Float64[Tensor, " n"], roll: Float64[Tensor, " n"], one: Round) -> Float64[Tensor, " n"]:
        ups = self.directions(pitch, roll)
        mean, deviation = PITCH
        total = -one.pitch * ((pitch - mean) / deviation) ** 2
        total = total - ROLLS * (self.rights @ ups.T).square().mean(0) / sin(radians(ROLL)) ** 2
        if len(self.lines):
            lengths = self.lines.norm(dim=-1, keepdim=True)
            upright = _orthogonal(self.lines / lengths @ ups.T, one.line)
            likelihood = 1 - UPRIGHT_LINES + UPRIGHT_LINES * upright
            total = total + (lengths * likelihood.log()).sum(0) / lengths.sum()
        if len(self.surfaces):
            along = self.surfaces @ ups.T
            level = _parallel(along, one.surface) * self.may_be_level[:, None]
            standing = _orthogonal(along, one.surface) * self.may_be_upright[:, None]
            rest = 1 - LEVEL_SURFACES - UPRIGHT_SURFACES
            likelihood = rest + LEVEL_SURFACES * level + UPRIGHT_SURFACES * standing
            total = total + one.surfaces * likelihood.log().mean(0)
        return total

    def confirm(self, up: Float64[Tensor, " 3"]) -> bool:
        """Whether surfaces confirm a direction: most of them are level or upright, or the floor is level."""
        if not len(self.surfaces):
            return False
        along = self.surfaces @ up
        if _level_or_upright(along) >= MOSTLY_FITS:
            return True
        floor = ~self.may_be_upright
        if floor.double().mean() < FLOOR_PART:
            return False
        return bool((along[floor].abs() > cos(radians(15))).double().mean() >= LEVEL_FLOOR)

    def fit(self, up: Float64[Tensor, " 3"]) -> str:
        """How much fits a direction, for the user."""
        parts = []
        if len(self.lines):
            lengths = self.lines.norm(dim=-1)
            upright = (self.lines / lengths[:, None] @ up).abs() < sin(radians(2))
            parts.append(f"{(lengths * upright).sum() / lengths.sum():.0%} of the lines are upright")
        if len(self.surfaces):
            parts.append(f"{_level_or_upright(self.surfaces @ up):.0%} of the surfaces are level or upright")
        return ", ".join(parts)


def _level_or_upright(cosines: Float64[Tensor, " s"]) -> float:
    """The share of surfaces that are within 15 degrees of level or upright, by the cosines between their normals and up."""
    along = cosines.abs()
    return float(((along > cos(radians(15))) | (along < sin(radians(15)))).double().mean())


def _orthogonal(cosines: Float64[Tensor, "*n"], degrees: float) -> Float64[Tensor, "*n"]:
    """Density of the cosine between two directions that are orthogonal to some degrees, against that of any directions."""
    deviation = sin(radians(degrees))
    return torch.exp(-0.5 * (cosines / deviation) ** 2) / (deviation * sqrt(pi / 2))


def _parallel(cosines: Float64[Tensor, "*n"], degrees: float) -> Float64[Tensor, "*n"]:
    """The same of two directions that are parallel, whatever their signs."""
    deviation = sin(radians(degrees))
    return torch.exp(-0.5 * (1 - cosines**2) / deviation**2) / deviation**2


def upright(scene: SavedScene, axes: Axes, up: Up | UpDirection = "auto", floor: float | None = None) -> FramedScene:
    """The scene in the frame of a file for viewers: turned upright, with the middle of its Gaussians at the origin.

    Args:
        scene: in its own frame.
        axes: the direction that is up in the file.
        up: the direction that is up in the scene.
        floor: the height of its floor along that direction, which is at 0 in the file; None centres the height, too.
    """
    found = up_of(scene, up)
    forward = scene.cameras.world_from_camera[0, :3, 2]
    level = forward - (forward @ found.direction) * found.direction
    if level.norm() < 1e-6:  # it looks straight down or up
        level = -scene.cameras.world_from_camera[0, :3, 1]
        level = level - (level @ found.direction) * found.direction
    forward = _unit(level)
    left = torch.linalg.cross(found.direction, forward)
    rows = {
        "-y": (-left, -found.direction, forward),
        "y": (-left, found.direction, -forward),
        "z": (forward, left, found.direction),
    }[axes]
    turned = torch.eye(4, dtype=torch.float64)
    turned[:3, :3] = torch.stack(rows)
    turned[:3, 3] = -(scene.gaussians.means.double() @ turned[:3, :3].T).median(0).values
    if floor is not None:
        turned[:3, 3] += turned[:3, :3] @ found.direction * (-floor - turned[:3, 3] @ turned[:3, :3] @ found.direction)
    moved = replace(
        scene,
        gaussians=move_gaussians(turned, scene.gaussians),
        cameras=move_cameras(turned, scene.cameras),
        applied_transform=None,
        applied_scale=None,
        origin=(0.0, 0.0, 0.0),
    )
    return FramedScene(moved, turned @ _to_origin(scene), axes)


def in_own_frame(scene: SavedScene) -> FramedScene:
    """The scene in its own frame, relative to its origin."""
    return FramedScene(scene, _to_origin(scene), None)


def _to_origin(scene: SavedScene) -> Float64[Tensor, "4 4"]:
    """From the coordinates of the source's poses to those of the scene's Gaussians."""
    moved = torch.eye(4, dtype=torch.float64)
    moved[:3, 3] = -torch.tensor(scene.origin, dtype=torch.float64)
    return moved


def _cues(scene: SavedScene) -> Cues:
    """What says which way is up in a scene."""
    poses = scene.cameras.world_from_camera
    up = _mean_direction(-poses[:, :3, 1])
    rights = poses[:, :3, 0]
    right = _mean_direction(rights - (rights @ up)[:, None] * up)
    normals, may_be_level, may_be_upright = _surfaces(scene)
    return Cues(
        lines=lines(scene),
        surfaces=normals[::EVERY],
        may_be_level=may_be_level[::EVERY],
        may_be_upright=may_be_upright[::EVERY],
        rights=poses[:, :3, 0],
        base=torch.stack((up, right, torch.linalg.cross(up, right))),
    )


def _surfaces(scene: SavedScene) -> tuple[Float64[Tensor, "n 3"], Bool[Tensor, " n"], Bool[Tensor, " n"]]:
    """The normals of the surfaces in every input view; whether each may be level, which walls are not, and upright, which floors are not."""
    gaussians, points = scene.gaussians, own_points(scene).movedim(-1, 1)
    points = torch.nn.functional.avg_pool2d(points, 3, 1, 1, count_include_pad=False)
    inner = slice(STEP, -STEP)
    down = points[..., 2 * STEP :, inner] - points[..., : -2 * STEP, inner]
    right = points[..., inner, 2 * STEP :] - points[..., inner, : -2 * STEP]
    normals = torch.linalg.cross(right, down, dim=1)
    lengths = normals.norm(dim=1)
    clear = lengths > 0
    normals = (normals / lengths[:, None].clamp(min=1e-30)).movedim(1, -1)[clear]
    wall = floor = torch.zeros(len(normals), dtype=torch.bool)
    if gaussians.semantic is not None and scene.classes is not None:
        labels = own_labels(scene)[:, inner, inner][clear]
        wall, floor = (
            labels == scene.classes.names.index(name) if name in scene.classes.names else wall
            for name in ("wall", "floor")
        )
    return normals, ~wall, ~floor


def _mean_direction(vectors: Float64[Tensor, "v 3"]) -> Float64[Tensor, " 3"]:
    """The mean of directions at unit length; if they cancel, as of cameras at the front and the back of a robot, the longest of them."""
    mean = vectors.mean(0)
    return _unit(mean if mean.norm() > LEAST_MEAN else vectors[vectors.norm(dim=-1).argmax()])


def _unit(vector: Float64[Tensor, " 3"]) -> Float64[Tensor, " 3"]:
    """A vector at unit length."""
    return vector / vector.norm()


def _tensor(numbers: Sequence[float]) -> Float64[Tensor, " n"]:
    """Numbers as float64."""
    return torch.tensor(numbers, dtype=torch.float64)

"""Which way is up in a scene, and the frames that viewers expect.

Files of poses rarely say which way is up, and the mean of the cameras' own up directions is tilted by the pitch that they have in common. What does say it
is the scene: floors, tables and ceilings are level, and walls are upright. Starting from the mean of the cameras, `up_of` finds the direction that is parallel or
orthogonal to as many surfaces as possible, as Gupta, Arbelaez and Malik do ("Perceptual organization and recognition of indoor scenes from RGB-D images", CVPR 2013), and orthogonal to
the cameras' x axes, because people and robots hold cameras level.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, radians, sin
from typing import Literal

import torch
from jaxtyping import Bool, Float64
from torch import Tensor

from semgs.export.scene import SavedScene
from semgs.geometry.cameras import inverse_rigid
from semgs.geometry.rigid import cameras_in, gaussians_in
from semgs.model.encoding import block_size

Up = Literal["auto", "x", "y", "z", "-x", "-y", "-z"]
"""The direction that is up in a scene's frame; "auto" finds it."""

Axes = Literal["-y", "y", "z"]
"""The direction that is up in a file. "-y": x right, z forward, as for 3DGS PLY; "y": x right, z backward (glTF); "z": x forward, y left (ROS, REP 103).
Forward is where the first input view looks."""

ROUNDS = ((45.0, 5), (15.0, 10))
"""In each round, surfaces within this angle of level or upright count [degrees]; how many rounds."""

CAMERAS = 0.2
"""Weight of the cameras' x axes against all surfaces."""

STEP = 2
"""Normals come from differences over this many Gaussians to both sides."""

FEWEST = 0.4
"""If less than this share of the surfaces is level or upright in the end, the direction is uncertain. It is 0.29 for random surfaces."""


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


def up_of(scene: SavedScene, up: Up = "auto") -> UpDirection:
    """The direction that is up in a scene."""
    if up != "auto":
        direction = torch.zeros(3, dtype=torch.float64)
        direction["xyz".index(up[-1])] = -1 if up[0] == "-" else 1
        return UpDirection(direction, "as given")
    poses = scene.cameras.world_from_camera
    found = _unit(-poses[:, :3, 1].sum(0))
    rights = poses[:, :3, 0]
    normals, may_be_level, may_be_upright = _surfaces(scene)
    if not len(normals):
        return UpDirection(found, "the mean of the input views, which may be tilted", certain=False)
    for degrees, rounds in ROUNDS:
        for _ in range(rounds):
            level, standing = _counted(normals, found, degrees)
            level, standing = normals[level & may_be_level], normals[standing & may_be_upright]
            cost = (standing.T @ standing - level.T @ level) / len(normals) + CAMERAS * rights.T @ rights / len(rights)
            axis = torch.linalg.eigh(cost).eigenvectors[:, 0]
            found = axis if axis @ found >= 0 else -axis
    level, standing = _counted(normals, found, ROUNDS[-1][0])
    share = (level | standing).double().mean().item()
    return UpDirection(found, f"{share:.0%} of the surfaces are level or upright", certain=share >= FEWEST)


def upright(scene: SavedScene, axes: Axes, up: Up | UpDirection = "auto") -> FramedScene:
    """The scene in the frame of a file for viewers: turned upright, with the middle of its Gaussians at the origin.

    Args:
        scene: in its own frame.
        axes: the direction that is up in the file.
        up: the direction that is up in the scene.
    """
    found = up if isinstance(up, UpDirection) else up_of(scene, up)
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
    middle = scene.gaussians.means.double().median(0).values
    turned[:3, 3] = -turned[:3, :3] @ middle
    moved = replace(
        scene,
        gaussians=gaussians_in(turned, scene.gaussians),
        cameras=cameras_in(turned, scene.cameras),
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


def _surfaces(scene: SavedScene) -> tuple[Float64[Tensor, "n 3"], Bool[Tensor, " n"], Bool[Tensor, " n"]]:
    """The normals of the surfaces in every input view; whether each may be level, which walls are not, and upright, which floors are not."""
    gaussians, size, views = scene.gaussians, scene.cameras.size, len(scene.frames)
    stride = block_size(len(gaussians), views, *size)
    grid = (views, *(-(-side // stride) for side in size))
    points = gaussians.means.double().reshape(*grid, 3).movedim(-1, 1)
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
        labels = gaussians.semantic.features.argmax(-1).reshape(grid)[:, inner, inner][clear]
        wall, floor = (
            labels == scene.classes.names.index(name) if name in scene.classes.names else wall
            for name in ("wall", "floor")
        )
    return normals, ~wall, ~floor


def _counted(
    normals: Float64[Tensor, "n 3"], up: Float64[Tensor, " 3"], degrees: float
) -> tuple[Bool[Tensor, " n"], Bool[Tensor, " n"]]:
    """Which surfaces are within an angle of level, and of upright."""
    along = (normals @ up).abs()
    return along > cos(radians(degrees)), along < sin(radians(degrees))


def _unit(vector: Float64[Tensor, " 3"]) -> Float64[Tensor, " 3"]:
    """A vector at unit length."""
    return vector / vector.norm()

"""Cameras for a splat that comes without any: around an object, or inside a room."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin, tan

import torch
from jaxtyping import Float64
from torch import Tensor

from semgs.geometry.camera_paths import orbit
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Gaussians
from semgs.rendering.render import render
from semgs.splats.splat_scene import without_harmonics

COUNT = 8
"""Cameras on the circle."""

SIZE = (480, 640)
"""Of their images [px]."""

FIELD = 60.0
"""Vertical field of view [degrees]."""

ELEVATION = 20.0
"""How far a camera outside looks down [degrees]."""

LOW, HIGH = 0.05, 0.95
"""Quantiles of the positions between which a splat is: floaters are outside."""

EXTENT = 0.8
"""The share of Gaussians, by opacity, that a camera outside has to see."""

SAMPLED = 200_000
"""Gaussians from which quantiles are taken."""

ENCLOSED = 0.9
"""Seen from its middle, a room covers at least this share of each side, up and down excepted."""

FREE = 0.3
"""Seen from its middle, half of a room is further away than this share of its extent."""

PROBE = 64
"""Side of the images that look from the middle to the sides [px]."""


@dataclass(frozen=True)
class Surround:
    """A circle of cameras.

    Attributes:
        cameras: on it [v].
        pivot: its middle.
        inside: whether the cameras look outward from there.
    """

    cameras: Cameras
    pivot: Float64[Tensor, " 3"]
    inside: bool


def cameras_around(gaussians: Gaussians, up: Float64[Tensor, " 3"], size: tuple[int, int] = SIZE) -> Surround:
    """A circle of cameras around a splat, or in its middle if that is the middle of a room.

    It is a room if there are Gaussians on all four sides of its middle, and most are not near it. A hollow object that is closed looks the same.

    Args:
        gaussians: of one scene.
        up: the direction that is up, of unit length.
        size: (height, width) of their images [px].
    """
    step = -(-len(gaussians) // SAMPLED)
    means = gaussians.means[::step].double()
    weights = gaussians.opacities[::step].double().clamp(min=1e-6)
    low, middle, high = (
        torch.stack([_quantile(axis, weights, share) for axis in means.T]) for share in (LOW, 0.5, HIGH)
    )
    centre = (low + high) / 2
    distances = (means - centre).norm(dim=-1)
    extent = max(float(_quantile(distances, weights, EXTENT)), 1e-6)
    if _is_room(gaussians, centre, up, FREE * extent):
        return Surround(_circle(centre, up, 0.0, 0.0, FIELD, size, COUNT), centre, inside=True)
    extent = max(float(_quantile((means - middle).norm(dim=-1), weights, EXTENT)), 1e-6)
    away = extent / sin(radians(FIELD / 2))
    return Surround(_circle(middle, up, away, ELEVATION, FIELD, size, COUNT), middle, inside=False)


def _is_room(gaussians: Gaussians, centre: Float64[Tensor, " 3"], up: Float64[Tensor, " 3"], free: float) -> bool:
    """Whether there is something on all four sides of a point, half of it further away than `free`."""
    gaussians = without_harmonics(gaussians)
    cameras, depths = _circle(centre, up, 0.0, 0.0, 90.0, (PROBE, PROBE), 4), []
    for view in range(4):
        rendering = render(gaussians, cameras[view : view + 1], near=free / 10)
        if float(rendering.alphas.mean()) < ENCLOSED:
            return False
        depths.append(rendering.depths)
    return float(torch.cat(depths).median()) > free


def _circle(
    middle: Float64[Tensor, " 3"],
    up: Float64[Tensor, " 3"],
    away: float,
    elevation: float,
    field: float,
    size: tuple[int, int],
    count: int,
) -> Cameras:
    """Cameras that look at the middle from some distance, down by `elevation`, or from the middle outward.

    Angles are in degrees; `field` is the vertical field of view.
    """
    level = torch.eye(3, dtype=torch.float64)[int(up.abs().argmin())]
    level = torch.nn.functional.normalize(level - (level @ up) * up, dim=0)
    forward = cos(radians(elevation)) * level - sin(radians(elevation)) * up
    right = torch.linalg.cross(level, up)
    pose = torch.eye(4, dtype=torch.float64)
    pose[:3, :3] = torch.stack((right, torch.linalg.cross(forward, right), forward), dim=1)
    pose[:3, 3] = middle - away * forward
    height, width = size
    focal = height / (2 * tan(radians(field / 2)))
    intrinsics = torch.tensor([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]], dtype=torch.float64)
    return orbit(Cameras(pose, intrinsics, size), middle, up, 360.0, count)


def _quantile(values: Float64[Tensor, " n"], weights: Float64[Tensor, " n"], share: float) -> Float64[Tensor, ""]:
    """The quantile of weighted values."""
    values, order = values.sort()
    total = weights[order].cumsum(0)
    return values[int(torch.searchsorted(total, share * total[-1]).clamp(max=len(values) - 1))]

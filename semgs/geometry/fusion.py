"""Fusion: what several input views say about the class of one surface point becomes one answer.

Every pixel of an input view is a point at the network's depth. The point is projected into each other input view; that view's answer counts as far as
its depth agrees there, where the network's own uncertainty says what agreement is. Answers are pooled as a weighted mean of log probabilities.
"""

from __future__ import annotations

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from semgs.geometry.cameras import Cameras, back_project, project

LEAST = 1e-3
"""Added to every probability: one view that is sure of something else does not veto the others."""

SPREAD = 0.02
"""Added to the uncertainty of log depth of both views: pixels are sampled, and surfaces slant."""

TOLERANCE = 2.0
"""A view counts if log depths differ by no more than this many standard deviations."""


def fuse_classes(
    probabilities: Float[Tensor, "v class h w"],
    depths: Float[Tensor, "v h w"],
    spread: Float[Tensor, "v h w"],
    cameras: Cameras,
) -> Float[Tensor, "v class h w"]:
    """The class distribution of every pixel of every view, given what all views say about its point.

    Args:
        probabilities: what each view says by itself; sums to 1 over classes.
        depths: z-depth of every pixel [m].
        spread: standard deviation of log depth of every pixel.
        cameras: of the views [v], at the size of the maps.

    Raises:
        ValueError: the maps are not of the cameras' size.
    """
    return pool_views((probabilities + LEAST).log(), depths, spread, cameras).softmax(1)


def depth_deviation(
    depths: Float[Tensor, "*n"],
    seen: Float[Tensor, "*n"],
    spread: Float[Tensor, "*n"],
    spread_seen: Float[Tensor, "*n"],
) -> Float[Tensor, "*n"]:
    """By how many standard deviations the log depths of points differ from what a view sees in their places; negative in front of it.

    Args:
        depths: z-depth of the points in that view [m].
        seen: z-depth that the view sees there [m].
        spread, spread_seen: standard deviations of the log depth of both.
    """
    sigma = (spread.square() + spread_seen.square()).sqrt() + SPREAD
    return (depths / seen).log() / sigma


def see_again(
    points: Float[Tensor, "n 3"],
    spread: Float[Tensor, " n"],
    seen: Float[Tensor, "h w"],
    spread_seen: Float[Tensor, "h w"],
    camera: Cameras,
) -> tuple[Bool[Tensor, " n"], Int64[Tensor, " n"]]:
    """Whether a view sees points, as far as depths agree, and the pixels that they fall into, counted row by row; 0 outside.

    Args:
        points: to be seen.
        spread: standard deviation of the log depth of each.
        seen, spread_seen: z-depth of every pixel of the view, and standard deviation of its log.
        camera: of the view.
    """
    height, width = camera.size
    x, y, z = project(points, camera).unbind(-1)
    inside = (z > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    place = y.clamp(0, height - 1).long() * width + x.clamp(0, width - 1).long()
    place = torch.where(inside, place, 0)
    apart = depth_deviation(z.clamp(min=1e-6), seen.flatten()[place], spread, spread_seen.flatten()[place])
    return inside & (apart.abs() <= TOLERANCE), place


def pool_views(
    values: Float[Tensor, "v c h w"],
    depths: Float[Tensor, "v h w"],
    spread: Float[Tensor, "v h w"],
    cameras: Cameras,
) -> Float[Tensor, "v c h w"]:
    """For every pixel of every view, the mean of the values that the views have at its point.

    Args:
        values: of each pixel.
        depths, spread, cameras: as for `fuse_classes`.
    """
    count, (height, width) = len(depths), cameras.size
    points = back_project(depths, cameras).flatten(1, 2)
    rows = []
    for one in range(count):
        total, weight = values[one].flatten(1), torch.ones(height * width).to(values)
        for other in range(count):
            if other == one:
                continue
            agrees, place = see_again(points[one], spread[one].flatten(), depths[other], spread[other], cameras[other])
            vote = agrees.to(values)
            total = total + vote * values[other].flatten(1)[:, place]
            weight = weight + vote
        rows.append((total / weight.clamp(min=1e-12)).unflatten(1, (height, width)))
    return torch.stack(rows)

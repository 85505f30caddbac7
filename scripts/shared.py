"""What several scripts use: Markdown tables, and the pixels in which other views see the same surface."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import torch
from jaxtyping import Bool, Float64, Int64
from torch import Tensor

from semgs.data.views import Views
from semgs.geometry.cameras import back_project, project


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


def pixels_that_see(
    points: Float64[Tensor, "n 3"], views: Views, index: int, tolerance: float
) -> tuple[Bool[Tensor, " n"], Int64[Tensor, " n"]]:
    """Whether a view sees each point, and in which pixel, counted row by row; 0 outside of the image.

    Args:
        points: in the world [m].
        views: with true depth.
        index: of the view.
        tolerance: a point is seen if the true depth of its pixel is that of the point to this fraction.
    """
    x, y, z = project(points, views.cameras[index]).unbind(-1)
    height, width = views.size
    inside = (z > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    pixels = torch.where(inside, y.clamp(0, height - 1).long() * width + x.clamp(0, width - 1).long(), 0)
    assert views.depths is not None
    return inside & ((views.depths[index].flatten()[pixels] / z - 1).abs() < tolerance), pixels


def share_of_same_class(labels: Tensor, views: Views, pairs: Iterable[tuple[int, int]], tolerance: float) -> float:
    """Of the points that both views of a pair see at the same true depth, the share with the same class in both; NaN if there are none.

    Args:
        labels: of each view [v h w].
        views: with true depth.
        pairs: of positions among the views.
        tolerance: as for `pixels_that_see`.
    """
    assert views.depths is not None
    points = back_project(views.depths.double(), views.cameras).flatten(1, 2)
    same = total = 0
    for first, second in pairs:
        seen, pixels = pixels_that_see(points[first], views, second, tolerance)
        seen &= views.depths[first].flatten() > 0
        same += int((labels[first].flatten()[seen] == labels[second].flatten()[pixels[seen]]).sum())
        total += int(seen.sum())
    return same / total if total else float("nan")

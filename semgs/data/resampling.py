"""Views at other sizes: resized, cropped, or both. Images, maps and cameras change together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import torch
from jaxtyping import Float64
from torch import Tensor

from semgs.data.views import Views
from semgs.geometry.cameras import checked_size

DEFAULT_PIXELS = 76_800
"""Images are reduced to at most this many pixels (240 x 320), unless the user gives a size."""

Fit = Literal["crop", "stretch"]
"""How images get another aspect: cropped around the centre (`reframed`), or stretched (`resized`)."""

STRETCH = 0.01
"""Images whose aspect differs by no more than this are stretched instead of cropped."""


def resized(views: Views, size: Sequence[int]) -> Views:
    """The same views at another size: images, labels, depths and cameras together. The aspect may change.

    Along an axis that shrinks, a new pixel is the mean of the area it covers, for any ratio. Along an axis that grows, it is interpolated
    linearly between pixel centres. Labels and depths are never interpolated: each comes from the pixel that its new centre lies in
    (`cv2.INTER_NEAREST` takes the one at its new corner instead). A pixel is hidden if a hidden one takes part in its colour.

    Args:
        views: with any leading axes.
        size: the new (height, width) [px].

    Raises:
        ValueError: the size is not two positive integers.
    """
    height, width = new_size = checked_size(size)
    if new_size == views.size:
        return views
    stretch = torch.diag(torch.tensor([width / views.size[1], height / views.size[0], 1.0], dtype=torch.float64))
    rows, columns = (resampling(old, new).to(views.images) for old, new in zip(views.size, new_size, strict=True))
    return views.map(
        lambda maps: nearest(maps, new_size),
        images=lambda images: (rows @ images @ columns.mT).clamp(0, 1),
        cameras=views.cameras.adjusted(stretch, new_size),
        hidden=lambda hidden: rows @ hidden.to(rows) @ columns.mT > 0,
    )


def cropped(views: Views, top: int, left: int, size: Sequence[int]) -> Views:
    """A window of the views: images, labels, depths and cameras (cx and cy move) together.

    Args:
        views: with any leading axes.
        top: rows to remove at the top.
        left: columns to remove at the left.
        size: (height, width) of the window [px].

    Raises:
        ValueError: the window is empty or extends beyond the images.
    """
    height, width = size
    if (height, width) == views.size and top == left == 0:
        return views
    if not (0 <= top < top + height <= views.size[0] and 0 <= left < left + width <= views.size[1]):
        raise ValueError(
            f"the window has rows {top}..{top + height} and columns {left}..{left + width}; "
            f"expected a part of images of {views.size} (height, width)"
        )
    window = (..., slice(top, top + height), slice(left, left + width))
    shift = torch.eye(3, dtype=torch.float64)
    shift[0, 2], shift[1, 2] = -left, -top
    return views.map(lambda maps: maps[window], cameras=views.cameras.adjusted(shift, (height, width)))


def reframed(views: Views, size: Sequence[int]) -> Views:
    """The views at another size without stretching: cropped to its aspect around the centre, then resized.

    Args:
        views: with any leading axes.
        size: the new (height, width) [px].

    Raises:
        ValueError: the size is not two positive integers.
    """
    size = checked_size(size)
    top, left, *kept = kept_window(views.size, size)
    return resized(cropped(views, top, left, kept), size)


def nearest(maps: Tensor, size: tuple[int, int]) -> Tensor:
    """Maps [... h w] at another size, without interpolation: each pixel takes the value of the pixel that its centre lies in."""
    row, column = (
        ((2 * torch.arange(new) + 1) * old // (2 * new)).to(maps.device)
        for old, new in zip(maps.shape[-2:], size, strict=True)
    )
    return maps.index_select(-2, row).index_select(-1, column)


def kept_window(old: tuple[int, int], size: tuple[int, int], fit: Fit = "crop") -> tuple[int, int, int, int]:
    """The central part that stays: rows removed at the top, columns removed at the left, height and width [px]; everything if stretched."""
    rows, columns = kept_size(old, size) if fit == "crop" else old
    return (old[0] - rows) // 2, (old[1] - columns) // 2, rows, columns


def kept_size(old: tuple[int, int], size: tuple[int, int]) -> tuple[int, int]:
    """(height, width) of the part that `reframed` keeps: everything if the aspects differ by no more than `STRETCH` [px]."""
    (rows, columns), (height, width) = old, size
    if abs(rows * width / (columns * height) - 1) <= STRETCH:
        return old
    return max(1, min(rows, round(columns * height / width))), max(1, min(columns, round(rows * width / height)))


def default_size(size: Sequence[int]) -> tuple[int, int]:
    """The default size at which images of `size` are read.

    Images are reduced, never enlarged, to at most `DEFAULT_PIXELS` with about the same aspect. Sides are rounded to multiples of 16, which
    the networks need no padding for; a side shorter than 16 is unchanged.

    Args:
        size: (height, width) of the images [px].
    """
    scale = min(1.0, (DEFAULT_PIXELS / (size[0] * size[1])) ** 0.5)
    wanted = [side * scale / 16 for side in size]
    most = DEFAULT_PIXELS // 256
    units = [max(1, min(round(want), side // 16, most)) for want, side in zip(wanted, size, strict=True)]
    while units[0] * units[1] > most:  # shorten the side that rounding lengthened most, if it can be
        longer = max((0, 1), key=lambda axis: (units[axis] > 1, units[axis] / wanted[axis]))
        units[longer] -= 1
    height, width = (min(16 * unit, side) for unit, side in zip(units, size, strict=True))
    return height, width


def resampling(old: int, new: int) -> Float64[Tensor, "new old"]:
    """The matrix that resamples an axis of `old` pixels to `new`: area means if it shrinks, linear interpolation if it grows."""
    pixels = torch.arange(old, dtype=torch.float64)
    if new <= old:
        edges = torch.arange(new + 1, dtype=torch.float64)[:, None] * (old / new)
        covered = torch.minimum(edges[1:], pixels + 1) - torch.maximum(edges[:-1], pixels)
        return covered.clamp(min=0) * (new / old)
    centres = ((torch.arange(new, dtype=torch.float64)[:, None] + 0.5) * (old / new) - 0.5).clamp(0, old - 1)
    return (1 - (centres - pixels).abs()).clamp(min=0)

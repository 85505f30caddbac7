"""How each tool resizes, crops and pads photos before its network sees them, and where a photo is in the processed image.

A position (x, y) of a photo, counted from the corner of its first pixel, is at (scale * x + shift) in the processed image, along each axis. So a camera of the
processed image becomes that of the photo by undoing both: focal / scale and (centre - shift) / scale.

Depth-Anything-3 (utils/io/input_processor.py), vggt (utils/load_fn.py), map-anything (utils/image.py, utils/cropping.py), dust3r (utils/image.py).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from semgs.data.cameras.lens import Lens

Size = tuple[int, int]
"""(height, width) [px]."""

DA3_SIDE, DA3_PATCH = 504, 14
VGGT_SIDE, VGGT_PATCH = 518, 14
DUST3R_SIDE, DUST3R_SMALL, DUST3R_PATCH = 512, 224, 16

SHORT_SIDES = {
    518: (518, 392, 336, 294, 252, 168),
    512: (512, 384, 336, 288, 256, 160),
    504: (504, 378, 322, 280, 238, 154),
}
"""MapAnything's sizes: of each longer side, the shorter ones. There is no upright form of the last."""


@dataclass(frozen=True)
class Placement:
    """Where a photo is in its processed image.

    Attributes:
        size: (height, width) of the photo [px].
        scale, shift: along x and y.
    """

    size: Size
    scale: tuple[float, float]
    shift: tuple[float, float]

    def lens(self, intrinsics: np.ndarray) -> Lens:
        """The camera of the photo.

        Args:
            intrinsics: K [3 3] of the processed image.

        Raises:
            ValueError: it is not a possible camera.
        """
        focal, centre = intrinsics.diagonal()[:2], intrinsics[:2, 2]
        (fx, fy), (cx, cy) = focal / self.scale, (centre - self.shift) / np.array(self.scale)
        return Lens(self.size, (float(fx), float(fy)), (float(cx), float(cy)))


@dataclass(frozen=True)
class Plan:
    """What a tool does with a set of photos.

    Attributes:
        size: (height, width) of all processed images [px].
        placements: of the photos, in order.
    """

    size: Size
    placements: tuple[Placement, ...]


def unchanged(sizes: Sequence[Size], processed: Size, padded: bool) -> Iterator[Plan]:
    """Nothing is done."""
    yield _plan(sizes, sizes, sizes[0])


def depth_anything(sizes: Sequence[Size], processed: Size, padded: bool) -> Iterator[Plan]:
    """The longer side becomes 504 pixels (`process_res`), then both sides are rounded, or cropped, to multiples of 14. Photos that differ in size are
    cropped in the middle to the smallest."""
    near = sorted(range(1 - DA3_PATCH, DA3_PATCH), key=abs)
    sides = [(DA3_SIDE, max), *((bound(processed) + step, bound) for step in near for bound in (max, min))]
    for side, bound in sides:
        if side < DA3_PATCH:
            continue
        scales = [side / bound(size) for size in sizes]
        first = [
            (max(1, round(rows * scale)), max(1, round(columns * scale)))
            for (rows, columns), scale in zip(sizes, scales, strict=True)
        ]
        for crops in (False, True):
            to_patches = _down if crops else _nearest
            second = [(max(1, to_patches(rows)), max(1, to_patches(columns))) for rows, columns in first]
            smallest = min(rows for rows, _ in second), min(columns for _, columns in second)
            yield _plan(sizes, first if crops else second, smallest, second)


def vggt(sizes: Sequence[Size], processed: Size, padded: bool) -> Iterator[Plan]:
    """`crop`: the width becomes 518 pixels, the height a multiple of 14, of which at most the middle 518 are kept. `pad`: the longer side becomes 518
    pixels, and white makes it a square. Photos that differ in size are padded to the largest."""
    for pads in (padded, not padded):
        resized = []
        for rows, columns in sizes:
            if pads and rows > columns:
                resized.append((VGGT_SIDE, round(columns * (VGGT_SIDE / rows) / VGGT_PATCH) * VGGT_PATCH))
            else:
                resized.append((round(rows * (VGGT_SIDE / columns) / VGGT_PATCH) * VGGT_PATCH, VGGT_SIDE))
        cropped = [(min(rows, VGGT_SIDE), columns) for rows, columns in resized]
        largest = max(rows for rows, _ in cropped), max(columns for _, columns in cropped)
        yield _plan(sizes, resized, (VGGT_SIDE, VGGT_SIDE) if pads else largest, cropped)


def map_anything(sizes: Sequence[Size], processed: Size, padded: bool) -> Iterator[Plan]:
    """The size among ten whose aspect is nearest to the mean one of the photos; each photo is resized to cover it, and cropped in the middle."""
    aspect = sum(columns / rows for rows, columns in sizes) / len(sizes)
    longer = max(processed)
    steps = longer // VGGT_PATCH
    targets = [_nearest_aspect(side, aspect) for side in SHORT_SIDES]
    if aspect >= 1:
        targets.append((round(steps / aspect) * VGGT_PATCH, longer))  # resize_mode "longest_side"
    else:
        targets.append((longer, round(steps * aspect) * VGGT_PATCH))
    targets.append((steps * VGGT_PATCH, steps * VGGT_PATCH))  # "square"
    for target in targets:
        if min(target) < 1:
            continue
        covering = []
        for rows, columns in sizes:
            scale = max(target[0] / rows, target[1] / columns) + 1e-8
            covering.append((int(rows * scale), int(columns * scale)))
        yield _plan(sizes, covering, target)


def dust3r(sizes: Sequence[Size], processed: Size, padded: bool) -> Iterator[Plan]:
    """The longer side becomes 512 pixels, and the middle is kept, with multiples of 16; a square becomes 4:3. Or the shorter side becomes 224 pixels, and
    the middle square is kept."""
    for side in (DUST3R_SIDE, DUST3R_SMALL):
        for squares in (False, True):
            resized, kept = [], []
            for size in sizes:
                long_edge = side if side == DUST3R_SIDE else round(side * max(size) / min(size))
                rows, columns = (round(one * long_edge / max(size)) for one in size)
                half = [2 * (one // 2) // DUST3R_PATCH * (DUST3R_PATCH // 2) for one in (rows, columns)]
                if side == DUST3R_SMALL:
                    half = [min(rows // 2, columns // 2)] * 2
                elif rows == columns and not squares:
                    half[0] = 3 * half[1] // 4
                resized.append((rows, columns))
                kept.append((2 * half[0], 2 * half[1]))
            # It crops around side // 2: an odd side loses its last pixel first.
            even = [(2 * (rows // 2), 2 * (columns // 2)) for rows, columns in resized]
            yield _plan(sizes, resized, kept[0], kept, even)


def _plan(
    sizes: Sequence[Size],
    resized: Sequence[Size],
    target: Size,
    kept: Sequence[Size] | None = None,
    around: Sequence[Size] | None = None,
) -> Plan:
    """Photos that are resized, then cropped or padded in the middle.

    Args:
        sizes: of the photos.
        resized: of each before it is cropped.
        target: of all processed images.
        kept: of each after its own crop, before all become `target`; None for one crop from `resized` to `target`.
        around: of each, the area whose middle is kept; None for all of `resized`.
    """
    placements = []
    for index, size in enumerate(sizes):
        own = target if kept is None else kept[index]
        area = resized[index] if around is None else around[index]
        offsets = [-((area[axis] - own[axis]) // 2) + _middle(target[axis] - own[axis]) for axis in (1, 0)]
        scales = [resized[index][axis] / size[axis] for axis in (1, 0)]
        placements.append(Placement(size, (scales[0], scales[1]), (float(offsets[0]), float(offsets[1]))))
    return Plan(target, tuple(placements))


def _middle(more: int) -> int:
    """The offset in the middle: positive to pad, negative to crop."""
    return more // 2 if more >= 0 else -(-more // 2)


def _nearest(side: int) -> int:
    """The nearest multiple of 14, the larger of two."""
    down = side // DA3_PATCH * DA3_PATCH
    return down + DA3_PATCH if down + DA3_PATCH - side <= side - down else down


def _down(side: int) -> int:
    """The multiple of 14 that is not larger."""
    return side // DA3_PATCH * DA3_PATCH


def _nearest_aspect(side: int, aspect: float) -> Size:
    """The size of a set with the nearest aspect; the set has aspects with three decimals."""
    wide = [(short, side) for short in SHORT_SIDES[side]]
    upright = [(side, short) for short in SHORT_SIDES[side][1:-1]]
    return min([*wide, *upright], key=lambda size: abs(round(size[1] / size[0], 3) - aspect))

"""Image textures: which texel a point of a part has, and its colour, filtered to the width of a pixel."""

from __future__ import annotations

import math

from semgs.files.images.colours import LINEAR
from semgs.runtime.jit import njit
from semgs_rooms.pieces.texture_kernels import ASPECT, AXIS, AZIMUTH, COLOUR_A, MAPPING, PICTURE_NUMBER, SCALE

TILED, STRETCHED, UNWRAPPED, PANORAMA, VIEW = range(5)
"""How an image is mapped: tiled on each face; stretched over a face; by the shell's texture coordinates; as a distant panorama
behind the part; as a distant view of limited angle, mirrored beyond it."""


@njit()
def picture(pixels, table, material, local, facing, size, direction, uv, foot, shift, out):
    """Write the linear RGB of a PICTURE material into `out` [3].

    Args:
        pixels: [n 3] and
        table: [p 4], the room's images (`semgs_rooms.assets.asset_images.Pack`).
        material: [24].
        local: the point in its part's frame [m] [3].
        facing: absolute values of the normal in that frame [3].
        size: the part's extents [m] [3].
        direction: of the ray, any length [3].
        uv: the shell's texture coordinates there, and the width of a pixel in them [3].
        foot: width of a pixel on the surface [m].
        shift: offset of the tiles, different for each part [m].
        out: [3].
    """
    number, mapping, scale, aspect = (
        int(material[PICTURE_NUMBER]),
        int(material[MAPPING]),
        material[SCALE],
        material[ASPECT],
    )
    repeat = True
    if mapping == UNWRAPPED:
        u, v, wide = uv[0], uv[1], uv[2]
    elif mapping in (PANORAMA, VIEW):
        flat = math.hypot(direction[0], direction[1])
        u = math.atan2(direction[1], direction[0]) / -scale + material[AZIMUTH]
        v = 0.5 - math.atan2(direction[2], flat) / (scale * aspect)
        if mapping == PANORAMA:
            edge = 0.5 / table[number, 2]
            v = min(max(v, edge), 1 - edge)
        wide = 0.003 / scale
        if mapping == VIEW:
            u, v = 1 - abs((u % 2) - 1), 1 - abs((v % 2) - 1)
            repeat = False
    else:
        across, up = face_axes(facing, size, int(material[AXIS]))
        if mapping == TILED:
            u, v, wide = (local[across] + shift) / scale, -(local[up] + 0.37 * shift) / (scale * aspect), foot / scale
        else:
            u, v, wide = 0.5 + local[across] / size[across], 0.5 - local[up] / size[up], foot / size[across]
            repeat = False
    lookup(pixels, table[number], u, v, wide, repeat, out)
    for k in range(3):
        out[k] = min(max(out[k] * material[COLOUR_A + k], 0.002), 0.98)


@njit()
def face_axes(facing, size, axis):
    """The part's axes along an image's rows and columns, on the face perpendicular to its largest `facing`.

    Columns are vertical on upright faces. Rows follow `axis` if it is in the face.
    """
    if facing[2] >= facing[0] and facing[2] >= facing[1]:
        across, up = (0, 1) if size[0] >= size[1] else (1, 0)
    elif facing[0] >= facing[1]:
        across, up = 1, 2
    else:
        across, up = 0, 2
    if axis == up:
        across, up = up, across
    return across, up


@njit()
def lookup(pixels, entry, u, v, wide, repeat, out):
    """Trilinear look-up in a mip map: linear RGB at (u, v).

    (0, 0) is the image's upper left corner, (1, 1) its lower right one. `wide` is the width of a pixel as a share of the image's
    width. Outside, the image repeats or its border continues.
    """
    start, width, height, levels = entry[0], entry[1], entry[2], entry[3]
    level = min(max(math.log2(max(wide * width, 1e-6)) - 0.5, 0.0), levels - 1.0)
    lower = int(level)
    share = level - lower
    for k in range(3):
        out[k] = 0.0
    for number in range(levels):
        if number > lower + 1:
            break
        if number >= lower:
            weight = (1 - share) if number == lower else share
            if weight > 0:
                _bilinear(pixels, start, width, height, u, v, repeat, weight, out)
        start += width * height
        width, height = max(1, width // 2), max(1, height // 2)


@njit()
def _bilinear(pixels, start, width, height, u, v, repeat, weight, out):
    if repeat:
        x, y = (u - math.floor(u)) * width - 0.5, (v - math.floor(v)) * height - 0.5
    else:
        x, y = min(max(u, 0.0), 1.0) * width - 0.5, min(max(v, 0.0), 1.0) * height - 0.5
    left, top = math.floor(x), math.floor(y)
    a, b = x - left, y - top
    for i in range(2):
        row = int(top) + i
        row = row % height if repeat else min(max(row, 0), height - 1)
        for j in range(2):
            column = int(left) + j
            column = column % width if repeat else min(max(column, 0), width - 1)
            part = weight * (b if i else 1 - b) * (a if j else 1 - a)
            place = start + row * width + column
            for k in range(3):
                out[k] += part * LINEAR[pixels[place, k]]

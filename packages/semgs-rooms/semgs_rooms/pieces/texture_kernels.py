"""Procedural textures, evaluated at one point of a surface; every pattern fades into its mean before it can alias.

A material is an array of `WIDTH` numbers, indexed by the constants below; colours are linear RGB. A point has 3D coordinates
(x, y, z) in its part's frame and 2D coordinates (u, v) on the face, v upwards on upright faces, all in metres. `foot` is the
width of a pixel on the surface [m].
"""

from __future__ import annotations

import math

import numpy as np

from semgs.runtime.jit import njit

WIDTH = 24
KIND = 0
COLOUR_A, COLOUR_B, COLOUR_C = 1, 4, 7
SCALE, ASPECT, DUTY = 10, 11, 12
"""Width of the pattern's cell [m], its height relative to that, and the share of the cell in colour A."""
SEED = 13
FINE, FINE_SCALE, BLOTCH, BLOTCH_SCALE = 14, 15, 16, 17
"""Relative strength and size [m] of fine grain, and of large blotches."""
EMISSION, GLOSS = 18, 19
AXIS = 20
"""The part's axis along which wood grain runs."""
VARIATION = 21
"""How much cells differ in brightness."""
TINT = 22
"""Strength of the colour noise (the rest is brightness noise)."""
MIRROR = 23
"""1 for mirrors. Nothing reads it, as mirrors are shown in their own colour, but the pinned floor plans contain it."""

PLAIN, STRIPES, CHECKER, TILES, WOOD, PLANKS, WEAVE, MARBLE, DOTS, BOOKS, LANDSCAPE, ABSTRACT, OUTDOOR, PICTURE = range(
    14
)


PICTURE_NUMBER, MAPPING, AZIMUTH = SEED, DUTY, COLOUR_C
"""For kind PICTURE (see `picture_kernels`): index of the room's image; how it is mapped; for views, the direction that faces the
x axis [share of the width]. Colour A multiplies the image, SCALE is the width of a tile [m] or of a view [rad], ASPECT its
height relative to that, AXIS the part's axis that its rows follow (-1: any)."""


@njit(inline="never")
def cell_hash(ix, iy, iz, seed):
    """A number in 0..1 for a cell of the integer lattice."""
    mixed = np.uint32(
        np.uint32(ix & 0xFFFFFFFF) * np.uint32(0x9E3779B1)
        ^ np.uint32(iy & 0xFFFFFFFF) * np.uint32(0x85EBCA77)
        ^ np.uint32(iz & 0xFFFFFFFF) * np.uint32(0xC2B2AE3D)
        ^ np.uint32(seed & 0xFFFFFFFF) * np.uint32(0x27D4EB2F)
    )
    mixed = np.uint32((mixed ^ (mixed >> np.uint32(15))) * np.uint32(0x2C1B3C6D))
    mixed = np.uint32((mixed ^ (mixed >> np.uint32(12))) * np.uint32(0x297A2D39))
    mixed = np.uint32(mixed ^ (mixed >> np.uint32(15)))
    return mixed * (1.0 / 4294967296.0)


@njit()
def value_noise(x, y, z, seed):
    """Smooth noise of unit cells in -1..1."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    ix, iy, iz = int(fx), int(fy), int(fz)
    x, y, z = x - fx, y - fy, z - fz
    x, y, z = x * x * (3 - 2 * x), y * y * (3 - 2 * y), z * z * (3 - 2 * z)
    low = (1 - y) * ((1 - x) * cell_hash(ix, iy, iz, seed) + x * cell_hash(ix + 1, iy, iz, seed)) + y * (
        (1 - x) * cell_hash(ix, iy + 1, iz, seed) + x * cell_hash(ix + 1, iy + 1, iz, seed)
    )
    high = (1 - y) * ((1 - x) * cell_hash(ix, iy, iz + 1, seed) + x * cell_hash(ix + 1, iy, iz + 1, seed)) + y * (
        (1 - x) * cell_hash(ix, iy + 1, iz + 1, seed) + x * cell_hash(ix + 1, iy + 1, iz + 1, seed)
    )
    return 2 * ((1 - z) * low + z * high) - 1


@njit()
def fade(cells):
    """Remaining contrast of a pattern if a pixel covers that many of its cells: 1 up to a quarter, 0 from three quarters."""
    t = (0.75 - cells) * 2
    return 0.0 if t <= 0 else (1.0 if t >= 1 else t * t * (3 - 2 * t))


@njit()
def layered_noise(x, y, z, foot, octaves, seed):
    """Octaves of value noise, each with half the size and 0.55 times the strength of the previous one, faded by `foot`."""
    total, strength = 0.0, 1.0
    for octave in range(octaves):
        left = fade(foot)
        if left == 0.0:
            break
        total += strength * left * value_noise(x, y, z, seed + octave)
        x, y, z, foot = 2.03 * x + 17.1, 2.03 * y + 31.7, 2.03 * z + 5.3, 2.03 * foot
        strength *= 0.55
    return total


@njit()
def filtered_band(position, duty, foot):
    """Mean over `foot` of a wave of period 1 that is 1 for the first `duty` of the period, else 0."""
    foot = max(foot, 1e-4)
    left, right = position - 0.5 * foot, position + 0.5 * foot
    a = math.floor(left) * duty + min(left - math.floor(left), duty)
    b = math.floor(right) * duty + min(right - math.floor(right), duty)
    return (b - a) / foot


@njit()
def texture(material, x, y, z, u, v, foot, shift, out):
    """Write the linear RGB of a material at a point into `out` [3]; `shift` offsets the pattern, differently for each part."""
    kind = int(material[KIND])
    seed = int(material[SEED])
    scale = material[SCALE]
    weight, bright, third = 1.0, 1.0, 0.0
    if kind == STRIPES:
        weight = filtered_band(u / scale, material[DUTY], foot / scale)
    elif kind == CHECKER:
        a = 2 * filtered_band(u / scale, 0.5, foot / scale) - 1
        b = 2 * filtered_band(v / (scale * material[ASPECT]), 0.5, foot / (scale * material[ASPECT])) - 1
        weight = 0.5 + 0.5 * a * b
    elif kind in (TILES, PLANKS):
        height = scale * material[ASPECT]
        row = math.floor(v / scale)
        along = u / height + (cell_hash(int(row), 3, 7, seed) if kind == PLANKS else 0.0)
        column = math.floor(along)
        weight = filtered_band(v / scale, material[DUTY], foot / scale)
        weight *= filtered_band(along, 1 - (1 - material[DUTY]) / material[ASPECT], foot / height)
        left = fade(foot / scale)
        bright = 1 + left * material[VARIATION] * (2 * cell_hash(int(row), int(column), 1, seed) - 1)
        if kind == PLANKS:
            jump = 9.0 * cell_hash(int(row), int(column), 2, seed)
            third = 0.5 + 0.5 * layered_noise(u * 2.5 + jump, v * 45 + 3 * jump, 0.5, foot * 45, 3, seed)
            third += 0.35 * layered_noise(u * 1.2 + jump, v * 14, 0.5, foot * 14, 2, seed + 9)
            third = min(max(third, 0.0), 1.0) * material[TINT]
    elif kind == WOOD:
        axis = int(material[AXIS])
        g, a, b = (x, y, z) if axis == 0 else ((y, z, x) if axis == 1 else (z, x, y))
        grain = 40 / scale
        third = 0.5 + 0.5 * layered_noise(g * 2.2 + shift, a * grain, b * grain, foot * grain, 3, seed)
        third += 0.4 * layered_noise(g * 0.9 + shift, a * grain / 4, b * grain / 4, foot * grain / 4, 2, seed + 9)
        third = min(max(third, 0.0), 1.0) * material[TINT]
    elif kind == WEAVE:
        a = filtered_band(u / scale, material[DUTY], foot / scale)
        b = filtered_band(v / (scale * material[ASPECT]), material[DUTY], foot / (scale * material[ASPECT]))
        weight = 0.5 * (a + b)
    elif kind == MARBLE:
        warp = layered_noise(x / scale + shift, y / scale, z / scale, foot / scale, 3, seed)
        vein = abs(layered_noise(x / scale + warp, y / scale + shift, z / scale - warp, foot / scale, 4, seed + 5))
        weight = min(1.0, vein * 2.2 + material[DUTY] * (1 - fade(foot / scale)))
    elif kind == DOTS:
        cx, cy = math.floor(u / scale), math.floor(v / scale)
        jx = 0.3 + 0.4 * cell_hash(int(cx), int(cy), 1, seed)
        jy = 0.3 + 0.4 * cell_hash(int(cx), int(cy), 2, seed)
        radius = 0.15 + 0.2 * cell_hash(int(cx), int(cy), 3, seed) * material[VARIATION]
        distance = math.hypot(u / scale - cx - jx, v / scale - cy - jy) - radius
        soft = max(foot / scale, 0.02)
        dot = min(max(0.5 - distance / soft, 0.0), 1.0)
        left = fade(foot / scale)
        dot = left * dot + (1 - left) * 0.15
        weight = 1 - dot
        third = left * (1.0 if cell_hash(int(cx), int(cy), 4, seed) < 0.4 else 0.0) * dot
    elif kind == BOOKS:
        _books(material, u + shift, v, foot, seed, out)
    elif kind == LANDSCAPE:
        horizon = 0.25 * scale * layered_noise(u / scale + shift, 0.5, 0.5, foot / scale, 4, seed)
        ridge = 0.3 * scale + 0.5 * scale * layered_noise(u / scale * 0.7 + shift, 4.5, 0.5, foot / scale, 4, seed + 3)
        soft = max(foot, 1e-3)
        weight = min(max((v - horizon) / soft + 0.5, 0.0), 1.0)
        third = weight * min(max((ridge - v) / soft + 0.5, 0.0), 1.0)
        bright = 1 + 0.35 * layered_noise(u / scale * 3 + shift, v / scale * 5, 0.5, foot / scale * 5, 3, seed + 7)
    elif kind == ABSTRACT:
        weight, third, bright = _patches(u / scale + shift, v / scale, foot / scale, seed)
    elif kind == OUTDOOR:
        tree = layered_noise(u / scale + shift, v / scale, 0.5, foot / scale, 4, seed)
        soft = 0.15 + foot / scale
        weight = min(max((v / scale * material[ASPECT] + 1.3 * tree - material[DUTY]) / soft + 0.5, 0.0), 1.0)
        bright = 1 + 0.5 * (1 - weight) * layered_noise(
            u / scale * 6, v / scale * 6, shift, foot / scale * 6, 3, seed + 4
        )
    if kind != BOOKS:
        for k in range(3):
            base = weight * material[COLOUR_A + k] + (1 - weight) * material[COLOUR_B + k]
            out[k] = bright * (base + third * (material[COLOUR_C + k] - base))
    size = material[BLOTCH_SCALE]
    blotch = material[BLOTCH] * layered_noise(x / size + shift, y / size, z / size, foot / size, 3, seed + 21)
    size = material[FINE_SCALE]
    fine = material[FINE] * layered_noise(x / size, y / size + shift, z / size, foot / size, 3, seed + 31)
    tint = material[BLOTCH] * 0.5 * value_noise(x / size * 0.3 + 7, y / size * 0.3 + shift, z / size * 0.3, seed + 41)
    tint *= fade(foot / size * 0.3)
    for k in range(3):
        lean = (1.0 - k) * tint
        out[k] = min(max(out[k] * (1 + blotch + fine + lean), 0.002), 0.98)


@njit()
def _books(material, u, v, foot, seed, out):
    """Book spines of varied width, in colours near the material's three."""
    scale = material[SCALE]
    slot = math.floor(u / scale)
    inside = u / scale - slot
    split = 0.3 + 0.4 * cell_hash(int(slot), 0, 5, seed)
    half = 0 if inside < split else 1
    pick = cell_hash(int(slot), half, 6, seed)
    first = COLOUR_A if pick < 0.34 else (COLOUR_B if pick < 0.67 else COLOUR_C)
    left = fade(foot / scale * 1.5)
    edge = min(abs(inside), min(abs(inside - split), abs(1 - inside)))
    gap = 1 - 0.75 * left * min(max(1 - edge * scale / max(0.0025, 0.5 * foot), 0.0), 1.0)
    light = 0.35 + 1.3 * cell_hash(int(slot), half, 7, seed)
    height = 0.5 + cell_hash(int(slot), half, 8, seed)
    label = filtered_band(v / 0.11 + height, 0.22, foot / 0.11) * cell_hash(int(slot), half, 9, seed)
    for k in range(3):
        mean = (material[COLOUR_A + k] + material[COLOUR_B + k] + material[COLOUR_C + k]) / 3
        own = material[first + k] * light * (0.7 + 0.6 * cell_hash(int(slot), half, 10 + k, seed))
        own = own * (1 - 0.6 * label) + 0.6 * label * 0.7
        out[k] = gap * (left * own + (1 - left) * mean)


@njit()
def _patches(u, v, foot, seed):
    """Patches of three colours with curved borders: shares of colours A and C, and brightness."""
    u += 0.35 * layered_noise(u, v, 0.5, foot, 3, seed + 2)
    v += 0.35 * layered_noise(u, v, 9.5, foot, 3, seed + 4)
    cx, cy = math.floor(u), math.floor(v)
    nearest, which_x, which_y = 9.0, 0, 0
    for dx in range(-1, 2):
        for dy in range(-1, 2):
            x, y = int(cx) + dx, int(cy) + dy
            px, py = x + cell_hash(x, y, 1, seed), y + cell_hash(x, y, 2, seed)
            distance = (px - u) ** 2 + (py - v) ** 2
            if distance < nearest:
                nearest, which_x, which_y = distance, x, y
    left = fade(foot)
    pick = cell_hash(which_x, which_y, 3, seed)
    weight = left * (1.0 if pick < 0.4 else 0.0) + (1 - left) * 0.4
    third = left * (1.0 if pick > 0.75 else 0.0) + (1 - left) * 0.25
    bright = 1 + left * 0.7 * (cell_hash(which_x, which_y, 4, seed) - 0.5)
    return weight, third, bright

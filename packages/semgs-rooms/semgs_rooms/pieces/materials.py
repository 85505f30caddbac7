"""Random materials: wood, cloth, metal and so on, as numbers for the texture kernels.

Colours are sampled as hue, saturation and value in sRGB and stored as linear RGB, because light adds up in linear RGB.
"""

from __future__ import annotations

import colorsys
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from semgs_rooms.pieces import texture_kernels as t

Material = Float64[np.ndarray, " 24"]
"""A material; `texture_kernels` says what each number means."""
Range = tuple[float | int, float | int]
"""Lowest and highest value."""


Colour = tuple[float, float, float]
"""Linear RGB."""


@dataclass(frozen=True)
class Pattern:
    """A procedural pattern; see `texture_kernels` for the numbers. Colours b and c default to a."""

    kind: int
    a: Colour = (0.5, 0.5, 0.5)
    b: Colour | None = None
    c: Colour | None = None
    scale: float = 1.0
    aspect: float = 1.0
    duty: float = 0.5
    axis: int = 0
    variation: float = 0.0
    tint: float = 1.0


@dataclass(frozen=True)
class Noise:
    """Irregularities of a surface: relative strength and size [m] of fine grain, and of large blotches."""

    fine: float = 0.03
    fine_scale: float = 0.01
    blotch: float = 0.03
    blotch_scale: float = 0.4


SLIGHT = Noise()
WARM_HUES = (0.02, 0.13)
GREEN_HUES = (0.22, 0.42)
BLUE_HUES = (0.5, 0.68)


def linear(colour: Colour) -> Colour:
    """An sRGB colour in 0..1 as linear RGB."""
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour)
    return red, green, blue


def colour(
    rng: np.random.Generator, hue: Range = (0.0, 1.0), saturation: Range = (0.0, 0.7), value: Range = (0.15, 0.9)
) -> Colour:
    """A random linear RGB colour. Hue wraps around at 1; pale tones are more frequent than strong ones."""
    strength = saturation[0] + (saturation[1] - saturation[0]) * rng.random() ** 2.2
    return linear(colorsys.hsv_to_rgb(rng.uniform(*hue) % 1, strength, rng.uniform(*value)))


def patterned(
    rng: np.random.Generator, pattern: Pattern, noise: Noise = SLIGHT, *, emission: float = 0.0, gloss: float = 0.0
) -> Material:
    """A material with a pattern, whose seed is random."""
    material = np.zeros(t.WIDTH)
    material[t.KIND] = pattern.kind
    material[t.COLOUR_A : t.COLOUR_A + 3] = pattern.a
    material[t.COLOUR_B : t.COLOUR_B + 3] = pattern.a if pattern.b is None else pattern.b
    material[t.COLOUR_C : t.COLOUR_C + 3] = pattern.a if pattern.c is None else pattern.c
    material[t.SCALE : t.DUTY + 1] = pattern.scale, pattern.aspect, pattern.duty
    material[t.SEED] = rng.integers(1 << 20)
    material[t.FINE : t.BLOTCH_SCALE + 1] = noise.fine, noise.fine_scale, noise.blotch, noise.blotch_scale
    material[t.EMISSION : t.GLOSS + 1] = emission, gloss
    material[t.AXIS : t.TINT + 1] = pattern.axis, pattern.variation, pattern.tint
    return material


def plain(
    rng: np.random.Generator, base: Colour, noise: Noise = SLIGHT, *, emission: float = 0.0, gloss: float = 0.0
) -> Material:
    """A material of one colour."""
    return patterned(rng, Pattern(t.PLAIN, base), noise, emission=emission, gloss=gloss)


def wall_paint(rng: np.random.Generator) -> Material:
    """Wall covering: usually plain, pale paint; otherwise wallpaper, brick or boards."""
    look = rng.random()
    if look < 0.66:
        base = colour(rng, (0.02, 0.2), (0.0, 0.16), (0.72, 0.97))
    elif look < 0.88:
        base = colour(rng, saturation=(0.03, 0.3), value=(0.5, 0.92))
    else:
        base = colour(rng, saturation=(0.1, 0.6), value=(0.2, 0.7))
    pattern = rng.random()
    grain = Noise(rng.uniform(0.005, 0.05), rng.uniform(0.004, 0.03), rng.uniform(0.01, 0.07), rng.uniform(0.2, 1.2))
    if pattern < 0.76:
        return plain(rng, base, grain)
    other = shade(rng, base, 0.7, 1.2)
    if pattern < 0.84:
        scale = rng.uniform(0.06, 0.3)
        return patterned(rng, Pattern(t.STRIPES, base, other, scale=scale, duty=rng.uniform(0.3, 0.7)), grain)
    if pattern < 0.91:
        scale = rng.uniform(0.08, 0.25)
        return patterned(rng, Pattern(t.DOTS, base, other, colour(rng), scale=scale, variation=1.0), grain)
    if pattern < 0.95:
        bricks = colour(rng, (0.0, 0.08), (0.1, 0.6), (0.4, 0.9))
        joints = shade(rng, bricks, 1.1, 1.6)
        wall = Pattern(t.PLANKS, bricks, joints, bricks, scale=0.08, aspect=3.0, duty=0.85, variation=0.25, tint=0.2)
        return patterned(rng, wall, grain)
    return boards(rng, base)


def shade(rng: np.random.Generator, base: Colour, low: float, high: float) -> Colour:
    """A colour made lighter or darker by a random factor, with a slightly different hue."""
    factor = rng.uniform(low, high)
    red, green, blue = (min(0.95, c * factor * rng.uniform(0.93, 1.07)) for c in base)
    return red, green, blue


def boards(rng: np.random.Generator, base: Colour) -> Material:
    """Painted or natural boards with visible joints."""
    pattern = Pattern(t.PLANKS, base, shade(rng, base, 0.3, 0.6), shade(rng, base, 0.6, 0.9), scale=rng.uniform(0.08, 0.2),
                      aspect=rng.uniform(8, 20), duty=0.97, variation=rng.uniform(0, 0.15), tint=rng.uniform(0.1, 0.6))  # fmt: skip
    return patterned(rng, pattern, gloss=0.1)


def wood_colour(rng: np.random.Generator) -> Colour:
    """A random wood colour, from birch to wenge."""
    return colour(rng, (0.04, 0.11), (0.2, 0.7), (0.2, 0.9))


def wood(rng: np.random.Generator, axis: int = 0, base: Colour | None = None) -> Material:
    """Solid wood with its grain along an axis of the part."""
    base = wood_colour(rng) if base is None else base
    dark, scale, gloss = shade(rng, base, 0.35, 0.75), rng.uniform(0.5, 2.0), rng.uniform(0, 0.3)
    pattern = Pattern(t.WOOD, base, None, dark, scale=scale, axis=axis, tint=rng.uniform(0.3, 0.9))
    return patterned(rng, pattern, Noise(0.04, 0.006, 0.06, 0.3), gloss=gloss)


def along(material: Material, axis: int) -> Material:
    """The same material with its grain along another axis."""
    turned = material.copy()
    turned[t.AXIS] = axis
    return turned


def lacquer(rng: np.random.Generator) -> Material:
    """Furniture paint, usually white."""
    pale = rng.random() < 0.55
    base = colour(rng, saturation=(0, 0.08), value=(0.75, 0.97)) if pale else colour(rng, value=(0.08, 0.8))
    noise = Noise(rng.uniform(0.005, 0.04), 0.01, rng.uniform(0.01, 0.05), rng.uniform(0.1, 0.6))
    return plain(rng, base, noise, gloss=rng.uniform(0, 0.35))


def carpentry(rng: np.random.Generator) -> Material:
    """Wood or paint, for wooden furniture."""
    return wood(rng) if rng.random() < 0.62 else lacquer(rng)


def fabric(rng: np.random.Generator, base: Colour | None = None) -> Material:
    """Cloth: plain, woven, striped, checked or dotted."""
    if base is None:
        pale = rng.random() < 0.4
        base = colour(rng, saturation=(0.0, 0.15), value=(0.6, 0.95)) if pale else colour(rng)
    other = shade(rng, base, 0.4, 1.4) if rng.random() < 0.6 else colour(rng)
    noise = Noise(rng.uniform(0.04, 0.2), rng.uniform(0.004, 0.02), rng.uniform(0.03, 0.14), rng.uniform(0.06, 0.4))
    look = rng.random()
    if look < 0.5:
        return plain(rng, base, noise)
    if look < 0.65:
        scale = rng.uniform(0.006, 0.03)
        return patterned(rng, Pattern(t.WEAVE, base, other, scale=scale, aspect=rng.uniform(0.7, 1.5)), noise)
    if look < 0.78:
        scale, duty = rng.uniform(0.02, 0.2), rng.uniform(0.2, 0.8)
        return patterned(rng, Pattern(t.STRIPES, base, other, scale=scale, duty=duty), noise)
    if look < 0.9:
        scale, duty = rng.uniform(0.05, 0.25), rng.uniform(0.3, 0.7)
        return patterned(rng, Pattern(t.WEAVE, base, other, scale=scale, duty=duty), noise)
    dots = Pattern(t.DOTS, base, other, colour(rng), scale=rng.uniform(0.05, 0.2), variation=1.0)
    return patterned(rng, dots, noise)


def bedding(rng: np.random.Generator) -> Material:
    """Bed linen, white in half of the cases."""
    return fabric(rng, colour(rng, saturation=(0, 0.1), value=(0.75, 0.97)) if rng.random() < 0.5 else None)


def metal(rng: np.random.Generator) -> Material:
    """Grey, black or brass, glossy."""
    base = colour(rng, (0.08, 0.14), (0.0, 0.3), (0.1, 0.85))
    return plain(rng, base, Noise(blotch=0.08, blotch_scale=0.15), gloss=rng.uniform(0.3, 0.7))


def ceramic(rng: np.random.Generator) -> Material:
    """Glazed ceramic: white, rarely coloured."""
    if rng.random() < 0.12:
        base = colour(rng, saturation=(0.1, 0.4), value=(0.5, 0.9))
    else:
        base = colour(rng, (0.05, 0.2), (0, 0.06), (0.82, 0.97))
    return plain(rng, base, Noise(fine=0.006, blotch=0.025, blotch_scale=0.3), gloss=rng.uniform(0.2, 0.6))


def stone(rng: np.random.Generator) -> Material:
    """Marble, granite or concrete."""
    base = colour(rng, (0.03, 0.15), (0.0, 0.25), (0.15, 0.95))
    veins = Pattern(t.MARBLE, base, shade(rng, base, 0.3, 1.5), scale=rng.uniform(0.03, 0.5))
    noise = Noise(rng.uniform(0.03, 0.15), rng.uniform(0.004, 0.01))
    return patterned(rng, veins, noise, gloss=rng.uniform(0, 0.4))


def tiles(rng: np.random.Generator, small: bool = False) -> Material:
    """Tiles with joints, in one colour or varied, or as a chess board."""
    base = colour(rng, saturation=(0.0, 0.3), value=(0.45, 0.95)) if rng.random() < 0.7 else colour(rng)
    scale = rng.uniform(0.05, 0.2) if small else rng.uniform(0.2, 0.6)
    if rng.random() < 0.15:
        chess = Pattern(t.CHECKER, base, colour(rng, value=(0.05, 0.6)), scale=2 * scale)
        return patterned(rng, chess, Noise(blotch=0.05), gloss=0.2)
    pattern = Pattern(t.TILES, base, shade(rng, base, 0.4, 1.3), base, scale=scale, aspect=rng.choice([1.0, 1.0, 1.5, 2.0]),
                      duty=rng.uniform(0.94, 0.985), variation=rng.uniform(0.0, 0.15))  # fmt: skip
    noise = Noise(rng.uniform(0.01, 0.08), 0.015, rng.uniform(0.02, 0.1), 0.2)
    return patterned(rng, pattern, noise, gloss=rng.uniform(0.05, 0.4))


def flooring(rng: np.random.Generator, wet: bool) -> Material:
    """Planks, carpet, tiles or stone; usually tiles in wet rooms."""
    look = rng.random()
    if wet and look < 0.75:
        return tiles(rng)
    if look < 0.5:
        base = wood_colour(rng)
        planks = Pattern(t.PLANKS, base, shade(rng, base, 0.25, 0.6), shade(rng, base, 0.4, 0.85), scale=rng.uniform(0.06, 0.2),
                         aspect=rng.uniform(6, 14), duty=rng.uniform(0.97, 0.99), variation=rng.uniform(0.05, 0.3),
                         tint=rng.uniform(0.3, 0.9))  # fmt: skip
        return patterned(rng, planks, gloss=rng.uniform(0, 0.3))
    if look < 0.78:
        quiet = rng.random() < 0.85
        base = colour(rng, (0.02, 0.16) if quiet else (0.0, 1.0), (0.0, 0.3 if quiet else 0.5), (0.2, 0.8))
        noise = Noise(rng.uniform(0.1, 0.3), rng.uniform(0.006, 0.02), rng.uniform(0.05, 0.15), rng.uniform(0.1, 0.5))
        return plain(rng, base, noise)
    return tiles(rng) if look < 0.92 else stone(rng)


def rug(rng: np.random.Generator) -> Material:
    """A rug, often patterned."""
    if rng.random() < 0.4:
        patches = Pattern(t.ABSTRACT, colour(rng), colour(rng), colour(rng), scale=rng.uniform(0.1, 0.4))
        return patterned(rng, patches, Noise(fine=0.15))
    return fabric(rng)


def books(rng: np.random.Generator) -> Material:
    """A row of spines."""
    first, second = colour(rng, value=(0.3, 0.95)), colour(rng, value=(0.2, 0.8))
    third = colour(rng, (0.05, 0.15), (0, 0.3), (0.5, 0.95))
    return patterned(rng, Pattern(t.BOOKS, first, second, third, scale=rng.uniform(0.04, 0.11)))


def artwork(rng: np.random.Generator) -> Material:
    """A painting: a landscape or patches of colour."""
    if rng.random() < 0.65:
        sky = colour(rng, (0.5, 0.65), (0.05, 0.5), (0.5, 0.95))
        ground = colour(rng, (0.08, 0.4), (0.2, 0.7), (0.15, 0.7))
        ridge = colour(rng, (0.2, 0.7), (0.1, 0.5), (0.2, 0.7))
        landscape = Pattern(t.LANDSCAPE, sky, ground, ridge, scale=rng.uniform(0.15, 0.4))
        return patterned(rng, landscape, Noise(fine=0.08))
    patches = Pattern(t.ABSTRACT, colour(rng), colour(rng), colour(rng), scale=rng.uniform(0.04, 0.25))
    return patterned(rng, patches, Noise(fine=rng.uniform(0.03, 0.15), blotch=0.1, blotch_scale=0.1))


def outdoors(rng: np.random.Generator, light: float) -> Material:
    """The view through a window, which emits light of radiance `light`: sky over trees or houses."""
    sky = colour(rng, BLUE_HUES, (0.0, 0.4), (0.75, 1.0))
    ground = colour(rng, (0.08, 0.4), (0.1, 0.6), (0.15, 0.6))
    scale, aspect, duty = rng.uniform(0.2, 0.8), rng.uniform(0.3, 1.0), rng.uniform(-1.2, 0.6)
    view = Pattern(t.OUTDOOR, sky, ground, scale=scale, aspect=aspect, duty=duty)
    return patterned(rng, view, Noise(fine=0.0), emission=light)


def drapery(rng: np.random.Generator) -> Material:
    """Curtain cloth."""
    return fabric(rng, colour(rng, saturation=(0.0, 0.2), value=(0.6, 0.95)) if rng.random() < 0.45 else None)


def thing(rng: np.random.Generator) -> Material:
    """A random material for clutter."""
    maker = (lacquer, fabric, wood, metal, books, artwork)[int(rng.integers(6))]
    return maker(rng)

"""Recolour textures in plausible wood, paint, cloth and metal, by the names of their materials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Int, UInt8
from scipy import ndimage

from semgs.files.images.colours import LINEAR
from semgs_rooms.furniture.kinds import Random
from semgs_rooms.furniture.raw import RawMesh

Colour = tuple[int, int, int]

NATURAL: tuple[Colour, ...] = (
    (196, 164, 120), (110, 76, 52), (214, 178, 130), (70, 52, 42), (222, 200, 165), (150, 88, 60), (176, 134, 92), (128, 92, 62),
)  # fmt: skip
"""Woods, sRGB."""
PAINTED: tuple[Colour, ...] = ((232, 230, 225), (228, 226, 220), (150, 148, 145), (45, 43, 42), (240, 238, 232))
WOODS = NATURAL[:7] + PAINTED
METALS: tuple[Colour, ...] = (
    (176, 178, 180), (150, 152, 155), (40, 40, 42), (190, 186, 178), (205, 206, 208), (170, 140, 90),
)  # fmt: skip
FABRICS: tuple[Colour, ...] = (
    (235, 232, 226), (222, 212, 196), (196, 198, 202), (60, 74, 104), (128, 150, 172), (198, 180, 152), (142, 156, 132),
    (112, 46, 54), (72, 72, 76), (206, 164, 164), (180, 190, 204), (238, 236, 234), (160, 110, 80), (98, 120, 110),
    (208, 196, 160),
)  # fmt: skip
LEATHERS: tuple[Colour, ...] = (
    (92, 58, 40), (50, 46, 44), (150, 104, 70), (222, 214, 202), (84, 84, 88), (120, 40, 38),
)  # fmt: skip
CERAMICS: tuple[Colour, ...] = (
    (240, 240, 238), (236, 236, 232), (232, 228, 216), (244, 244, 244), (226, 228, 230), (238, 232, 220),
)  # fmt: skip
STONES: tuple[Colour, ...] = (
    (70, 70, 74), (205, 200, 190), (232, 230, 226), (150, 146, 140), (52, 50, 50), (176, 160, 140),
)  # fmt: skip
METAL = ("metal", "rod", "galvan", "chrome", "steel")
"""Words in the names of Infinigen's metals."""
CLOTH = ("fabric", "leather", "knit", "velvet", "art", "rug", "sofa", "plaid")


@dataclass(frozen=True)
class Tint:
    """A new colour for materials with one of some words in their names.

    Attributes:
        words: "" matches every name.
        colour: sRGB; None keeps Infinigen's mean colour.
        contrast: how much of Infinigen's pattern remains, 0..1.
    """

    words: tuple[str, ...]
    colour: Colour | None
    contrast: float


def pick_colour(rng: Random, colours: Sequence[Colour]) -> Colour:
    """A random one of some colours."""
    return colours[int(rng.integers(len(colours)))]


def grain(colour: Colour, most: float = 0.45) -> float:
    """How much grain shows on a board: little in paint colours, more in wood colours."""
    strongest = max(colour)
    saturation = (strongest - min(colour)) / max(strongest, 1)
    if saturation < 0.13 and sum(colour) > 270:
        return 0.07
    return 0.2 if saturation < 0.2 else most


def apply_tints(mesh: RawMesh, tints: Sequence[Tint]) -> UInt8[np.ndarray, "h w 3"]:
    """The texture of a mesh in other colours; each material uses the first tint that matches its name."""
    covered, nearest = _regions(mesh)
    picture = mesh.picture.astype(np.float64)
    grey = ndimage.gaussian_filter(picture.mean(axis=2), 0.8)
    result = picture.copy()
    for number, name in enumerate(mesh.materials):
        tint = next((one for one in tints if any(word in name.lower() for word in one.words)), None)
        region = nearest == number
        if tint is None or not region.any():
            continue
        own = covered == number if (covered == number).any() else region
        if tint.colour is None:
            mean = picture[own].mean(axis=0)
            result[region] = mean + (picture[region] - mean) * tint.contrast
        else:
            light = np.clip(grey[region] / max(grey[own].mean(), 1.0), 0.35, 1.7)
            result[region] = np.array(tint.colour) * (1 + tint.contrast * (light - 1))[:, None]
    return result.clip(0, 255).astype(np.uint8)


def _regions(mesh: RawMesh) -> tuple[Int[np.ndarray, "h w"], Int[np.ndarray, "h w"]]:
    """The material of each pixel, -1 where there is no triangle, and the material of the nearest pixel that has one."""
    height, width = mesh.picture.shape[:2]
    covered = np.full((height, width), -1, np.int32)
    corners = mesh.uv * [width, -height] + [0, height] - 0.5
    for triangle, number in zip(np.round(corners).astype(np.int32), mesh.material.tolist(), strict=True):
        cv2.fillConvexPoly(covered, triangle, number)
    if (covered < 0).all():
        return covered, covered
    places = ndimage.distance_transform_edt(covered < 0, return_distances=False, return_indices=True)
    return covered, covered[tuple(places)]


def linear_rgb(colour: Colour) -> tuple[float, float, float]:
    """Linear RGB of an sRGB colour."""
    red, green, blue = LINEAR[list(colour)].tolist()
    return red, green, blue

"""Generate textures of cloth for curtains: plain, striped, dotted, checked or with leaves."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import cv2
import numpy as np
from jaxtyping import Float64, UInt8

from semgs_rooms.furniture.kinds import Random
from semgs_rooms.furniture.tints import FABRICS, Colour, pick_colour

SIDE = 512
"""Side of the texture [px]."""
PALE: tuple[Colour, ...] = ((240, 238, 234), (230, 224, 214))


def cloth_picture(rng: Random, width: float, height: float) -> UInt8[np.ndarray, "h w 3"]:
    """A texture for cloth of a size [m]."""
    base, other = pick_colour(rng, FABRICS + PALE), pick_colour(rng, FABRICS)
    picture = np.full((SIDE, SIDE, 3), base, np.uint8)
    scale = SIDE / width, SIDE / height
    pattern = PATTERNS[int(rng.integers(len(PATTERNS)))]
    if pattern is not None:
        pattern(rng, picture, other, scale, (width, height))
    noise = cv2.GaussianBlur(rng.normal(0, 1, (SIDE, SIDE)), (0, 0), 0.7)
    folds = 1 + 0.03 * np.sin(np.linspace(0, 2 * np.pi * rng.uniform(3, 9), SIDE) + rng.uniform(0, 6))
    light = (1 + 0.035 * noise / noise.std()) * folds
    return (picture * light[..., None]).clip(0, 255).astype(np.uint8)


Picture = UInt8[np.ndarray, "h w 3"]
Pair = tuple[float, float]


def _box(picture: Picture, colour: Colour, scale: Pair, x: Sequence[float], y: Sequence[float]) -> None:
    """Fill a rectangle, given in metres."""
    (left, right), (low, high) = (np.round(np.array(x) * scale[0]), np.round(np.array(y) * scale[1]))
    picture[int(low) : int(high), int(left) : int(right)] = colour


def _bars(rng: Random, picture: Picture, colour: Colour, scale: Pair, size: Pair) -> None:
    step, share = rng.uniform(0.05, 0.2), rng.uniform(0.3, 0.6)
    for x in np.arange(0, size[0], step).tolist():
        _box(picture, colour, scale, (x, x + share * step), (0.0, size[1]))


def _stripes(rng: Random, picture: Picture, colour: Colour, scale: Pair, size: Pair) -> None:
    step = rng.uniform(0.08, 0.25)
    for y in np.arange(0, size[1], step).tolist():
        _box(picture, colour, scale, (0.0, size[0]), (y, y + 0.5 * step))


def _bands(rng: Random, picture: Picture, colour: Colour, scale: Pair, size: Pair) -> None:
    for _ in range(int(rng.integers(1, 4))):
        y = rng.uniform(0, size[1])
        _box(picture, colour, scale, (0.0, size[0]), (y, y + rng.uniform(0.05, 0.4)))


def _dots(rng: Random, picture: Picture, colour: Colour, scale: Pair, size: Pair) -> None:
    step = rng.uniform(0.1, 0.22)
    radius = step * rng.uniform(0.15, 0.35)
    for row, y in enumerate(np.arange(0, size[1] + step, step)):
        for x in np.arange(step / 2 * (row % 2), size[0] + step, step):
            centre = (round(x * scale[0]), round(y * scale[1]))
            axes = (round(radius * scale[0]), round(radius * scale[1]))
            cv2.ellipse(picture, centre, axes, 0, 0, 360, colour, -1, cv2.LINE_AA)


def _checks(rng: Random, picture: Picture, colour: Colour, scale: Pair, size: Pair) -> None:
    step = rng.uniform(0.1, 0.25)
    across = (np.arange(SIDE) / scale[0]) % step < step / 2
    down = (np.arange(SIDE) / scale[1]) % step < step / 2
    darker = (1 - 0.22 * across[None, :]) * (1 - 0.22 * down[:, None])
    picture[:] = (picture * darker[..., None]).astype(np.uint8)


def _leaves(rng: Random, picture: Picture, colour: Colour, scale: Pair, size: Pair) -> None:
    for _ in range(int(60 * size[0] * size[1])):
        shade = tuple(float(c) for c in np.clip(np.array(colour) * rng.uniform(0.7, 1.15, 3), 0, 255))
        leaf = _leaf(rng.uniform(0, 2 * np.pi), rng.uniform(0.04, 0.12)) + rng.uniform((0, 0), size)
        cv2.fillPoly(picture, [np.round(leaf * scale).astype(np.int32)], shade, cv2.LINE_AA)


def _leaf(turn: float, length: float) -> Float64[np.ndarray, "4 2"]:
    along = length * np.array([np.cos(turn), np.sin(turn)])
    aside = 0.3 * along[::-1] * [-1, 1]
    return np.stack((along, aside, -along, -aside))


PATTERNS: tuple[Callable[[Random, Picture, Colour, Pair, Pair], None] | None, ...] = (
    *(None,) * 6, _bars, _bands, _leaves, _dots, _checks, _stripes,
)  # fmt: skip
"""Half of them are plain."""

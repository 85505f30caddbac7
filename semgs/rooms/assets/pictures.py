"""Pictures as textures: decoded once, with every smaller version that a distant view needs, packed for the kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float64, Int64, UInt8

from semgs.files.errors import InputError

LONGEST = 1024
"""Larger pictures are reduced to this [px]."""


@dataclass(frozen=True)
class Pyramid:
    """A picture, and halves of it down to one pixel (mip map), sRGB.

    Attributes:
        pixels: of all levels, one after the other, rows from above.
        size: width, height of the first level [px]; level k has max(1, size >> k).
    """

    pixels: UInt8[np.ndarray, "n 3"]
    size: tuple[int, int]


@dataclass(frozen=True)
class Pack:
    """Pictures of one room, for the kernels.

    Attributes:
        pixels: of all pyramids.
        table: start in `pixels`, width, height and number of levels of each picture.
        means: of each picture, linear RGB.
    """

    pixels: UInt8[np.ndarray, "n 3"]
    table: Int64[np.ndarray, "p 4"]
    means: Float64[np.ndarray, "p 3"]


def pyramid(picture: UInt8[np.ndarray, "h w 3"]) -> Pyramid:
    """All levels of a picture; each pixel is the mean, in linear light, of the area that it covers."""
    height, width = picture.shape[:2]
    shrink = LONGEST / max(height, width)
    if shrink < 1:
        picture = cv2.resize(picture, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
        height, width = picture.shape[:2]
    levels, light = [picture], _LINEAR[picture]
    while width > 1 or height > 1:
        width, height = max(1, width // 2), max(1, height // 2)
        light = cv2.resize(light, (width, height), interpolation=cv2.INTER_AREA)
        levels.append(_encoded(light))
    return Pyramid(
        np.concatenate([level.reshape(-1, 3) for level in levels]), (levels[0].shape[1], levels[0].shape[0])
    )


def decode(raw: bytes, path: Path) -> Pyramid:
    """The pyramid of an encoded picture.

    Raises:
        InputError: it cannot be decoded; names the file that it is from.
    """
    picture = cv2.imdecode(np.frombuffer(raw, np.uint8), cv2.IMREAD_COLOR) if raw else None
    if picture is None:
        raise InputError(path, "a picture", "bytes that cannot be decoded", advice="fetch it again")
    return pyramid(np.ascontiguousarray(picture[..., ::-1]))


def pack(pyramids: Sequence[Pyramid]) -> Pack:
    """Pictures behind each other; none is a pack too."""
    starts = np.cumsum([0, *(len(p.pixels) for p in pyramids)])
    table = [(start, *p.size, max(p.size).bit_length()) for start, p in zip(starts, pyramids, strict=False)]
    pixels = np.concatenate([p.pixels for p in pyramids]) if pyramids else np.zeros((1, 3), np.uint8)
    means = _LINEAR[np.array([p.pixels[-1] for p in pyramids], np.uint8).reshape(-1, 3)]
    return Pack(pixels, np.array(table, dtype=np.int64).reshape(-1, 4), means.astype(np.float64))


def _srgb_to_linear() -> np.ndarray:
    value = np.arange(256) / 255
    return np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4).astype(np.float32)


def _linear_to_srgb() -> np.ndarray:
    value = (np.arange(4096) + 0.5) / 4096
    coded = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    return np.round(255 * coded).astype(np.uint8)


_LINEAR, _CODED = _srgb_to_linear(), _linear_to_srgb()


def _encoded(light: np.ndarray) -> UInt8[np.ndarray, "h w 3"]:
    coded = _CODED[np.minimum((light * 4096).astype(np.int64), 4095)]
    return coded.reshape(*light.shape[:2], 3)

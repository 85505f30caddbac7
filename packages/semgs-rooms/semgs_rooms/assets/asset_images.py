"""Images as textures: mip maps, packed for the kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float32, Float64, Int64, UInt8

from semgs.files.errors import InputError
from semgs.files.images.colours import LINEAR
from semgs_rooms.pieces import shell_kernels

LONGEST = 1024
"""Larger images are reduced to this [px]."""


@dataclass(frozen=True)
class Pyramid:
    """The mip map of an image, down to one pixel, sRGB.

    Attributes:
        pixels: of all levels, one after another, top row first.
        size: width, height of the first level [px]; level k has max(1, size >> k).
    """

    pixels: UInt8[np.ndarray, "n 3"]
    size: tuple[int, int]


@dataclass(frozen=True)
class Pack:
    """The images of one room, for the kernels.

    Attributes:
        pixels: of all pyramids.
        table: first index in `pixels`, width, height and number of levels of each image.
        means: of each image, linear RGB.
    """

    pixels: UInt8[np.ndarray, "n 3"]
    table: Int64[np.ndarray, "p 4"]
    means: Float64[np.ndarray, "p 3"]


def pyramid(picture: UInt8[np.ndarray, "h w 3"]) -> Pyramid:
    """All levels of an image; each pixel is the mean, in linear light, of the area that it covers."""
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
    return Pyramid(np.concatenate([level.reshape(-1, 3) for level in levels]), (levels[0].shape[1], levels[0].shape[0]))


def decode(raw: bytes, path: Path, uv: Float32[np.ndarray, "t 3 2"] | None = None) -> Pyramid:
    """The pyramid of an encoded image.

    Args:
        raw: the encoded bytes.
        path: their file, for errors.
        uv: texture coordinates of the triangles that use the image, (0, 0) at the upper left. Areas outside them are filled with
            neighbouring colours, so that the gaps of an atlas do not bleed into seams. None leaves the image unchanged.

    Raises:
        InputError: it cannot be decoded.
    """
    picture = cv2.imdecode(np.frombuffer(raw, np.uint8), cv2.IMREAD_COLOR) if raw else None
    if picture is None:
        raise InputError(path, "an image", "bytes that cannot be decoded", advice="fetch it again")
    picture = np.ascontiguousarray(picture[..., ::-1])
    if uv is not None and uv.min() > -0.01 and uv.max() < 1.01:
        used = np.zeros(picture.shape[:2], np.float32)
        shell_kernels.cover(uv, used)
        picture = fill_gaps(picture, used)
    return pyramid(picture)


def fill_gaps(picture: UInt8[np.ndarray, "h w 3"], used: Float32[np.ndarray, "h w"]) -> UInt8[np.ndarray, "h w 3"]:
    """The image with unused pixels (0) replaced by the mean of nearby used ones (1)."""
    if used.all() or not used.any():
        return picture
    sums, weights = [picture * used[..., None]], [used]
    while max(weights[-1].shape) > 1:
        height, width = (max(1, (side + 1) // 2) for side in weights[-1].shape)
        sums.append(cv2.resize(sums[-1], (width, height), interpolation=cv2.INTER_AREA))
        weights.append(cv2.resize(weights[-1], (width, height), interpolation=cv2.INTER_AREA))
    filled = sums[-1] / max(float(weights[-1].max()), 1e-9)
    for total, weight in zip(sums[-2::-1], weights[-2::-1], strict=True):
        coarse = cv2.resize(filled, weight.shape[::-1], interpolation=cv2.INTER_LINEAR).reshape(*weight.shape, 3)
        known = weight[..., None] > 1e-6
        filled = np.where(known, total / np.maximum(weight[..., None], 1e-6), coarse).astype(np.float32)
    return np.where(used[..., None] > 0, picture, np.clip(np.round(filled), 0, 255)).astype(np.uint8)


def pack(pyramids: Sequence[Pyramid]) -> Pack:
    """Concatenate any number of pyramids, including none."""
    starts = np.cumsum([0, *(len(p.pixels) for p in pyramids)])
    table = [(start, *p.size, max(p.size).bit_length()) for start, p in zip(starts, pyramids, strict=False)]
    pixels = np.concatenate([p.pixels for p in pyramids]) if pyramids else np.zeros((1, 3), np.uint8)
    means = _LINEAR[np.array([p.pixels[-1] for p in pyramids], np.uint8).reshape(-1, 3)]
    return Pack(pixels, np.array(table, dtype=np.int64).reshape(-1, 4), means.astype(np.float64))


def _linear_to_srgb() -> np.ndarray:
    value = (np.arange(4096) + 0.5) / 4096
    coded = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1 / 2.4) - 0.055)
    return np.round(255 * coded).astype(np.uint8)


_LINEAR, _CODED = LINEAR.astype(np.float32), _linear_to_srgb()


def _encoded(light: np.ndarray) -> UInt8[np.ndarray, "h w 3"]:
    coded = _CODED[np.minimum((light * 4096).astype(np.int64), 4095)]
    return coded.reshape(*light.shape[:2], 3)

"""Black borders of photos, as undistortion leaves them: pixels at the edge of an image that no light reached."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float32, UInt8

BLACK = 20
"""A pixel of a border is at most this bright in each channel, 0..255: compression leaves it not quite black."""

BLACKEST = 8
"""Where a border meets the edge of the image, it is at most this bright on average, which few dark things are."""

LIT = 40
"""The photo begins with a pixel at least this bright: black to lit within `STEP` pixels is the edge of a border, not of a shadow."""

STEP = 3
"""Interpolation and compression soften the edge of a border over this many pixels, which are hidden with it [px]."""

WIDEST = 1 / 16
"""A border takes at most this share of an image's height or width on each side."""

NARROW = 1 / 8
"""Black things at the edge that are narrower than this share of the side do not widen its border."""

LEAST, SHARE, WHOLE = 1 / 8, 0.7, 0.95
"""Two sides have a border if it is found along `LEAST` of each and `SHARE` of what is lit there; one alone needs half of it and `WHOLE`."""

WIDEST_BAR = 0.35
"""Bars above and below a film, or beside it, take at most this share of the image each."""

EVEN = 3
"""The two bars of a film differ by at most this much [px]."""


def find_border(image: UInt8[np.ndarray, "h w 3"]) -> Bool[np.ndarray, "h w"] | None:
    """The black border of a photo: True at its pixels; None if there is none.

    Each line of pixels from a side inwards speaks for a border if it begins black and is lit soon after, and against one if it begins lit.
    Lines that stay dark say nothing, so neither a dark room nor a black object at the edge is a border. A border's width in dark lines is
    that of the lit lines around. Only the two bars of a film may be wider than `WIDEST`; they are equal and straight.

    Args:
        image: RGB.
    """
    sides = [_find_side(np.rot90(image, turns)) for turns in range(4)]  # each side in turn becomes the left one
    several = sum(side is not None for side in sides) > 1
    hidden = np.zeros(image.shape[:2], np.bool_)
    for turns, side in enumerate(sides):
        if side is not None and (several or side.alone):
            part = np.rot90(hidden, turns)
            part |= np.arange(np.size(part, 1)) < side.widths[:, None]
    for turns in range(2):
        part = np.rot90(hidden, turns)
        if bars := _find_bars(np.rot90(image, turns)):
            part[: bars[0]] = part[len(part) - bars[1] :] = True
    return hidden if hidden.any() else None


@dataclass(frozen=True)
class _Side:
    """The border at the left side of an image: its width in each line, and whether it is certain without another side's."""

    widths: Float32[np.ndarray, " n"]
    alone: bool


def _find_side(image: UInt8[np.ndarray, "h w 3"]) -> _Side | None:
    """The border at the left side of an image; None if there is none."""
    most = round(WIDEST * image.shape[1])
    dark_edge = (image[:, 0] <= BLACK).all(-1)
    if most < 1 or dark_edge.mean() < LEAST:
        return None
    lines = image[:, : most + STEP].max(-1)
    dark = lines <= BLACK
    width = np.where(dark.all(1), dark.shape[1], dark.argmin(1))
    after = np.minimum(width[:, None] + np.arange(STEP), lines.shape[1] - 1)
    lit = np.take_along_axis(lines, after, 1).max(1) >= LIT
    border, bare = lit & (width > 0) & (width <= most), lit & (width == 0)
    share = border.sum() / max(1, border.sum() + bare.sum())
    if border.mean() < LEAST or share < SHARE or lines[border, 0].mean() > BLACKEST:
        return None
    at = np.flatnonzero(border | bare)
    found = np.interp(np.arange(len(lines)), at, np.where(border, width, 0)[at]).astype(np.float32)
    smooth = cv2.medianBlur(found[:, None], 5)
    smooth = cv2.morphologyEx(smooth, cv2.MORPH_OPEN, np.ones((max(1, round(NARROW * len(lines))), 1), np.uint8))[:, 0]
    return _Side(np.where(smooth > 0, np.ceil(smooth) + STEP, 0), bool(share >= WHOLE and border.mean() >= 0.5))


def _find_bars(image: UInt8[np.ndarray, "h w 3"]) -> tuple[int, int] | None:
    """How many rows the bars above and below a film take, with the step behind them; None if there are none."""
    if (image[[0, -1]] > BLACK).any(-1).mean(1).max() > 1 - WHOLE:
        return None  # as in almost all photos, which are not read through
    height = len(image)
    is_black = (image <= BLACK).all(-1).mean(1) >= WHOLE
    is_lit = (image.max(-1) >= LIT).mean(1) >= 0.5
    bars = []
    for side in (slice(None), slice(None, None, -1)):
        width = height if is_black.all() else int(is_black[side].argmin())
        if not WIDEST * height < width <= WIDEST_BAR * height:
            return None
        if not is_lit[side][width : width + STEP].any() or image[side][:width].mean() > BLACKEST:
            return None
        bars.append(width)
    return (bars[0] + STEP, bars[1] + STEP) if abs(bars[0] - bars[1]) <= EVEN else None

"""How notebooks show an object (`_repr_html_`): a few lines of text and strips of small images."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from jaxtyping import Float, UInt8

from semgs.files.images.colours import (
    Colour,
    NamedColours,
    class_colours,
    depth_limits,
    depth_palette,
    depth_picture,
    hatching,
)
from semgs.files.images.pictures import png_bytes

MOST = 6
"""At most this many images in a strip."""

LONGEST = 240
"""Longest side of an image; larger ones are subsampled [px]."""


@dataclass(frozen=True)
class Strip:
    """Images side by side.

    Attributes:
        name: what they show.
        pictures: uint8 RGB.
        note: how to read them, and how many there are in all.
        legend: names of colours.
    """

    name: str
    pictures: tuple[np.ndarray, ...]
    note: str = ""
    legend: tuple[tuple[str, Colour], ...] = ()


def photo_row(name: str, images: Float[np.ndarray, "*batch 3 h w"]) -> Strip:
    """RGB images in 0..1; other values are clipped."""
    shown, note = _first(images, 3)
    return Strip(
        name, tuple(np.rint(255 * image.clip(0, 1)).astype(np.uint8).transpose(1, 2, 0) for image in shown), note
    )


def class_row(name: str, labels: UInt8[np.ndarray, "*batch h w"], classes: NamedColours | None) -> Strip:
    """Class maps with a legend; pixels without a class (255) are hatched. Without a class table, classes are numbered."""
    shown, note = _first(labels, 2)
    found = [int(label) for label in np.unique(shown) if label < 255]
    names, colours = _numbered(found) if classes is None else (classes.names, classes.colours)
    pictures = tuple(class_colours(one, colours, hatching(one.shape)) for one in shown)
    return Strip(name, pictures, note, tuple((names[label], colours[label]) for label in found))


def depth_row(name: str, depths: Float[np.ndarray, "*batch h w"]) -> Strip:
    """Depth maps on one colour scale, red is near; unknown depth (0) is grey."""
    shown, note = _first(depths, 2)
    low, high = limits = depth_limits(shown)
    reading = f"red {low:.3g} to blue {high:.3g}" + (f"; {note}" if note else "")
    return Strip(name, tuple(depth_picture(one, limits) for one in shown), reading)


def html(text: str, rows: Iterable[Strip]) -> str:
    """The text, and the strips below it."""
    return f"<pre>{escape(text)}</pre>" + "".join(_row(one) for one in rows)


def subsample(picture: np.ndarray) -> np.ndarray:
    """Every k-th row and column of an image [h w ...], so that no side is longer than `LONGEST`."""
    step = -(-max(picture.shape[:2]) // LONGEST)
    return picture[::step, ::step]


def _first(maps: np.ndarray, axes: int) -> tuple[np.ndarray, str]:
    """The first few maps, leading axes flattened, and a note if there are more; each map has `axes` axes."""
    every = maps.reshape(-1, *maps.shape[-axes:])
    return every[:MOST], f"the first {MOST} of {len(every)}" if len(every) > MOST else ""


def _numbered(labels: Sequence[int]) -> tuple[tuple[str, ...], tuple[Colour, ...]]:
    """Names and colours for classes without a table, up to the largest label."""
    count = max(labels, default=-1) + 1
    places = np.linspace(0, 255, count).astype(int)
    return tuple(f"class {label}" for label in range(count)), tuple(map(tuple, depth_palette()[places].tolist()))


def _row(row: Strip) -> str:
    """A strip as HTML with embedded images."""
    pictures = "".join(
        f'<img src="data:image/png;base64,{base64.b64encode(png_bytes(subsample(one))).decode()}" style="margin-right:4px">'
        for one in row.pictures
        if one.size
    )
    legend = "".join(
        f'<span style="background:rgb{colour};padding:0 6px;margin-right:4px">&nbsp;</span>{escape(name)} &ensp;'
        for name, colour in row.legend
    )
    note = f" ({escape(row.note)})" if row.note else ""
    return f"<div><b>{escape(row.name)}</b>{note}<br>{pictures}<div>{legend}</div></div>"

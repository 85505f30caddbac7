"""The HTML page of every command: one file that needs no network, made of headings, facts, tables and pictures."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from jaxtyping import UInt8

from semgs.figures.classes import LegendEntry
from semgs.figures.numbers import percent
from semgs.files.colours import HATCH
from semgs.files.pictures import jpeg_bytes, png_bytes
from semgs.files.text import printable

QUALITY = 90
"""Of JPEGs in a page."""

RARE = 0.01
"""Classes with less than this share of the pixels are folded into one line."""


@dataclass(frozen=True)
class Headline:
    """A number to be seen first: its value as text, and what it is."""

    value: str
    name: str


@dataclass(frozen=True)
class Facts:
    """Pairs of a name and what is to say of it."""

    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Table:
    """A table of texts; numbers stand at the right."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A picture and the line below it.

    Attributes:
        pixels: uint8 [h w 3], RGB.
        caption: what it shows.
        lossy: whether it may be a JPEG, which makes a page of many photos a fifth as large.
    """

    pixels: UInt8[np.ndarray, "h w 3"]
    caption: str
    lossy: bool = False

    @property
    def uri(self) -> str:
        """The picture inside a URI."""
        form, data = ("jpeg", jpeg_bytes(self.pixels, QUALITY)) if self.lossy else ("png", png_bytes(self.pixels))
        return f"data:image/{form};base64," + base64.b64encode(data).decode()


@dataclass(frozen=True)
class Gallery:
    """Pictures side by side under a small heading: one view of the scene.

    Attributes:
        heading: which view.
        detail: a few words behind it.
        pictures: equally large.
        more: further pictures, folded until the reader opens them.
    """

    heading: str
    detail: str
    pictures: tuple[Picture, ...]
    more: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class Legend:
    """Class colours and their names, and the hatching where `unseen` is a share above 0; rare classes are folded."""

    entries: tuple[LegendEntry, ...]
    unseen: float = 0.0

    @property
    def common(self) -> tuple[LegendEntry, ...]:
        """The classes with a share of at least `RARE`."""
        return tuple(entry for entry in self.entries if entry.share >= RARE)

    @property
    def rare(self) -> tuple[LegendEntry, ...]:
        """The others."""
        return tuple(entry for entry in self.entries if entry.share < RARE)


@dataclass(frozen=True)
class Scale:
    """A bar of colours and the numbers along it, evenly spaced from its left end to its right."""

    bar: Picture
    ticks: tuple[str, ...]
    label: str


@dataclass(frozen=True)
class Bar:
    """A horizontal bar.

    Attributes:
        name: at its left.
        colour: sRGB, 0..255.
        share: its length, 0..1.
        text: at its right.
        mark: where a tick crosses it, 0..1, or None.
    """

    name: str
    colour: tuple[int, int, int]
    share: float
    text: str
    mark: float | None = None


@dataclass(frozen=True)
class Bars:
    """Bars below each other, on one scale from 0 to 1; those of rare classes are folded."""

    bars: tuple[Bar, ...]
    rare: tuple[Bar, ...] = ()


@dataclass(frozen=True)
class Matrix:
    """A table of shares as shaded cells.

    Attributes:
        rows, columns: names.
        shares: 0..1, a row of cells for each row.
        corner: what rows and columns are.
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    shares: tuple[tuple[float, ...], ...]
    corner: str


@dataclass(frozen=True)
class Notes:
    """Sentences that the reader must not miss."""

    sentences: tuple[str, ...]


@dataclass(frozen=True)
class Link:
    """A file or folder beside the page.

    Attributes:
        name: relative to the page's folder; a folder ends with a slash.
        text: what it is.
    """

    name: str
    text: str


@dataclass(frozen=True)
class Links:
    """Files beside the page."""

    files: tuple[Link, ...]


Block = Facts | Table | Gallery | Legend | Scale | Bars | Matrix | Notes | Links


@dataclass(frozen=True)
class Section:
    """A part of a page.

    Attributes:
        heading: of the part.
        lead: a sentence or two, or nothing.
        blocks: its content.
        folded: whether it is closed until the reader opens it.
    """

    heading: str
    lead: str
    blocks: tuple[Block, ...]
    folded: bool = False


def html_page(title: str, lead: str, headlines: Sequence[Headline], sections: Sequence[Section], foot: str) -> str:
    """One self-contained HTML page: style and pictures are inside and nothing is loaded; a script enlarges pictures.

    Args:
        title: of the page.
        lead: a sentence below it.
        headlines: the few numbers shown large.
        sections: the parts, in order.
        foot: the last line.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, finalize=_shown, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = files("semgs.figures").joinpath("templates/page.html.j2").read_text(encoding="utf-8")
    return environment.from_string(template).render(
        title=title, lead=lead, headlines=headlines, sections=sections, foot=foot, hatch=HATCH, percent=percent,
        kind=lambda block: type(block).__name__.lower(),
    )  # fmt: skip


def _shown(value: Any) -> Any:
    """A value as the page has it: text (but none that is HTML already) without control characters."""
    return printable(value) if type(value) is str else value

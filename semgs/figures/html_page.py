"""Building blocks of HTML reports. A page is one file that needs no network."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from jaxtyping import UInt8

from semgs.figures.class_images import UNKNOWN_GREY, LegendEntry
from semgs.files.images.colours import HATCH
from semgs.files.images.pictures import jpeg_bytes, png_bytes
from semgs.files.text import percent, printable

QUALITY = 90
"""JPEG quality in a page."""

RARE = 0.01
"""Classes with a smaller share of the pixels are folded into one line."""


@dataclass(frozen=True)
class Headline:
    """A number shown large at the top: its value as text, what it is, and a sentence that explains it when the mouse is over it."""

    value: str
    name: str
    meaning: str = ""


@dataclass(frozen=True)
class Facts:
    """Pairs of name and text."""

    rows: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Table:
    """A table of texts; numbers are right-aligned. `meanings` explains each column when the mouse is over its head; empty for none."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    meanings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Picture:
    """An image and its caption.

    Attributes:
        pixels: uint8 [h w 3], RGB.
        caption: a line below the image.
        lossy: store it as JPEG, which makes a page of many photos five times smaller.
    """

    pixels: UInt8[np.ndarray, "h w 3"]
    caption: str
    lossy: bool = False

    @property
    def uri(self) -> str:
        """The image as a data URI."""
        form, data = ("jpeg", jpeg_bytes(self.pixels, QUALITY)) if self.lossy else ("png", png_bytes(self.pixels))
        return f"data:image/{form};base64," + base64.b64encode(data).decode()


@dataclass(frozen=True)
class Gallery:
    """Images side by side under a small heading: one view of the scene.

    Attributes:
        heading: which view.
        detail: a few words after the heading.
        pictures: of equal size.
        more: further images, folded until the reader opens them.
    """

    heading: str
    detail: str
    pictures: tuple[Picture, ...]
    more: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class Plot:
    """A plot with its caption."""

    picture: Picture


@dataclass(frozen=True)
class Legend:
    """Class colours and names, plus the hatching of unseen pixels and the grey of unknown ones if their share of the pixels is above 0; rare classes
    are folded."""

    entries: tuple[LegendEntry, ...]
    unseen: float = 0.0
    unknown: float = 0.0

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
    """A colour bar with evenly spaced numbers from its left to its right end."""

    bar: Picture
    ticks: tuple[str, ...]
    label: str


@dataclass(frozen=True)
class Bar:
    """A horizontal bar.

    Attributes:
        name: on the left.
        colour: sRGB, 0..255.
        share: length, 0..1.
        text: on the right.
        mark: position of a tick, 0..1, or None.
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
        shares: 0..1, by row and column.
        corner: text of the upper left cell, which explains rows and columns.
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    shares: tuple[tuple[float, ...], ...]
    corner: str


@dataclass(frozen=True)
class Notes:
    """Important notes, a sentence each."""

    sentences: tuple[str, ...]


@dataclass(frozen=True)
class Link:
    """A file or folder in the folder of the page.

    Attributes:
        name: its path; a folder ends with a slash.
        text: what it is.
    """

    name: str
    text: str


@dataclass(frozen=True)
class Links:
    """Links to files in the folder of the page."""

    files: tuple[Link, ...]


Block = Facts | Table | Gallery | Plot | Legend | Scale | Bars | Matrix | Notes | Links


@dataclass(frozen=True)
class Section:
    """A section of a page.

    Attributes:
        heading: of the section.
        lead: a sentence or two, or "".
        blocks: the content.
        folded: closed until the reader opens it.
    """

    heading: str
    lead: str
    blocks: tuple[Block, ...]
    folded: bool = False


def html_page(
    title: str,
    lead: str,
    headlines: Sequence[Headline],
    sections: Sequence[Section],
    foot: str,
    *,
    first: Gallery | None = None,
    link: Link | None = None,
) -> str:
    """One self-contained HTML page: style and images are inside, nothing is loaded, and a script enlarges images.

    Args:
        title: of the page.
        lead: a sentence below the title.
        headlines: numbers shown large.
        sections: in order.
        foot: the last line.
        first: images above the numbers.
        link: a button below the title.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, finalize=_shown, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = files("semgs.figures").joinpath("templates/page.html.j2").read_text(encoding="utf-8")
    return environment.from_string(template).render(
        title=title, lead=lead, headlines=headlines, sections=sections, foot=foot, first=first, link=link, hatch=HATCH, grey=UNKNOWN_GREY, percent=percent,
        kind=lambda block: type(block).__name__.lower(),
    )  # fmt: skip


def _shown(value: Any) -> Any:
    """A value as shown in the page: plain text without control characters; HTML is unchanged."""
    return printable(value) if isinstance(value, str) and not hasattr(value, "__html__") else value

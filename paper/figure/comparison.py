"""Comparison figures as in papers: blocks of image rows under headings, with a legend of classes below."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from semgs.figures.class_images import LegendEntry
from semgs.figures.plotting import as_written, make_rectangle, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Form = Literal["png", "pdf"]

GAP = 0.04
"""Between images [inch]."""
BETWEEN_BLOCKS = 0.3
"""Between blocks; contains the title of a block [inch]."""
CELL = 1.6
"""Width of a landscape image [inch]; 320 pixels at 200 dots per inch."""
MARGIN = 0.06
CAPTION_LINE = 0.14
"""Height of a caption [inch]."""
TITLE, HEADING, CAPTION, LABEL, LEGEND = 8.0, 7.0, 6.5, 5.0, 6.0
"""Font sizes [points]."""
POINTS, CHARACTER = 72.0, 0.68
"""Points per inch, and an upper bound for the mean width of a character, relative to the font size."""
LEGEND_LINE = 0.16
"""Height of a line of the legend [inch]."""
ENTRY = 0.85
"""Width of an entry of the legend [inch]."""


@dataclass(frozen=True, eq=False)
class PictureRow:
    """A row of images.

    Attributes:
        label: in small letters on the left.
        pictures: RGB, one for each heading; None leaves a gap.
        caption: a line below the images; "" for none.
    """

    label: str
    pictures: tuple[UInt8[np.ndarray, "_ _ 3"] | None, ...]
    caption: str = ""


@dataclass(frozen=True, eq=False)
class FigureBlock:
    """Rows under the same headings.

    Attributes:
        title: of the block; "" for none.
        headings: of the columns.
        rows: each with one image per heading.
    """

    title: str
    headings: tuple[str, ...]
    rows: tuple[PictureRow, ...]

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row.pictures) != len(self.headings):
                raise ValueError(f"{row.label} has {len(row.pictures)} pictures for {len(self.headings)} headings")
            if all(picture is None for picture in row.pictures):
                raise ValueError(f"{row.label} has no picture at all")


def mosaic(pictures: Sequence[UInt8[np.ndarray, "h w 3"]], gap: int = 4) -> UInt8[np.ndarray, "rows columns 3"]:
    """Several images of one size in the space of one: two below each other, up to four in two rows, each at half its size.

    Args:
        pictures: at least one.
        gap: white pixels between them.

    Raises:
        ValueError: there are none, or they differ in size.
    """
    if not pictures or len({picture.shape for picture in pictures}) != 1:
        raise ValueError(f"pictures are {[picture.shape for picture in pictures]}; expected one size")
    if len(pictures) == 1:
        return pictures[0]
    height, width = pictures[0].shape[:2]
    rows = max(2, int(np.ceil(np.sqrt(len(pictures)))))
    columns = -(-len(pictures) // rows)
    small = ((width - gap * (rows - 1)) // rows, (height - gap * (rows - 1)) // rows)
    sheet = np.full((height, columns * small[0] + gap * (columns - 1), 3), 255, np.uint8)
    for number, picture in enumerate(pictures):
        row, column = number // columns, number % columns
        top, left = row * (small[1] + gap), column * (small[0] + gap)
        sheet[top : top + small[1], left : left + small[0]] = np.asarray(
            Image.fromarray(picture).resize(small, Image.Resampling.BOX)
        )
    return sheet


def comparison(
    blocks: Sequence[FigureBlock],
    legend: Sequence[LegendEntry] = (),
    *,
    beside: bool = False,
    forms: Sequence[Form] = ("png",),
) -> dict[Form, bytes]:
    """A figure of blocks in several file formats; the same input gives the same bytes.

    Args:
        blocks: below each other or, with `beside`, side by side.
        legend: colours and names, the most frequent first.
        beside: place the blocks side by side.
        forms: PNG (images 320 pixels wide are not resampled) or PDF.

    Raises:
        ValueError: there is no image.
    """
    if not any(block.rows for block in blocks):
        raise ValueError("no pictures to compare")
    places = [_Grid(block) for block in blocks]
    if beside:
        width = sum(grid.width for grid in places) + BETWEEN_BLOCKS * (len(places) - 1)
        height = max(grid.height for grid in places)
    else:
        width, height = max(grid.width for grid in places), sum(grid.height for grid in places)
    below = _legend_height(legend, width)
    figure = new_figure((width + 2 * MARGIN, height + below + 2 * MARGIN))
    left, top = MARGIN, MARGIN
    for grid in places:
        grid.draw(figure, left, top)
        if beside:
            left += grid.width + BETWEEN_BLOCKS
        else:
            top += grid.height
    _draw_legend(figure, legend, width, below)
    return {form: _saved(figure, form) for form in forms}


class _Grid:
    """The layout of a block [inch]."""

    def __init__(self, block: FigureBlock) -> None:
        self._block = block
        self._title = BETWEEN_BLOCKS if block.title else 0.0
        widest = max(picture.shape[1] for row in block.rows for picture in row.pictures if picture is not None)
        self._scale = CELL / widest
        columns = zip(*(row.pictures for row in block.rows), strict=True)
        self._widths = [
            self._scale * max((one.shape[1] for one in column if one is not None), default=widest) for column in columns
        ]
        self._heights = [
            self._scale * max(one.shape[0] for one in row.pictures if one is not None) for row in block.rows
        ]
        self._captions = [CAPTION_LINE if row.caption else 0.0 for row in block.rows]
        self._left, self._top = 0.12, self._title + 0.16
        self.width = self._left + sum(self._widths) + GAP * (len(self._widths) - 1)
        self.height = self._top + sum(self._heights) + sum(self._captions) + GAP * len(self._heights)

    def draw(self, figure: Figure, left: float, top: float) -> None:
        """Add the block to a figure, with its upper left corner at (left, top)."""
        width, height = figure.get_size_inches()

        def text(x: float, y: float, words: str, size: float, **options: Any) -> None:
            figure.text(x / width, 1 - y / height, as_written(words), fontsize=size, **options)

        middle = left + self._left + (self.width - self._left) / 2
        if self._block.title:
            text(middle, top + 0.6 * self._title, self._block.title, TITLE, ha="center", va="center", weight="bold")
        y = top + self._top
        for row, tall, below in zip(self._block.rows, self._heights, self._captions, strict=True):
            words = _shortened(row.label, tall)
            text(left + 0.05, y + tall / 2, words, LABEL, ha="center", va="center", rotation=90, color="0.35")
            x = left + self._left
            for picture, wide in zip(row.pictures, self._widths, strict=True):
                if picture is not None:
                    _place(figure, picture, (x, y, wide, tall), self._scale)
                x += wide + GAP
            text(left + self._left, y + tall + below / 2, row.caption, CAPTION, va="center_baseline")
            y += tall + below + GAP
        x = left + self._left
        for heading, wide in zip(self._block.headings, self._widths, strict=True):
            text(x + wide / 2, top + self._top - 0.03, heading, HEADING, ha="center", va="bottom")
            x += wide + GAP


def _shortened(label: str, room: float) -> str:
    """The end of a label, as long as fits next to an image of that height [inch]."""
    fitting = max(int(room * POINTS / (CHARACTER * LABEL)), 2)
    return label if len(label) <= fitting else "…" + label[1 - fitting :]


def _place(figure: Figure, picture: np.ndarray, box: tuple[float, float, float, float], scale: float) -> None:
    """Add an image in the middle of a box (left, top, width, height) [inch], at `scale` inches per pixel."""
    width, height = figure.get_size_inches()
    left, top, wide, tall = box
    own = picture.shape[1] * scale, picture.shape[0] * scale
    x, y = left + (wide - own[0]) / 2, top + (tall - own[1]) / 2
    axes = figure.add_axes((x / width, 1 - (y + own[1]) / height, own[0] / width, own[1] / height))
    axes.imshow(picture, interpolation="nearest", aspect="auto")
    axes.set_axis_off()


def _legend_columns(width: float) -> int:
    """Number of legend entries per line."""
    return max(1, int(width // ENTRY))


def _legend_height(legend: Sequence[LegendEntry], width: float) -> float:
    """Height of the legend [inch]."""
    return LEGEND_LINE * -(-len(legend) // _legend_columns(width)) + (0.06 if legend else 0)


def _draw_legend(figure: Figure, legend: Sequence[LegendEntry], width: float, below: float) -> None:
    """Add colour patches with their names at the bottom."""
    whole, height = figure.get_size_inches()
    columns = _legend_columns(width)
    start = (whole - ENTRY * min(columns, len(legend))) / 2
    for number, entry in enumerate(legend):
        x = start + ENTRY * (number % columns)
        y = MARGIN + below - 0.06 - LEGEND_LINE * (number // columns + 1)
        colour = tuple(value / 255 for value in entry.colour)
        figure.add_artist(
            make_rectangle(
                (x / whole, (y + 0.02) / height),
                0.12 / whole,
                0.1 / height,
                facecolor=colour,
                edgecolor="0.4",
                linewidth=0.3,
            )
        )
        figure.text((x + 0.16) / whole, (y + 0.07) / height, as_written(entry.name), fontsize=LEGEND, va="center")


def _saved(figure: Figure, form: Form) -> bytes:
    """The bytes of a figure, without a date."""
    buffer = io.BytesIO()
    undated = {"png": {"Software": None}, "pdf": {"CreationDate": None, "Producer": None, "Creator": None}}[form]
    figure.savefig(buffer, format=form, dpi=200, metadata=undated)
    return buffer.getvalue()

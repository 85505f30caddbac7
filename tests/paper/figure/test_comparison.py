"""Figures that compare: every picture keeps its pixels and its place, and the same input gives the same bytes."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from paper.figure.comparison import FigureBlock, PictureRow, comparison, mosaic
from semgs.figures.class_images import LegendEntry

SIZE = (60, 80)


def picture(colour: tuple[int, int, int], size: tuple[int, int] = SIZE) -> np.ndarray:
    return np.broadcast_to(np.array(colour, np.uint8), (*size, 3)).copy()


def opened(content: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(content)).convert("RGB"))


def places(sheet: np.ndarray, colour: tuple[int, int, int]) -> tuple[float, float, int]:
    """Where a colour is on a sheet (row, column), and on how many pixels."""
    rows, columns = np.nonzero((sheet == np.array(colour)).all(-1))
    return float(rows.mean()), float(columns.mean()), len(rows)


RED, GREEN, BLUE, PINK = (200, 10, 20), (10, 200, 30), (30, 20, 210), (240, 120, 180)


def test_rows_go_down_and_columns_to_the_right_and_all_have_their_size():
    rows = (PictureRow("a/1", (picture(RED), picture(GREEN))), PictureRow("a/2", (picture(BLUE), None)))
    sheet = opened(comparison([FigureBlock("", ("one", "two"), rows)])["png"])
    (red, green, blue) = (places(sheet, colour) for colour in (RED, GREEN, BLUE))
    assert red[0] == pytest.approx(green[0])
    assert red[1] < green[1]
    assert red[1] == pytest.approx(blue[1])
    assert red[0] < blue[0]
    assert red[2] == pytest.approx(320 * 240, rel=0.03)  # 1.6 inches of 200 dots
    assert blue[2] == pytest.approx(green[2], rel=0.03)


def test_blocks_stand_below_each_other_or_side_by_side():
    one, two = (
        FigureBlock(name, ("x",), (PictureRow("r", (picture(colour),)),)) for name, colour in (("A", RED), ("B", BLUE))
    )
    for beside in (False, True):
        sheet = opened(comparison([one, two], beside=beside)["png"])
        first, second = places(sheet, RED), places(sheet, BLUE)
        assert (first[1] < second[1] - 300) == beside
        assert (first[0] < second[0] - 200) != beside


def test_the_legend_shows_every_colour_and_makes_room_for_itself():
    block = FigureBlock("", ("x",), (PictureRow("r", (picture(RED),)),))
    without = opened(comparison([block])["png"])
    entries = [LegendEntry("sofa", GREEN, 0.9), LegendEntry("table", BLUE, 0.1)]
    sheet = opened(comparison([block], entries)["png"])
    assert sheet.shape[0] > without.shape[0]
    for colour in (GREEN, BLUE):
        assert places(sheet, colour)[2] > 50
        assert places(sheet, colour)[0] > places(sheet, RED)[0]


def test_the_same_figure_is_the_same_bytes_in_every_form():
    block = FigureBlock("t", ("x",), (PictureRow("r", (picture(RED),)),))
    first, second = (comparison([block], forms=("png", "pdf")) for _ in range(2))
    assert first == second
    assert first["pdf"].startswith(b"%PDF")


def test_a_mosaic_takes_no_more_place_than_one_picture_and_shows_all():
    colours = (RED, GREEN, BLUE, PINK)
    for count in (1, 2, 3, 4):
        sheet = mosaic([picture(colour) for colour in colours[:count]])
        assert sheet.shape[0] == SIZE[0]
        assert sheet.shape[1] <= SIZE[1]
        for colour in colours[:count]:
            assert places(sheet, colour)[2] >= (SIZE[0] // 2 - 2) * (SIZE[1] // 2 - 2)
    two = mosaic([picture(RED), picture(GREEN)])
    assert places(two, RED)[0] < places(two, GREEN)[0]


def test_what_cannot_be_drawn_is_refused():
    with pytest.raises(ValueError, match="2 pictures for 1 headings"):
        FigureBlock("", ("x",), (PictureRow("r", (picture(RED), picture(RED))),))
    with pytest.raises(ValueError, match="no picture at all"):
        FigureBlock("", ("x",), (PictureRow("r", (None,)),))
    with pytest.raises(ValueError, match="no pictures to compare"):
        comparison([])
    with pytest.raises(ValueError, match="expected one size"):
        mosaic([picture(RED), picture(RED, (10, 10))])


def test_a_long_label_stays_beside_its_own_row():
    labels = ("recording/" + 9 * "0123456789" + "w", "recording/" + 9 * "0123456789")
    rows = tuple(PictureRow(label, (picture(RED),)) for label in labels)
    sheet = opened(comparison([FigureBlock("", ("x",), rows)])["png"])
    gap = np.nonzero((sheet == np.array(RED)).all(-1).any(1))[0]
    (between,) = np.nonzero(np.diff(gap) > 1)[0]
    beside = np.nonzero((sheet == np.array(RED)).all(-1).any(0))[0][0]
    assert (sheet[gap[between] + 1 : gap[between + 1], :beside] == 255).all()
    assert (sheet[:, :beside] < 200).any()


def test_a_caption_stands_below_its_own_row_and_moves_the_next_one_down():
    def sheet(caption: str) -> np.ndarray:
        rows = (PictureRow("", (picture(RED),), caption), PictureRow("", (picture(BLUE),)))
        return opened(comparison([FigureBlock("", ("",), rows)])["png"])

    without, captioned = sheet(""), sheet("x = 1")
    assert places(captioned, RED) == places(without, RED)
    assert places(captioned, BLUE)[0] > places(without, BLUE)[0] + 20
    red, blue = ((captioned == np.array(colour)).all(-1).any(1).nonzero()[0] for colour in (RED, BLUE))
    between = captioned[red[-1] + 1 : blue[0]]
    assert (between < 128).any()
    assert (between[[0, -1]] == 255).all()

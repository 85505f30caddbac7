from __future__ import annotations

import base64
import io
import re
from html.parser import HTMLParser

import numpy as np
from PIL import Image

from semgs.figures.class_images import LegendEntry
from semgs.figures.html_page import (
    Bar,
    Bars,
    Facts,
    Gallery,
    Headline,
    Legend,
    Link,
    Links,
    Matrix,
    Notes,
    Picture,
    Plot,
    Scale,
    Section,
    Table,
    html_page,
)

VOID = {"meta", "img", "br", "hr", "link", "input"}


class Balanced(HTMLParser):
    """Collects the text, and checks that every tag is closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def page() -> str:
    pixels = np.arange(5 * 7 * 3, dtype=np.uint8).reshape(5, 7, 3)
    return html_page(
        "Room <1>",
        "a lead & more",
        [Headline("21.3 dB", "PSNR")],
        [
            Section("First", "why", (Facts((("unit", "metres"),)), Notes(("Mind the gap.",)))),
            Section(
                "Second",
                "",
                (
                    Legend((LegendEntry("chair", (188, 189, 34), 0.25),), unseen=0.1, unknown=0.07),
                    Plot(Picture(pixels, "a curve")),
                    Scale(Picture(pixels, "bar"), ("0.5 m", "9 m"), "depth"),
                    Gallery("a.jpg", "frame 3", (Picture(pixels, "photo"), Picture(pixels, "render"))),
                    Table(("view", "PSNR"), (("a", "20"), ("b", "30"))),
                    Links((Link("renders/", "pictures"),)),
                ),
            ),
        ],
        "made here",
    )


def test_the_page_is_well_formed_and_says_everything_with_markup_escaped() -> None:
    parser = Balanced()
    parser.feed(page())
    parser.close()
    assert parser.open == []
    text = " ".join(" ".join(parser.text).split())
    for part in (
        "Room <1>", "a lead & more", "21.3 dB", "Mind the gap.", "chair", "25 %", "unseen", "10 %", "unknown", "7 %", "a curve", "9 m",
        "made here",
    ):  # fmt: skip
        assert part in text
    assert "<1>" not in page()


def test_the_page_loads_nothing() -> None:
    """All that is not in the page is what the reader may click on; its one script is inside."""
    html = page()
    sources = re.findall(r'src="([^"]*)"', html)
    assert sources
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert re.findall(r'href="([^"]*)"', html) == ["renders/"]
    assert re.findall(r"<script[^>]*>", html) == ["<script>"]
    for word in ("http", "@import", "url(", "fetch(", "import("):
        assert word not in html, word


def test_files_are_links_relative_to_the_page() -> None:
    assert '<dt><a href="renders/">renders/</a></dt><dd>pictures</dd>' in page()


def folded(html: str) -> list[str]:
    """The text of each closed part of a page: its line, then what opening it shows."""
    found = re.findall(r"<details[^>]*>(.*?)</details>", html, re.DOTALL)
    return [" ".join(re.sub(r"<[^>]*>", " ", part).split()) for part in found]


def test_classes_below_one_percent_are_one_line_that_opens() -> None:
    shares = (("wall", 0.975), ("sofa", 0.01), ("bed", 0.009), ("sink", 0.006))
    legend = Legend(tuple(LegendEntry(name, (1, 2, 3), share) for name, share in shares))
    html = html_page("t", "l", [], [Section("s", "", (legend,))], "f")
    assert folded(html) == ["2 classes below 1 % bed under 1 % sink under 1 %"]
    assert html.index("sofa") < html.index("<details")
    one = Legend((LegendEntry("bed", (1, 2, 3), 0.009),))
    assert folded(html_page("t", "l", [], [Section("s", "", (one,))], "f")) == ["1 class below 1 % bed under 1 %"]
    bars = Bars((Bar("wall", (1, 2, 3), 0.5, "0.50"),), rare=(Bar("bed", (1, 2, 3), 0.25, "0.25"),))
    assert folded(html_page("t", "l", [], [Section("s", "", (bars,))], "f")) == ["1 class below 1 % bed 0.25"]


def test_further_pictures_of_a_view_are_folded_and_belong_to_it() -> None:
    pixels = np.zeros((5, 7, 3), np.uint8)
    views = [
        Gallery(name, "", (Picture(pixels, "photo"), Picture(pixels, "depth")), (Picture(pixels, "measured depth"),))
        for name in ("a.jpg", "b.jpg")
    ]
    html = html_page("t", "l", [], [Section("s", "", tuple(views))], "f")
    assert folded(html) == ["Measured depth measured depth"] * 2
    first, second = html.split('<div class="view">')[1:]
    for part, name in ((first, "a.jpg"), (second, "b.jpg")):  # what the arrow keys go through
        assert re.findall(r'alt="([^"]+)" data-view="([^"]+)"', part) == [
            ("photo", name), ("depth", name), ("measured depth", name),
        ]  # fmt: skip


def test_pictures_are_inside_the_page_to_the_last_bit() -> None:
    uri = re.findall(r'src="data:image/png;base64,([^"]*)"', page())[-1]
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(uri))))
    assert (pixels == np.arange(5 * 7 * 3, dtype=np.uint8).reshape(5, 7, 3)).all()


def test_unseen_is_in_the_legend_only_where_something_is_unseen() -> None:
    seen = html_page("t", "l", [], [Section("s", "", (Legend(()),))], "f")
    assert "unseen" not in seen


def test_bars_are_as_long_as_their_shares_with_ticks_where_they_have_one() -> None:
    bars = Bars((Bar("sofa <1>", (1, 2, 3), 0.25, "0.250", mark=0.5), Bar("bed", (4, 5, 6), 1.0, "1.000")))
    html = html_page("t", "l", [], [Section("s", "", (bars,))], "f")
    Balanced().feed(html)
    assert "sofa &lt;1&gt;" in html
    assert 'style="width: 25.0%; background: rgb(1, 2, 3)"' in html
    assert html.count('<u style="left: 50.0%"></u>') == html.count("<u ") == 1


def test_a_matrix_shows_percentages_and_leaves_what_rounds_to_nothing_empty() -> None:
    matrix = Matrix(("wall", "bed"), ("wall", "bed", "sofa"), ((0.9, 0.096, 0.004), (0.0, 1.0, 0.0)), "true and given")
    html = html_page("t", "l", [], [Section("s", "", (matrix,))], "f")
    Balanced().feed(html)
    cells = re.findall(r"<td[^>]*>(\d*)</td>", html)
    assert cells == ["90", "10", "", "", "100", ""]
    assert html.count('class="strong"') == 2


def test_a_folded_section_is_closed_until_it_is_opened_and_the_tags_are_balanced() -> None:
    sections = [Section("open", "", ()), Section("closed", "why", (Notes(("a",)),), folded=True)]
    html = html_page("t", "l", [], sections, "f")
    parser = Balanced()
    parser.feed(html)
    assert parser.open == []
    assert re.search(r"<details>\s*<summary><h2>closed</h2></summary>", html)
    assert "<details open" not in html


def test_a_lossy_picture_is_a_jpeg_close_to_its_pixels() -> None:
    rows, columns = np.indices((40, 56))
    pixels = np.stack((rows * 4, columns * 3, rows + columns), axis=-1).astype(np.uint8)
    uri = Picture(pixels, "c", lossy=True).uri
    assert uri.startswith("data:image/jpeg;base64,")
    again = np.asarray(Image.open(io.BytesIO(base64.b64decode(uri.partition(",")[2]))))
    assert np.abs(again.astype(int) - pixels).mean() < 3

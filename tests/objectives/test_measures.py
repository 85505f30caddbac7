"""Measures in words."""

from __future__ import annotations

from pathlib import Path

from semgs.evaluation.scoring.summary import METRICS
from semgs.objectives.measures import MEANINGS, TITLES, shown_number

PAGE = Path(__file__).resolve().parents[2] / "docs" / "evaluate.md"


def test_every_measure_is_in_the_table_of_the_docs_by_its_name_and_its_heading():
    rows = [line for line in PAGE.read_text().splitlines() if line.startswith("| `")]
    for name, title in TITLES.items():
        (row,) = [line for line in rows if f"`{name}`" in line.split("|")[1]]
        assert ("(seen)" if title.endswith("(seen)") else title) in row.split("|")[2], name
    assert set(METRICS) == set(TITLES) - {"fps_encoding_each"}
    assert set(MEANINGS) <= set(TITLES)


def test_numbers_read_as_their_measures_do():
    assert shown_number("psnr_seen", 19.064) == shown_number("psnr", 19.064) == "19.06"
    assert shown_number("depth_abs_rel_seen", 0.10757) == "0.108"
    assert shown_number("unseen", 0.33618) == "33.6 %"
    assert shown_number("miou_per_image", None) == "–"

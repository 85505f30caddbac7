"""The tables of the layout card."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from semgs.cli.main import main
from semgs.evaluation.tables.card import card_grids
from semgs.evaluation.tables.saved_report import read_report
from semgs.evaluation.tables.table_grid import printed
from semgs.files.errors import InputError

DOCS = Path(__file__).resolve().parents[3] / "docs"
REPORTS = sorted((DOCS / "scores").glob("*.json"))


@pytest.fixture(scope="module")
def content() -> dict:
    """One of the reports; to be copied."""
    return json.loads(REPORTS[0].read_text(encoding="utf-8"))


def test_a_row_has_its_number_interval_and_mark(content: dict, tmp_path: Path):
    entry = content["results"][0]
    changed = {
        **entry,
        "psnr": 25.118,
        "intervals": {**entry["intervals"], "psnr": [24.0, 26.5]},
        "below_copy": ["psnr"],
    }
    (tmp_path / "a.json").write_text(json.dumps({**content, "results": [changed]}))
    report = read_report(tmp_path / "a.json")
    told = printed(card_grids([report])[0], "text")
    row = next(line for line in told.splitlines() if line.startswith(content["data"]["path"]))
    assert "25.12 [24.00, 26.50]†" in row
    assert row.count("†") == 1


@pytest.mark.parametrize(
    ("units", "said"),
    [
        (["scenes", "scenes"], "intervals over scenes. The oracle"),
        (["frames"], "intervals over frames, as there are fewer than 5 scenes. The oracle"),
        (["frames", "scenes"], "intervals over scenes, or over frames where there are fewer than 5 scenes. The oracle"),
    ],
)
def test_the_note_says_over_what_the_intervals_are(content: dict, tmp_path: Path, units: list[str], said: str):
    reports = []
    for number, over in enumerate(units):
        entry = {**content["results"][0], "intervals_over": over}
        (tmp_path / f"{number}.json").write_text(json.dumps({**content, "results": [entry]}))
        reports.append(read_report(tmp_path / f"{number}.json"))
    assert said in card_grids(reports)[0].notes[0]


def test_layouts_that_need_single_targets_refuse_a_reduced_report(capsys: pytest.CaptureFixture[str]):
    first = str(REPORTS[0])
    assert main(["compare", first, first, "--layout", "difference"]) == 2
    assert "one with totals only; --layout data and card can show it" in capsys.readouterr().err
    assert main(["compare", first, "--layout", "card", "--format", "markdown"]) == 0
    assert "**Classes**" in capsys.readouterr().out


@pytest.mark.parametrize(
    "change",
    [
        {"intervals": {"psnr": ["25", "26"]}},
        {"intervals": {"psnr": [25.0]}},
        {"below_copy": [3]},
        {"per_class": [{"name": 0.5, "pixels": 3, "iou": 0.5}]},
        {"per_class": [{"name": "wall", "pixels": "3", "iou": 0.5}]},
        {"risk_coverage": [{"coverage": None}]},
        {"views": float("inf")},
    ],
)
def test_a_report_that_no_table_could_show_is_refused_when_it_is_read(content: dict, tmp_path: Path, change: dict):
    (tmp_path / "a.json").write_text(json.dumps({**content, "results": [{**content["results"][0], **change}]}))
    with pytest.raises(InputError, match=r"a\.json: expected a complete report of semgs evaluate"):
        read_report(tmp_path / "a.json")

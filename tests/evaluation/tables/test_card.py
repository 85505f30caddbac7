"""The tables of the layout card."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from semgs.cli.main import main
from semgs.evaluation.tables.card import card_grids
from semgs.evaluation.tables.evaluation_report import read_report
from semgs.evaluation.tables.grid import printed

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


def test_layouts_that_need_single_targets_refuse_a_reduced_report(capsys: pytest.CaptureFixture[str]):
    first = str(REPORTS[0])
    assert main(["compare", first, first, "--layout", "difference"]) == 2
    assert "one with totals only; --layout data and card can show it" in capsys.readouterr().err
    assert main(["compare", first, "--layout", "card", "--format", "markdown"]) == 0
    assert "**Classes**" in capsys.readouterr().out

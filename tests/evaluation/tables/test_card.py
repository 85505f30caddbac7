"""The model card: its numbers are those of the reports that are kept beside it."""

from __future__ import annotations

import json
from copy import deepcopy
from pathlib import Path

import pytest

from semgs.cli.main import main
from semgs.evaluation.tables.card import BEGIN, END, card_grids, reduced, scores_of, tables, with_tables
from semgs.evaluation.tables.grid import printed
from semgs.evaluation.tables.report import read_report
from semgs.files.errors import InputError
from semgs.weights.index import read_index
from semgs.weights.scores import Figure, read_scores

DOCS = Path(__file__).resolve().parents[3] / "docs"
REPORTS = sorted((DOCS / "scores").glob("*.json"))


def test_the_tables_of_the_card_are_those_of_the_reports_beside_it():
    card = (DOCS / "model_card.md").read_text(encoding="utf-8")
    assert REPORTS
    assert with_tables(card, tables(DOCS / "scores")) == card, "run python scripts/write_card.py"


@pytest.mark.parametrize("path", REPORTS, ids=lambda path: path.stem)
def test_the_reports_are_of_weights_that_ship_and_small(path: Path):
    known = {one.sha256 for one in read_index()}
    known |= {score.sha256 for one in read_index() for score in read_scores(one.path)}
    assert read_report(path).sha256 in known
    assert path.stat().st_size < 60_000


def test_the_scores_in_a_header_are_those_of_the_reports():
    for one in read_index():
        for score in read_scores(one.path):
            assert score in [other for path in REPORTS for other in scores_of(read_report(path))]


@pytest.fixture(scope="module")
def content() -> dict:
    """One of the reports; to be copied."""
    return json.loads(REPORTS[0].read_text(encoding="utf-8"))


def test_a_number_that_changes_changes_the_tables(content: dict, tmp_path: Path):
    (tmp_path / "a.json").write_text(json.dumps(content))
    before = tables(tmp_path)
    for change in (
        lambda entry: entry.update(psnr=entry["psnr"] + 0.01),
        lambda entry: entry["intervals"]["miou"].__setitem__(1, 0.999),
        lambda entry: entry["per_class"][3].update(iou=0.777),
    ):
        other = deepcopy(content)
        change(other["results"][0])
        (tmp_path / "a.json").write_text(json.dumps(other))
        assert tables(tmp_path) != before


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
    (score,) = scores_of(report)
    assert (score.targets, score.figures["psnr"]) == (entry["samples"], Figure(25.118, 24.0, 26.5))


def test_a_reduced_report_says_the_same_in_total_and_nothing_of_single_targets(content: dict, tmp_path: Path):
    whole = deepcopy(content)
    whole["data"]["path"] = "/somewhere/val24"
    whole["frames"]["scenes"][0]["samples"] = [{"target": "a", "contexts": ["b", "c"]}]
    assert reduced(whole, content["data"]["path"]) == content
    assert whole["data"]["path"] == "/somewhere/val24"


def test_layouts_that_need_single_targets_refuse_a_reduced_report(capsys: pytest.CaptureFixture[str]):
    first = str(REPORTS[0])
    assert main(["compare", first, first, "--layout", "difference"]) == 2
    assert "one reduced to its totals; --layout data and card can show it" in capsys.readouterr().err
    assert main(["compare", first, "--layout", "card", "--format", "markdown"]) == 0
    assert "**Classes**" in capsys.readouterr().out


@pytest.mark.parametrize("page", ["", BEGIN, f"{END}\n{BEGIN}", f"{BEGIN}{END}{BEGIN}{END}", f"{BEGIN}{BEGIN}{END}"])
def test_a_page_without_its_marks_is_refused(page: str):
    with pytest.raises(ValueError, match="once each"):
        with_tables(page, "")


def test_what_stands_around_the_marks_stays():
    assert with_tables(f"a\n{BEGIN}\nold\n{END}\nb", "new") == f"a\n{BEGIN}\n\nnew\n\n{END}\nb"


def test_reports_of_predictions_have_no_scores_of_weights(content: dict, tmp_path: Path):
    (tmp_path / "a.json").write_text(json.dumps({**content, "method": {**content["method"], "sha256": None}}))
    with pytest.raises(ValueError, match="a report of predictions"):
        scores_of(read_report(tmp_path / "a.json"))
    (tmp_path / "a.json").write_text("{}")
    with pytest.raises(InputError):
        tables(tmp_path)

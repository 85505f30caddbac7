"""The model card: its numbers are those of the reports that are kept beside it."""

from __future__ import annotations

import json
from copy import deepcopy
from pathlib import Path

import pytest

from paper.release.card import BEGIN, END, reduced, tables
from paper.release.pages import CARD, SCORES, replace_between
from paper.release.ship import known_scores, scores_of
from semgs.evaluation.tables.saved_report import read_report
from semgs.files.errors import InputError
from semgs.model.weights.header import Figure
from semgs.model.weights.index import read_index, shipped_folder
from semgs.model.weights.weights_file import read_scores

REPORTS = sorted(SCORES.glob("*.json"))


@pytest.fixture(scope="module")
def content() -> dict:
    """One of the reports; to be copied."""
    return json.loads(REPORTS[0].read_text(encoding="utf-8"))


def test_the_tables_of_the_card_are_those_of_the_reports_beside_it():
    card = CARD.read_text(encoding="utf-8")
    assert REPORTS
    assert replace_between(card, tables(SCORES), BEGIN, END) == card, "run python -m paper.release card"


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


def test_a_reduced_report_says_the_same_in_total_and_nothing_of_single_targets(content: dict, tmp_path: Path):
    whole = deepcopy(content)
    whole["data"]["path"] = "/somewhere/val24"
    whole["frames"]["scenes"][0]["samples"] = [{"target": "a", "contexts": ["b", "c"]}]
    assert reduced(whole, content["data"]["path"]) == content
    assert whole["data"]["path"] == "/somewhere/val24"


@pytest.mark.parametrize("page", ["", BEGIN, f"{END}\n{BEGIN}", f"{BEGIN}{END}{BEGIN}{END}", f"{BEGIN}{BEGIN}{END}"])
def test_a_page_without_its_marks_is_refused(page: str):
    with pytest.raises(ValueError, match="once each"):
        replace_between(page, "", BEGIN, END)


def test_what_stands_around_the_marks_stays():
    assert replace_between(f"a\n{BEGIN}\nold\n{END}\nb", "new", BEGIN, END) == f"a\n{BEGIN}\n\nnew\n\n{END}\nb"


def test_reports_of_predictions_have_no_scores_of_weights(content: dict, tmp_path: Path):
    (tmp_path / "a.json").write_text(json.dumps({**content, "method": {**content["method"], "sha256": None}}))
    with pytest.raises(ValueError, match="a report of predictions"):
        scores_of(read_report(tmp_path / "a.json"))
    (tmp_path / "a.json").write_text("{}")
    with pytest.raises(InputError):
        tables(tmp_path)


def test_the_scores_of_weights_have_their_numbers_and_intervals(content: dict, tmp_path: Path):
    entry = content["results"][0]
    changed = {**entry, "psnr": 25.118, "intervals": {**entry["intervals"], "psnr": [24.0, 26.5]}}
    (tmp_path / "a.json").write_text(json.dumps({**content, "results": [changed]}))
    (score,) = scores_of(read_report(tmp_path / "a.json"))
    assert (score.targets, score.figures["psnr"]) == (entry["samples"], Figure(25.118, 24.0, 26.5))


def test_reports_of_other_weights_are_not_shipped_with_these(content: dict, tmp_path: Path):
    weights = shipped_folder() / "small.safetensors"
    assert len(known_scores(weights, "small", SCORES)) == len(REPORTS)
    assert known_scores(weights, "another", SCORES) == known_scores(weights, "small", SCORES)
    other = {**content, "method": {**content["method"], "sha256": "0" * 64}}
    (tmp_path / "other.json").write_text(json.dumps(other))
    with pytest.raises(InputError, match=r"one of 0{64}; evaluate again, or delete it"):
        known_scores(weights, "small", tmp_path)

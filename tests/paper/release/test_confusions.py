"""Confusions: what the tables say of small matrices, which reports are refused, and that the card's are of the weights that ship."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from paper.release.__main__ import main
from paper.release.confusions import BEGIN, END, ScoredPhotos, confusions_text, read_photos, write_confusions
from paper.release.pages import CARD, SCORES
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.score_records import encode_scores
from semgs.evaluation.tables.evaluation_report import SINGLE_FORMAT, VERSION
from semgs.files.errors import InputError
from semgs.model.weights.index import SHOWN, read_index
from semgs.model.weights.weights_file import read_scores

NAMES = ("wall", "sofa", "desk", "lamp")


def photo(*rows: list[int], unknown: int = 0) -> FrameScores:
    """A photo with a confusion matrix of the first classes; `unknown` pixels more of the first have no predicted class."""
    confusion = np.zeros((4, 4), np.int64)
    confusion[: len(rows), : len(rows[0])] = rows
    truth = confusion.sum(1)
    truth[0] += unknown
    return FrameScores("a", "b", (), confusion=confusion, truth=truth)


PHOTOS = (
    photo([6000, 0, 0, 0], [0, 1000, 3000, 0], [0, 0, 100, 0], [900, 0, 0, 0]),
    photo([1000, 0, 0, 0], [500, 1500, 0, 0], [0, 0, 100, 0], [900, 0, 0, 0], unknown=1000),
    photo([0, 0, 2000, 0], [0, 0, 0, 0], [0, 0, 100, 0], [9000, 0, 0, 0]),
    photo([0, 0, 0, 0], [0, 1000, 0, 0]),
)
"""Walls: 7,000 of 10,000 right; of sofas, in photos 1, 2 and 4, 3,500 of 7,000; desks: few pixels; no lamp is right."""


def scored(*frames: FrameScores, sha256: str = "a" * 64) -> ScoredPhotos:
    return ScoredPhotos(frames, NAMES, sha256)


def test_each_class_that_fails_has_a_row_and_the_worst_is_first():
    text = confusions_text({"rooms": scored(*PHOTOS)})
    assert text.startswith("Weights aaaaaaaaaaaa.")
    assert text.splitlines()[-3:] == [
        "| lamp | 0 % | wall, 100 % | 3 of 3 photos | 10,800 |",
        "| sofa | 50 % | desk, 43 % | 1 of 3 photos | 7,000 |",
        "| wall | 70 % | desk, 20 % | 1 of 3 photos | 10,000 |",
    ]
    # IoU: 7,000 of 20,300, 3,500 of 7,000, 300 of 5,300, and 0. Of 28,100 labelled pixels 27,100 have a class, and 10,800 the right one. 10,800 are lamps taken for walls, then 3,000, 2,000 and 500.
    assert (
        "**rooms**: 4 photos, mIoU 0.225, accuracy 0.399. The commonest mistakes, of all labelled pixels: "
        "lamp → wall 38.4 %, sofa → desk 10.7 %, wall → desk 7.1 %, sofa → wall 1.8 %.\n" in text
    )


def test_classes_in_two_photos_or_with_few_pixels_or_mostly_right_are_left_out():
    assert "| lamp" not in confusions_text({"": scored(PHOTOS[0], PHOTOS[2], PHOTOS[3])})
    assert "| wall" in confusions_text({"": scored(*[photo([1400, 600])] * 3)})
    assert "| wall" not in confusions_text({"": scored(*[photo([1100, 500])] * 3)})
    assert "| wall" not in confusions_text({"": scored(*[photo([1600, 400])] * 3)})


def test_pixels_without_a_class_are_not_right_and_are_taken_for_nothing():
    assert confusions_text({"": scored(*[photo([500], unknown=1500)] * 3)}).endswith(
        "labelled pixels: none.\n\n"
        "| what it is | right | most often taken for | mostly wrong in | pixels |\n|---|---:|---|---:|---:|\n"
        "| wall | 25 % |  | 3 of 3 photos | 6,000 |"
    )


def test_each_report_has_a_table_and_all_are_of_the_same_weights():
    text = confusions_text({"first": scored(*PHOTOS), "second": scored(*PHOTOS)})
    assert text.index("**first**") < text.index("| sofa |") < text.index("**second**") < text.rindex("| sofa |")
    with pytest.raises(InputError, match=r"expected reports of the same weights, found a{12} and b{12}"):
        confusions_text({"first": scored(*PHOTOS), "second": scored(*PHOTOS, sha256="b" * 64)})


def report(path: Path, **changes: object) -> Path:
    content = {
        "format": SINGLE_FORMAT, "version": VERSION, "classes": {"name": "four", "names": NAMES},
        "method": {"name": "small", "sha256": "a" * 64}, "data": [{"name": "photos"}], "per_class": [],
        "per_image": [encode_scores(one) for one in PHOTOS],
    }  # fmt: skip
    path.mkdir()
    (path / "report.json").write_text(json.dumps({**content, **changes}))
    return path


def test_the_tables_of_a_report_go_between_the_marks_of_the_card(tmp_path: Path):
    card = tmp_path / "card.md"
    card.write_text(f"before\n{BEGIN}\nold\n{END}\nafter")
    text = write_confusions({"rooms": report(tmp_path / "single")}, card)
    assert text == confusions_text({"rooms": scored(*PHOTOS)})
    assert card.read_text() == f"before\n{BEGIN}\n\n{text}\n\n{END}\nafter"


def test_reports_that_say_nothing_of_photos_are_refused(tmp_path: Path):
    with pytest.raises(InputError, match="expected scores of labelled photos, found none"):
        read_photos(report(tmp_path / "none", per_image=[]))
    with pytest.raises(InputError, match="expected a report of weights, found one of predictions"):
        read_photos(report(tmp_path / "theirs", method={"name": "theirs", "sha256": None}))
    with pytest.raises(InputError, match="expected a complete report"):
        read_photos(report(tmp_path / "part", per_image=[{"scene": "a"}]))
    with pytest.raises(InputError, match="expected scores of labelled photos, found none"):
        read_photos(next(SCORES.glob("*.json")))


def test_a_missing_folder_is_one_line_and_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["confusions", "--report", "rooms", str(tmp_path / "eval")]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"{tmp_path / 'eval'}: expected the report.json of an evaluation")
    assert len(error.splitlines()) == 1


def test_the_confusions_of_the_card_are_those_of_the_weights_that_ship():
    said = re.search(
        rf"## Failures\n.*{BEGIN}\n\nWeights ([0-9a-f]+)\..*{END}.*\n## How sure", CARD.read_text(), re.DOTALL
    )
    assert said
    known = {one.sha256[:SHOWN] for one in read_index()}
    known |= {score.sha256[:SHOWN] for one in read_index() for score in read_scores(one.path)}
    assert said[1] in known, "run python -m paper.release confusions"

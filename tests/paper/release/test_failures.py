"""Failures: what is drawn and said of a method's worst targets, and that the card's are of the weights that ship."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from paper.figure.compared_targets import FigurePart
from paper.release.failures import (
    BEGIN,
    END,
    ClassMistake,
    ScoredTarget,
    caption,
    mistakes,
    mistakes_table,
    score_targets,
    sheet,
    worst,
)
from semgs.data.scene import Scene
from semgs.data.tables.classes import SCANNET20
from semgs.evaluation.frames.frame_plan import make_plan
from semgs.evaluation.frames.predictions import Inputs, Prediction
from semgs.evaluation.frames.protocols import neighbours
from semgs.evaluation.frames.reading import read_frame
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.model.weights.index import SHOWN, read_index
from semgs.model.weights.weights_file import read_scores

DOCS = Path(__file__).resolve().parents[3] / "docs"


class WallIsFloor:
    """Says the truth, but for walls in one scene, half of which it takes for floor."""

    name = "wall is floor"

    def predict(self, inputs: Inputs) -> Prediction:
        task = inputs.task
        truth = read_frame(task, task.sample.target, (0.5, 10.0))
        assert truth.depths is not None
        labels = torch.zeros(task.size, dtype=torch.uint8) if truth.labels is None else truth.labels[0].clone()
        if task.scene.name == "bad":
            half = labels[:, ::2]
            half[half == 0] = 1
        return Prediction(labels=labels, image=truth.images[0], depths=1.1 * truth.depths[0])


@pytest.fixture
def found(make_scene: Callable[..., Scene]) -> tuple[ScoredTarget, ...]:
    """Two targets in each of a good scene, a bad one, and one without labels."""
    scenes = [make_scene(name, frames=4, labels=name != "unknown") for name in ("good", "bad", "unknown")]
    plan = make_plan("neighbours", neighbours, scenes, [2], (36, 48))
    return score_targets(FigurePart("", plan, (WallIsFloor(),), SCANNET20).compare())


def scores(confusion: list[list[int]], truth: list[int]) -> FrameScores:
    """Of the table's first three classes; no other occurs."""
    rest = len(SCANNET20) - 3
    return FrameScores(
        "a", "b", (), confusion=np.pad(np.int64(confusion), (0, rest)), truth=np.pad(np.int64(truth), (0, rest))
    )


def test_mistakes_are_shares_of_all_labelled_pixels_given_a_class_or_not_and_the_largest_comes_first():
    one = scores([[5, 1, 0], [0, 4, 0], [0, 0, 0]], [6, 4, 0])
    two = scores([[0, 0, 0], [6, 2, 0], [0, 0, 1]], [0, 9, 1])  # a pixel was given no class
    assert mistakes([one, two], SCANNET20.names) == (
        ClassMistake("floor", "wall", 6 / 20, 6 / 13),
        ClassMistake("wall", "floor", 1 / 20, 1 / 6),
    )
    assert mistakes([scores([[3, 0, 0], [0, 2, 0], [0, 0, 1]], [3, 2, 1])], SCANNET20.names) == ()


def test_targets_without_labels_cannot_fail(found: tuple[ScoredTarget, ...]):
    assert [one.scores.scene for one in found] == ["good"] * 2 + ["bad"] * 2


def test_the_worst_targets_are_one_of_each_scene_and_the_worst_is_first(found: tuple[ScoredTarget, ...]):
    for order in (found, found[::-1]):
        first, second = worst(order, 5)
        assert (first.scores.scene, second.scores.scene) == ("bad", "good")
        assert first.miou == min(one.miou for one in found) < 1
        assert second.miou == 1
    assert len(worst(found, 1)) == 1


def test_a_caption_says_how_bad_it_is_and_what_was_taken_for_what(found: tuple[ScoredTarget, ...]):
    bad, good = worst(found, 2)
    (only,) = mistakes([bad.scores], SCANNET20.names)
    assert caption(bad) == (
        f"mIoU {bad.miou:.2f}, accuracy {1 - only.share:.2f}, depth error 0.10; "
        f"wall → floor {100 * only.share:.0f} % of the labelled pixels"
    )
    assert caption(good) == "mIoU 1.00, accuracy 1.00, depth error 0.10"


def test_the_table_has_the_mistakes_of_all_targets_together(found: tuple[ScoredTarget, ...]):
    (only,) = mistakes([one.scores for one in found], SCANNET20.names)
    assert only.of_class < 0.5, "half of the walls of one scene, and none of the other"
    *_, row = mistakes_table(found, 8).splitlines()
    assert row == f"| wall | floor | {100 * only.share:.1f} % | {100 * only.of_class:.0f} % |"


@pytest.mark.long
def test_a_sheet_is_the_best_jpeg_that_is_small_enough_and_the_same_each_time(found: tuple[ScoredTarget, ...]):
    rows = worst(found, 2)
    large, small = sheet(rows, 10**6), sheet(rows, 80_000)
    assert len(small) <= 80_000 < len(large)
    assert sheet(rows, 80_000) == small
    with Image.open(io.BytesIO(large)) as opened:
        assert (opened.format, opened.width) == ("JPEG", 1200)
    with pytest.raises(ValueError, match="2 rows of pictures do not fit into 999 bytes; take fewer"):
        sheet(rows, 999)


def test_the_failures_of_the_card_are_those_of_the_weights_that_ship():
    card = (DOCS / "model_card.md").read_text(encoding="utf-8")
    said = re.search(rf"{BEGIN}.*weights ([0-9a-f]+):.*{END}", card, re.DOTALL)
    assert said
    known = {one.sha256[:SHOWN] for one in read_index()}
    known |= {score.sha256[:SHOWN] for one in read_index() for score in read_scores(one.path)}
    assert said[1] in known, "run python -m paper.release failures"
    assert (DOCS / "images/failures.jpg").stat().st_size <= 200_000

"""What changes between two predictions of a target, with numbers worked out by hand."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from semgs.data.scene import Scene
from semgs.evaluation.frames.frame_plan import frame_list, read_plan
from semgs.evaluation.frames.predictions import Inputs, Prediction
from semgs.evaluation.run import plan_targets
from semgs.evaluation.scoring.frame_scores import changes
from semgs.evaluation.scoring.method_scores import score_method
from semgs.evaluation.scoring.score_records import decode_scores, encode_scores
from semgs.evaluation.scoring.summary import summarise
from semgs.files.errors import InputError


def prediction(label: int, depth: float, unseen: int = 0, alone: int = 0) -> Prediction:
    """10 x 10 pixels of one class and depth, except for so many rows: unseen ones at the top, and some of class 7 at 9 m at the bottom."""
    labels, depths, hidden = (
        torch.full((10, 10), label, dtype=torch.uint8),
        torch.full((10, 10), depth),
        torch.zeros(10, 10, dtype=torch.bool),
    )
    labels[10 - alone :], depths[10 - alone :], hidden[:unseen] = 7, 9.0, True
    return Prediction(labels=labels, depths=depths, unseen=hidden)


def test_only_pixels_that_both_see_count():
    """Two rows are unseen in one, one of them in the other, too: 8 rows count, of which 2 have another class. 2.0 and 2.1 m are alike, 2.1 and 9 m are not."""
    found = changes(prediction(3, 2.0, unseen=2), prediction(3, 2.1, unseen=1, alone=2))
    assert found == {"changed_classes": pytest.approx(2 / 8), "changed_depth": pytest.approx(2 / 8)}
    assert changes(prediction(3, 2.0), prediction(4, 2.3)) == {"changed_classes": 1, "changed_depth": 1}
    assert changes(prediction(3, 2.0), prediction(3, 2.19)) == {"changed_classes": 0, "changed_depth": 0}


def test_without_classes_depth_or_a_common_pixel_there_is_no_score():
    assert changes(prediction(3, 2.0, unseen=10), prediction(3, 2.0)) == {}
    assert changes(Prediction(), prediction(3, 2.0)) == {}
    undrawn = Prediction(labels=torch.zeros(10, 10, dtype=torch.uint8), depths=torch.zeros(10, 10))
    assert changes(undrawn, prediction(0, 2.0)) == {"changed_classes": 0}


class Sides:
    """Says class 1 if its first input view is the frame before the target, else class 2 in the upper half."""

    name = "sides"

    def predict(self, inputs: Inputs) -> Prediction:
        sample, labels = inputs.task.sample, torch.ones(inputs.task.size, dtype=torch.uint8)
        if sample.target - sample.contexts[0] != 1:
            labels[: len(labels) // 2] = 2
        return Prediction(labels=labels, depths=torch.ones(inputs.task.size))


def test_each_target_is_predicted_twice_and_the_list_says_from_what(make_scene: Callable[..., Scene], tmp_path: Path):
    """Target 3 of seven frames: from 2 and 4, then from 1 and 5. Half of the classes change, no depth does."""
    scene = make_scene(frames=7, size=(16, 16))
    plan = plan_targets(("pairs",), (scene,), size=(16, 16))
    path = tmp_path / "frames.json"
    path.write_text(json.dumps(frame_list(plan)))
    again = read_plan(path, (scene,))
    assert [task.sample for task in again.tasks] == [task.sample for task in plan.tasks]
    (rows,) = score_method(again, Sides(), tmp_path, save=False)
    found = rows.method[2]
    assert (found.target, found.more) == ("images/003.png", {"changed_classes": 0.5, "changed_depth": 0.0})
    assert not rows.baselines["copy"][2].more
    back = decode_scores(encode_scores(found), 20)
    assert summarise([back])["changed_classes"] == 0.5
    content = json.loads(path.read_text())
    content["scenes"][0]["samples"][0]["others"] = "images/004.png"
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match="a target and two or more contexts, by name"):
        read_plan(path, (scene,))

"""Panoptic quality and boxes, with numbers worked out by hand and beside torchmetrics."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest
import torch
from torchmetrics.detection import PanopticQuality

from semgs.data.tables.classes import IGNORE, SCANNET20, ClassTable
from semgs.data.views import INDOOR_DEPTH_RANGE, Views
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.panoptic import count_boxes, count_segments, joined, qualities, tally, true_boxes
from semgs.evaluation.scoring.score_records import decode_scores, encode_scores
from semgs.evaluation.scoring.summary import summarise
from semgs.evaluation.tables.comparison_tables import things_grid
from semgs.evaluation.tables.saved_report import SavedReport, SavedResult
from semgs.geometry.cameras import Cameras
from semgs.robotics.boxes import Box

WALL, CHAIR, TABLE = (SCANNET20.index(name) for name in ("wall", "chair", "table"))

FEW = ClassTable("few", ("wall", "chair", "other"), ((0, 0, 0), (1, 1, 1), (2, 2, 2)), (1, 2, 3))


def maps(*segments: tuple[int, int, int], width: int = 100) -> tuple[np.ndarray, np.ndarray]:
    """An image of one hundred rows: class, thing and number of columns of each segment, from left to right; the rest is without a class."""
    labels, things = np.full((100, width), IGNORE, np.uint8), np.zeros((100, width), np.int32)
    first = 0
    for label, thing, columns in segments:
        labels[:, first : first + columns], things[:, first : first + columns] = label, thing
        first += columns
    return labels, things


def frame(truth, prediction, name: str = "a", rule="coco", classes: ClassTable = SCANNET20) -> FrameScores:
    """The scores of things of a target."""
    return FrameScores("room", name, ("x", "y"), segments=count_segments(truth, prediction, classes, rule))


def test_a_wall_and_two_chairs_of_which_one_is_found():
    """Wall 50 of 60 columns, IoU 5/6. One chair is right, IoU 1; the other is predicted as the wall: missed. PQ is the mean of 5/6 and 1 / (1 + 1/2)."""
    found = summarise(
        [frame(maps((WALL, 0, 50), (CHAIR, 1, 40), (CHAIR, 2, 10)), maps((WALL, 0, 50), (CHAIR, 7, 40), (WALL, 0, 10)))]
    )
    assert found["pq"] == pytest.approx((5 / 6 + 2 / 3) / 2)
    assert found["sq"] == pytest.approx((5 / 6 + 1) / 2)
    assert found["rq"] == pytest.approx((1 + 2 / 3) / 2)
    assert found["instance_miou"] == pytest.approx((1 + 0) / 2)


def test_a_chair_in_two_halves_and_a_table_that_is_none():
    """The larger half has 30 of 50 columns: IoU .6, a match; the other is wrong. The table is wrong, too: (1 + 0.6 / 1.5 + 0) / 3."""
    found = summarise(
        [frame(maps((WALL, 0, 50), (CHAIR, 1, 50)), maps((WALL, 0, 50), (CHAIR, 1, 30), (CHAIR, 2, 18), (TABLE, 3, 2)))]
    )
    assert found["pq"] == pytest.approx((1 + 0.6 / 1.5 + 0) / 3)
    assert found["instance_miou"] == pytest.approx(0.6)


def test_what_is_void_counts_nowhere_and_what_is_not_said_is_missed():
    """Columns 60 to 99 are without a class or without a thing: a table there is not wrong. The prediction leaves 20 of 60 columns of the wall open: IoU 2/3."""
    truth = maps((WALL, 0, 60), (IGNORE, 0, 20), (CHAIR, 0, 20))
    found = summarise([frame(truth, maps((WALL, 0, 40), (CHAIR, 0, 20), (TABLE, 1, 40)))])
    assert (found["pq"], found["rq"]) == (pytest.approx(2 / 3), 1)
    assert found["instance_miou"] == 0


def test_segments_below_a_thousandth_of_the_image_do_not_count():
    """9 of 10,000 pixels are a chair, in the truth and elsewhere in the prediction; with 10 both would count."""
    truth, prediction = maps((WALL, 0, 100)), maps((WALL, 0, 100))
    for (labels, things), row in ((truth, 0), (prediction, 50)):
        labels[row, :9], things[row, :9] = CHAIR, 1
    assert summarise([frame(truth, prediction)])["pq"] == pytest.approx((10_000 - 18) / (10_000 - 9))
    for (labels, things), row in ((truth, 0), (prediction, 50)):
        labels[row, :10], things[row, :10] = CHAIR, 1
    assert summarise([frame(truth, prediction)])["rq"] == pytest.approx(1 / 2), (
        "the wall is right, the chair missed and wrong"
    )


def test_targets_add_up_before_classes_are_averaged():
    """In one target the chair is right, in the other missed: 1 / 1.5. The wall is right in both."""
    right = frame(maps((WALL, 0, 50), (CHAIR, 1, 50)), maps((WALL, 0, 50), (CHAIR, 3, 50)))
    missed = frame(maps((WALL, 0, 50), (CHAIR, 1, 50)), maps((WALL, 0, 50)), "b")
    assert summarise([right, missed])["pq"] == pytest.approx((1 + 2 / 3) / 2)


@pytest.mark.parametrize("seed", range(5))
def test_the_rule_of_coco_is_that_of_torchmetrics_if_nothing_is_left_open(seed: int):
    """Random maps in blocks of 10 pixels."""
    rng = np.random.default_rng(seed)
    drawn = []
    for _ in range(2):
        labels = rng.choice([WALL, 1, CHAIR, TABLE], (10, 10), p=(0.5, 0.1, 0.2, 0.2)).repeat(10, 0).repeat(10, 1)
        things = np.where(labels < 2, 0, rng.integers(1, 4, (10, 10)).repeat(10, 0).repeat(10, 1))
        drawn.append((labels, things))
    theirs = PanopticQuality(things={CHAIR, TABLE}, stuffs={WALL, 1}, return_sq_and_rq=True)
    as_pairs = [torch.from_numpy(np.stack(one, -1))[None] for one in drawn]
    expected = theirs(as_pairs[1], as_pairs[0])
    found = summarise([frame(drawn[0], drawn[1])])
    assert [found[name] for name in ("pq", "sq", "rq")] == pytest.approx(expected.tolist(), abs=1e-6)


def test_the_rule_of_eps3d():
    """Of 100 x 150 pixels, rows 25 to 74 and columns 25 to 124 count. Truth: wall 50 columns, chair 49.6, other 0.4, which is below .5 % and so void in both maps;
    the prediction says chair at the last 10 columns of the wall and the rest right: wall 40/50, chair 49.6/59.6, both matches."""
    truth, prediction = maps((WALL, 0, 75), (1, 1, 75), width=150), maps((WALL, 0, 65), (1, 5, 85), width=150)
    truth[0][25:45, 124], truth[1][25:45, 124] = 2, 0
    found = summarise([frame(truth, prediction, rule="eps3d", classes=FEW)])
    assert found["pq"] == pytest.approx((40 / 50 + 2480 / 2980) / 2)


def test_eps3d_matches_things_over_the_targets_of_a_group():
    """A chair has 20 columns in one target, all found, and 80 in the other, 30 of them found as the same thing: IoU 50 / 100, no match. By targets, one would."""
    first = frame(
        maps((1, 1, 45), (0, 0, 105), width=150), maps((1, 1, 45), (0, 0, 105), width=150), rule="eps3d", classes=FEW
    )
    second = frame(maps((1, 1, 105), (0, 0, 45), width=150), maps((1, 1, 55), (0, 0, 95), width=150), "b", "eps3d", FEW)
    assert summarise([first, second])["rq"] == pytest.approx(1 / 2), "the wall is right: 100 of 150 columns"
    apart = replace(second, contexts=("x", "z"))
    assert summarise([first, apart])["rq"] == pytest.approx((1 + 0) / 2), (
        "in the second group, neither the chair (3/8) nor the wall (2/7) matches"
    )


def test_boxes_match_one_to_one_within_a_class():
    """A box moved by half its length has an IoU of 1/3; one turned by 90 degrees, of 2 x 1 m, shares 1 of 3 square metres."""
    box = Box((0.0, 0.0, 0.5), (2.0, 1.0, 1.0), 0.0)
    moved, turned = replace(box, centre=(1.0, 0.0, 0.5)), replace(box, yaw=pi / 2)
    assert box.iou(moved) == pytest.approx(1 / 3)
    assert box.iou(turned) == pytest.approx(1 / 3)
    assert box.iou(replace(box, centre=(0.0, 0.0, 1.6))) == 0
    assert count_boxes([(CHAIR, box)], [(CHAIR, moved), (CHAIR, turned), (TABLE, box)]) == (1, 3, 1, 0)
    assert count_boxes([(CHAIR, box), (CHAIR, moved)], [(CHAIR, box)]) == (2, 1, 1, 1)
    flat = Box((0.0, 0.0, 0.5), (1.0, 0.0, 1.0), 0.0)
    assert count_boxes([(CHAIR, flat)], [(CHAIR, replace(flat, centre=(0.0, 0.03, 0.5)))]) == (1, 1, 1, 1), (
        "0.07 of 0.13"
    )
    found = summarise(
        [FrameScores("room", "a", (), boxes=(4, 10, 2, 1)), FrameScores("room", "b", (), boxes=(1, 0, 0, 0))]
    )
    assert [found[f"box_{name}"] for name in ("recall_25", "precision_25", "recall_50", "precision_50")] == [
        0.4,
        0.2,
        0.2,
        0.1,
    ]


def test_true_boxes_are_around_what_the_input_views_show():
    """A chair fills columns 10 to 29 of 40, 2 m away with a focal length of 40 px: 0.05 m a pixel, so 0.95 m from first to last. A speck of one pixel is no thing."""
    labels = torch.full((20, 40), WALL, dtype=torch.uint8)
    labels[:, 10:30] = CHAIR
    numbers = np.where(labels.numpy() == CHAIR, 3, 0)
    k = torch.tensor([[40.0, 0, 20], [0, 40, 10], [0, 0, 1]], dtype=torch.float64)
    cameras = Cameras(torch.eye(4, dtype=torch.float64)[None], k[None], (20, 40))
    view = Views(
        torch.zeros(1, 3, 20, 40), cameras, torch.tensor([list(INDOOR_DEPTH_RANGE)]), labels=labels[None],
        depths=torch.full((1, 20, 40), 2.0),
    )  # fmt: skip
    level = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    (found,) = true_boxes([(view, numbers)], SCANNET20, level) or ()
    assert found[0] == CHAIR
    assert found[1].size == pytest.approx((0.95, 0.0, 0.95), abs=0.06), "percentiles cut a pixel"
    assert found[1].centre == pytest.approx((0.0, 2.0, 0.0), abs=0.03)
    assert true_boxes([(view.changed(depths=None), numbers)], SCANNET20, level) is None


def test_scores_of_things_come_back_from_json():
    scores = replace(
        frame(maps((WALL, 0, 50), (CHAIR, 1, 50)), maps((WALL, 0, 40), (CHAIR, 2, 30))), boxes=(1, 2, 1, 0)
    )
    back = decode_scores(encode_scores(scores), 20)
    assert back.segments is not None
    assert summarise([back]) == summarise([scores])
    np.testing.assert_array_equal(back.segments.pairs, scores.segments.pairs)
    for wrong in ({"rule": "voc"}, {"pairs": "1 2 3"}, {"pairs": "0 0 77 0 5"}):
        entry = encode_scores(scores)
        with pytest.raises((ValueError, LookupError)):
            decode_scores(entry | {"segments": entry["segments"] | wrong}, 20)
    with pytest.raises(ValueError, match="numbers of boxes"):
        decode_scores(encode_scores(scores) | {"boxes": [1, 2]}, 20)


def test_the_table_of_things_has_a_row_for_each_metric_that_was_requested():
    numbers = {"pq": 0.5, "sq": 0.75, "obstacle_error": 0.25, "intervals": {"pq": [0.4, 0.6]}, "miou": 0.3}
    report = SavedReport(Path("report.json"), "small", "neighbours", {}, None, {2: SavedResult(2, numbers, {}, (), "")})
    grid = things_grid(report)
    assert grid is not None
    assert [[cell.text for cell in row] for row in grid.rows] == [
        ["PQ", "0.500 [0.400, 0.600]"], ["SQ", "0.750"], ["obstacle ahead [m]", "0.25"],
    ]  # fmt: skip
    without = SavedReport(
        Path("report.json"), "small", "neighbours", {}, None, {2: SavedResult(2, {"miou": 0.3}, {}, (), "")}
    )
    assert things_grid(without) is None


def test_a_joined_group_is_counted_once():
    one = count_segments(maps((CHAIR, 1, 50)), maps((CHAIR, 1, 50)), SCANNET20)
    assert qualities(tally(joined([one, one])).counts)[0] == 1

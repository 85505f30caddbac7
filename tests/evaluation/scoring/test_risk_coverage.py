"""Risk-coverage curves over targets and scenes."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import COVERAGES, intervals, risk_coverage
from semgs.evaluation.scoring.score_records import decode_scores, encode_scores
from semgs.evaluation.scoring.summary import summarise
from semgs.objectives.selective import counts_by_confidence


def frame(scene: str, confidence: float, right: int, count: int = 10) -> FrameScores:
    """A target whose pixels are equally confident, the first ones right."""
    counts = counts_by_confidence(torch.full((count,), confidence), torch.arange(count) < right)
    return FrameScores(scene, f"{confidence}.png", ("a", "b"), confidences=counts)


def test_a_curve_is_over_the_pixels_of_all_targets_together() -> None:
    """10 sure pixels without an error, then 10 with 4: after x > 10 of 20 pixels, 0.4 (x - 10) / x of them are wrong."""
    frames = [frame("a", 0.6, 6), frame("b", 0.9, 10), FrameScores("c", "0.png", ("a", "b"))]
    points = risk_coverage(frames)
    assert [point.coverage for point in points] == list(COVERAGES)
    expected = {0.25: 0, 0.5: 0, 0.75: 0.4 * 5 / 15, 1.0: 0.2}
    assert {point.coverage: point.risk for point in points if point.coverage in expected} == pytest.approx(expected)
    assert [round(point.confidence, 1) for point in points] == [0.9] * 10 + [0.6] * 10
    assert summarise(frames) == {
        "aurc": pytest.approx(0.2 - 0.2 * math.log(2)),
        "ece": pytest.approx((10 * abs(0.9 - 1) + 10 * (0.6 - 0.6)) / 20, abs=0.003),
        "covered_95": pytest.approx(0.4 * 10 / (0.4 - 0.05) / 20),  # 0.4 (x - 10) = 0.05 x
    }


def test_intervals_resample_scenes_and_contain_the_value() -> None:
    frames = [frame(f"scene {number}", 0.55 + 0.06 * number, 3 + number) for number in range(7)]
    for point in risk_coverage(frames):
        assert point.low is not None
        assert point.high is not None
        assert point.low <= point.risk + 1e-12
        assert point.risk <= point.high + 1e-12
    last = risk_coverage(frames)[-1]
    assert last.risk == pytest.approx(1 - (3 + 9) / 2 / 10)
    means = np.random.default_rng(0).choice([0.7 - 0.1 * number for number in range(7)], (20_000, 7)).mean(1)
    assert (last.low, last.high) == pytest.approx(tuple(np.percentile(means, (2.5, 97.5))), abs=0.02)
    assert {"aurc", "ece"} <= intervals(frames).keys()


def test_a_single_target_has_a_curve_without_intervals_and_none_has_none() -> None:
    (first, *_) = risk_coverage([frame("a", 0.8, 7)])
    assert (first.low, first.high) == (None, None)
    assert first.risk == pytest.approx(0.3)
    assert risk_coverage([FrameScores("a", "0.png", ("a", "b"))]) == ()
    assert risk_coverage([frame("a", 0.8, 0, count=0)]) == ()
    assert "aurc" not in summarise([frame("a", 0.8, 0, count=0)])


def test_the_counts_are_read_back_from_a_report() -> None:
    one = frame("a", 0.8, 7)
    again = decode_scores(encode_scores(one), 20).confidences
    assert again is not None
    assert (again == one.confidences).all()
    old = encode_scores(one)
    del old["confidences"]
    assert decode_scores(old, 20).confidences is None

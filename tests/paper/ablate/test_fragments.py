"""Fragments of class maps, counted by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from paper.ablate.fragments import fragments, with_fragments
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.summary import group_metrics
from semgs.files.images.pictures import write_png


def test_fragments_are_regions_of_less_than_a_two_thousandth_of_the_image():
    labels = np.zeros((100, 200), np.uint8)  # the limit is 10 pixels
    labels[2:4, 3:7] = 1  # 8 pixels
    labels[50:55, 10:12] = 1  # 10 pixels: no fragment
    labels[60, 60] = labels[61, 61] = 2  # two regions, which touch at a corner only
    labels[0, 199] = 0
    labels[0, 198] = labels[1, 199] = 3  # cut off a pixel of the large region, and are two regions themselves
    assert fragments(labels) == (8 + 2 + 1 + 2) / 20000


def test_they_are_read_from_the_maps_of_an_evaluation_and_averaged_over_targets(tmp_path: Path):
    (tmp_path / "predictions/N2/room").mkdir(parents=True)
    for name, tiny in (("001", 4), ("002", 8)):
        labels = np.zeros((100, 200), np.uint8)
        labels[0, :tiny] = 5
        write_png(tmp_path / f"predictions/N2/room/{name}.png", labels)
    frames = [FrameScores("room", f"images/{name}.jpg", ("000.jpg", "003.jpg")) for name in ("001", "002")]
    found = with_fragments(frames, tmp_path)
    assert [frame.fragments for frame in found] == [4 / 20000, 8 / 20000]
    averages = {name: value for group in group_metrics(found) for name, value in group.once().items()}
    assert averages == pytest.approx({"fragments": 6 / 20000})

from __future__ import annotations

import pytest
import torch

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras
from semgs.objectives.measures import MEANINGS, TITLES
from semgs.objectives.metrics import DepthScores, ViewScores, mean_scores
from semgs.rendering.rendering import Rendering
from semgs.run.steps.finishing import scores


def pair() -> tuple[Rendering, Views]:
    """One view of 2x4 pixels: the left half is right, the right half is unseen, black and far off."""
    pose = torch.eye(4, dtype=torch.float64)[[2, 0, 1, 3]]
    pose[:3, 3] = torch.tensor([1.0, 2.0, 3.0])
    cameras = Cameras(pose[None], [[[5.0, 0, 1.7], [0, 6.0, 0.8], [0, 0, 1]]], (2, 4))
    images = torch.full((1, 3, 2, 4), 0.5)
    truth = Views(
        images,
        cameras,
        [[0.5, 10.0]],
        labels=torch.tensor([[[0, 1, 255, 1], [0, 1, 0, 0]]], dtype=torch.uint8),
        depths=torch.tensor([[[2.0, 4.0, 5.0, 5.0], [0.0, 2.0, 5.0, 5.0]]]),
    )
    rendered = images.clone()
    rendered[..., :2] += 0.1
    rendered[..., 2:] = 0
    semantics = torch.full((1, 20, 2, 4), 0.01)
    semantics[:, 0] = 0.5
    alphas = torch.tensor([[[1.0, 0.5, 0.49, 0.0]] * 2])
    depths = torch.tensor([[[3.0, 5.0, 1.0, 0.0], [3.0, 2.0, 1.0, 0.0]]])
    return Rendering(rendered, semantics, depths, alphas), truth


def test_each_score_is_what_hand_reckoning_gives() -> None:
    (score,) = scores(*pair())
    half = (0.01 + 0.25) / 2
    assert score.psnr == pytest.approx(-10 * torch.tensor(half).log10().item(), abs=1e-3)
    assert score.psnr_seen == pytest.approx(20, abs=1e-3)
    assert score.coverage == 0.5
    assert score.depth_seen is not None
    assert score.depth_seen.abs_rel == pytest.approx((0.5 + 0.25 + 0) / 3, abs=1e-6)
    assert score.accuracy == pytest.approx(4 / 7)  # everything is called class 0; one pixel has no label
    assert score.miou == pytest.approx((4 / 7 + 0) / 2)


def test_scores_over_the_seen_pixels_are_of_the_left_half_alone() -> None:
    """There are two pixels of each of two classes, all called the first; three have a true depth, of which all were seen."""
    (score,) = scores(*pair())
    assert score.accuracy_seen == pytest.approx(2 / 4)
    assert score.miou_seen == pytest.approx((2 / 4 + 0) / 2)
    assert score.depth is not None
    assert score.depth_seen is not None
    assert (score.depth.pixels, score.depth_seen.pixels) == (7, 3)
    # Right half: |1 - 5| / 5 at two pixels, and |0 - 5| / 5 at the two where nothing was drawn.
    assert score.depth.abs_rel == pytest.approx((0.75 + 2 * 0.8 + 2 * 1) / 7, abs=1e-6)


def test_scores_have_the_names_and_the_order_of_the_one_table() -> None:
    named = scores(*pair())[0].by_measure
    assert list(named) == [name for name in TITLES if name in named]
    assert named["unseen"] == 0.5
    assert named["depth_abs_rel_seen"] == pytest.approx(0.25, abs=1e-6)
    assert set(MEANINGS) <= set(named)


def test_what_is_not_known_is_none() -> None:
    rendering, truth = pair()
    (score,) = scores(
        Rendering(rendering.images, None, rendering.depths, torch.zeros(1, 2, 4)),
        Views(truth.images, truth.cameras, truth.depth_range, labels=truth.labels),
    )
    assert score.coverage == 0
    assert (score.psnr_seen, score.depth_seen, score.accuracy, score.miou) == (None, None, None, None)
    unlabelled = torch.full((1, 2, 4), 255, dtype=torch.uint8)
    (score,) = scores(rendering, Views(truth.images, truth.cameras, truth.depth_range, labels=unlabelled))
    assert (score.accuracy, score.miou) == (None, None)


def test_means_are_over_the_views_that_have_the_score_and_of_depth_over_their_pixels() -> None:
    """One pixel with an error of 0.1 and three with 0.3: (0.1 + 3 * 0.3) / 4 = 0.25."""
    one = ViewScores(
        psnr=20.0,
        unseen=0.0,
        psnr_seen=20.0,
        accuracy=0.5,
        depth=DepthScores(0.2, 1.0, 1),
        depth_seen=DepthScores(0.1, 1.0, 1),
    )
    two = ViewScores(
        psnr=30.0,
        unseen=0.5,
        psnr_seen=40.0,
        accuracy=0.7,
        depth=DepthScores(0.4, 0.5, 1),
        depth_seen=DepthScores(0.3, 0.5, 3),
    )
    mean = mean_scores([one, two, ViewScores(psnr=25.0, unseen=0.25, psnr_seen=30.0, accuracy=0.6)])
    assert mean.depth_seen == DepthScores(pytest.approx(0.25), pytest.approx((1 + 3 * 0.5) / 4), 4)
    assert mean.depth == DepthScores(pytest.approx(0.3), 0.75, 2)
    assert (mean.psnr, mean.coverage, mean.psnr_seen, mean.accuracy, mean.miou) == (
        25.0,
        0.75,
        30.0,
        pytest.approx(0.6),
        None,
    )


def test_hidden_pixels_count_in_no_score() -> None:
    """Without the last two columns, the unseen half, all scores are those of the seen half."""
    rendering, truth = pair()
    hidden = torch.zeros(1, 2, 4, dtype=torch.bool)
    hidden[..., 2:] = True
    (score,) = scores(rendering, truth.changed(hidden=hidden))
    assert score.psnr == score.psnr_seen == pytest.approx(20, abs=1e-3)
    assert score.coverage == 1
    assert score.accuracy == pytest.approx(2 / 4)
    assert score.depth == score.depth_seen
    assert score.depth is not None
    assert score.depth.abs_rel == pytest.approx((0.5 + 0.25 + 0) / 3, abs=1e-6)
    assert score.depth.pixels == 3

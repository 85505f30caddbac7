from __future__ import annotations

import pytest
import torch

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras
from semgs.reconstruction.scores import ViewScores, mean_scores, scores
from semgs.rendering.rendering import Rendering


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
    assert score.depth_error == pytest.approx((0.5 + 0.25 + 0) / 3, abs=1e-6)
    assert score.accuracy == pytest.approx(4 / 7)  # everything is called class 0; one pixel has no label
    assert score.miou == pytest.approx((4 / 7 + 0) / 2)


def test_what_is_not_known_is_none() -> None:
    rendering, truth = pair()
    (score,) = scores(
        Rendering(rendering.images, None, rendering.depths, torch.zeros(1, 2, 4)),
        Views(truth.images, truth.cameras, truth.depth_range, labels=truth.labels),
    )
    assert score.coverage == 0
    assert (score.psnr_seen, score.depth_error, score.accuracy, score.miou) == (None, None, None, None)
    unlabelled = torch.full((1, 2, 4), 255, dtype=torch.uint8)
    (score,) = scores(rendering, Views(truth.images, truth.cameras, truth.depth_range, labels=unlabelled))
    assert (score.accuracy, score.miou) == (None, None)


def test_means_are_over_the_views_that_have_the_score() -> None:
    mean = mean_scores([ViewScores(20.0, 1.0, 20.0, 0.1, 0.5, None), ViewScores(30.0, 0.5, 40.0, None, 0.7, None)])
    assert mean == ViewScores(25.0, 0.75, 30.0, 0.1, 0.6, None)

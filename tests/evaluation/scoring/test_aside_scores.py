"""Scores of targets aside, with numbers worked out by hand."""

from __future__ import annotations

import math

import pytest
import torch

from semgs.data.views import INDOOR_DEPTH_RANGE, Views
from semgs.evaluation.frames.predictions import Prediction
from semgs.evaluation.frames.protocols import kind_aside
from semgs.evaluation.scoring.frame_scores import aside_scores, near_steps, psnr_gradients
from semgs.geometry.cameras import Cameras

HEIGHT, WIDTH = 4, 40


def view(depths: torch.Tensor, image: torch.Tensor) -> Views:
    """One view with depth."""
    k = torch.tensor([[40.0, 0, 20], [0, 40, 2], [0, 0, 1]], dtype=torch.float64)
    cameras = Cameras(torch.eye(4, dtype=torch.float64)[None], k[None], (HEIGHT, WIDTH))
    return Views(image[None], cameras, torch.tensor([list(INDOOR_DEPTH_RANGE)]), depths=depths[None])


def step() -> torch.Tensor:
    """2 m in the left 20 columns, 3 m in the right ones."""
    depths = torch.full((HEIGHT, WIDTH), 2.0)
    depths[:, 20:] = 3.0
    return depths


def test_edges_are_six_pixels_to_each_side_of_the_two_at_a_step():
    """Columns 19 and 20 are at the step, so 13 to 26 are near it."""
    assert near_steps(step())[0].nonzero().flatten().tolist() == list(range(13, 27))
    assert not near_steps(torch.full((4, 40), 2.0)).any()
    slope = torch.linspace(2.0, 3.0, 40).expand(4, 40).contiguous()
    assert not near_steps(slope).any(), "neighbours differ by 1 % or less"
    unknown = step()
    unknown[:, 20:] = 0
    assert not near_steps(unknown).any()


def test_gradients_punish_blur_and_noise_alike():
    """A black and white edge is drawn one pixel wide: the differences 0, 1, 0 become 0.5, 0.5, 0 in one of two axes."""
    truth = torch.zeros(3, HEIGHT, WIDTH)
    truth[:, :, 20:] = 1.0
    blurred = truth.clone()
    blurred[:, :, 19] = 0.5
    rows, columns = (HEIGHT - 1) * WIDTH, HEIGHT * (WIDTH - 1)
    mean = HEIGHT * 2 * 0.5**2 / (rows + columns)
    assert psnr_gradients(blurred, truth) == pytest.approx(-10 * math.log10(mean))
    assert psnr_gradients(truth, truth) is None
    assert psnr_gradients(truth + 0.25, truth) is None, "brightness has no gradient"


def test_each_number_counts_its_own_pixels():
    """At the edge (columns 13 to 26) the image is off by 0.1: 20 dB; depth is 2 everywhere, so the 7 right columns of 14 are off by a third. Of the pixels that
    nobody saw, columns 30 to 39, the method draws 30 to 34. It draws 35 columns, of which 15 float: 2 m, where 3 are true."""
    image = torch.zeros(3, HEIGHT, WIDTH)
    given, unseen, undrawn = (
        image.clone(),
        torch.zeros(HEIGHT, WIDTH, dtype=torch.bool),
        torch.zeros(HEIGHT, WIDTH, dtype=torch.bool),
    )
    given[:, :, 13:27] = 0.1
    given[:, :, :13] = 0.9
    unseen[:, 30:] = True
    undrawn[:, 35:] = True
    prediction = Prediction(image=given, depths=torch.full((HEIGHT, WIDTH), 2.0), unseen=undrawn)
    found = aside_scores(prediction, view(step(), image), unseen)
    assert found["psnr_edges"] == pytest.approx(20.0, abs=1e-4)
    assert found["depth_edges"] == pytest.approx(7 / 14 / 3)
    assert found["made_up"] == pytest.approx(5 / 10)
    assert found["flyers"] == pytest.approx(15 / 35)


def test_what_is_not_known_is_not_scored():
    image = torch.zeros(3, HEIGHT, WIDTH)
    flat = aside_scores(Prediction(image=image), view(torch.full((HEIGHT, WIDTH), 2.0), image), None)
    assert flat == {}
    assert aside_scores(Prediction(), view(step(), image), None) == {}


def test_a_target_is_aside_by_its_name():
    assert kind_aside("images/aside_0_20cm.jpg") == "20 cm"
    assert kind_aside("aside_1_30deg.jpg") == "30°"
    assert kind_aside("images/input_0.jpg") == kind_aside("images/003.jpg") == kind_aside("besides_0_20cm.jpg") == ""

"""What a photo camera does to an image, each step by itself."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from posed import posed_views

from semgs.training.data.photo_camera import (
    Photo,
    add_noise,
    blur,
    compress,
    darken_corners,
    photograph,
    remove_colour,
    shake,
)


def flat(value: float, height: int = 60, width: int = 80) -> np.ndarray:
    """An image of one brightness."""
    return np.full((height, width, 3), value, dtype=np.float32)


def dot() -> np.ndarray:
    """A black image with one white pixel in row 20, column 30."""
    image = flat(0.0, 41, 61)
    image[20, 30] = 1
    return image


def test_vignetting_keeps_the_middle_and_takes_its_share_from_the_corners():
    seen = darken_corners(flat(0.8, 61, 81), 0.4)
    assert seen[30, 40, 1] == pytest.approx(0.8)
    edge_y, edge_x = 60 / 61, 80 / 81  # where the centre of a corner's pixel is, the corner itself at 1
    assert seen[0, 80] == pytest.approx(0.8 * (1 - 0.2 * (edge_x**2 + edge_y**2)), rel=1e-5)
    assert seen[0, 80, 0] == pytest.approx(0.8 * 0.6, rel=0.03)


def test_noise_has_the_standard_deviation_that_it_says_and_no_bias():
    seen = add_noise(flat(0.5, 200, 300), 0.03, np.random.default_rng(4))
    assert float(seen.std()) == pytest.approx(0.03, rel=0.01)
    assert float(seen.mean()) == pytest.approx(0.5, abs=3e-4)


def test_grey_has_equal_channels_of_the_brightness():
    image = flat(0.0)
    image[..., 0], image[..., 1], image[..., 2] = 0.5, 0.25, 1.0
    seen = remove_colour(image)
    assert seen == pytest.approx(0.299 * 0.5 + 0.587 * 0.25 + 0.114)
    assert (seen[..., 0] == seen[..., 1]).all()


def test_blur_spreads_a_dot_by_its_standard_deviation_and_keeps_its_light():
    seen = blur(dot(), 2.0)[..., 0].astype(np.float64)
    assert seen.sum() == pytest.approx(1, abs=1e-4)
    rows, columns = np.indices(seen.shape)
    assert (seen * rows).sum() == pytest.approx(20, abs=1e-3)
    assert np.sqrt((seen * (columns - 30) ** 2).sum()) == pytest.approx(2, rel=0.02)


def test_a_shake_draws_a_dot_into_a_line():
    seen = shake(dot(), 8.0, 0.0)[..., 0]
    assert seen[20, 26:35] == pytest.approx(1 / 9)  # four pixels to either side
    assert seen.sum() == pytest.approx(1)
    assert shake(dot(), 8.0, np.pi / 2)[16:25, 30, 0] == pytest.approx(1 / 9)


def test_jpeg_changes_less_the_better_it_is():
    image = np.random.default_rng(2).uniform(0, 1, (60, 80, 3)).astype(np.float32)
    good, bad = (float(np.abs(compress(image, quality) - image).mean()) for quality in (95, 20))
    assert 0 < good < bad
    assert compress(flat(51 / 255), 100) == pytest.approx(0.2, abs=1 / 255)


def test_gamma_and_balance_are_powers_and_factors():
    seen = Photo(balance=(1.0, 0.5, 3.0), gamma=2.0).taken(flat(0.5), np.random.default_rng(0))
    assert seen[7, 9] == pytest.approx([0.25, 0.0625, 1.0])


def test_a_photo_as_it_is_by_default_changes_nothing():
    image = np.random.default_rng(2).uniform(0, 1, (60, 80, 3)).astype(np.float32)
    assert np.array_equal(Photo().taken(image, np.random.default_rng(0)), image)


def test_strength_scales_what_is_drawn_and_one_photo_in_ten_is_grey():
    weak, strong = (
        [Photo.drawn(strength, np.random.default_rng(seed)) for seed in range(400)] for strength in (0.5, 1.0)
    )
    for one, other in zip(weak, strong, strict=True):
        assert one.gamma**2 == pytest.approx(other.gamma)
        assert (2 * one.noise, 2 * one.vignetting, 2 * one.blur) == pytest.approx(
            (other.noise, other.vignetting, other.blur)
        )
        assert (one.grey, one.jpeg is None) == (other.grey, other.jpeg is None)
    assert sum(one.grey for one in strong) == pytest.approx(40, abs=18)  # three standard deviations
    assert all(0.74 <= one.gamma <= 1.35 for one in strong)
    assert all(25 <= one.jpeg <= 90 for one in strong if one.jpeg is not None)


def test_views_stay_in_range_keep_labels_and_depend_on_the_generator_alone():
    views = posed_views(2, (48, 70), seed=4)
    views = views.changed(labels=torch.ones(2, 48, 70, dtype=torch.uint8))
    for seed in range(20):
        one, same = (photograph(views, 1.0, np.random.default_rng(seed)) for _ in range(2))
        assert torch.equal(one.images, same.images)
        assert 0 <= float(one.images.min()) <= float(one.images.max()) <= 1
        assert one.labels is views.labels
        assert one.cameras is views.cameras
    assert len(photograph(views.select([]), 1.0, np.random.default_rng(0))) == 0

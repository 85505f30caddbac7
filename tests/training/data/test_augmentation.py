"""Augmentation moves the cameras along: a point of the world stays where it is in the picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from posed import posed_views

from semgs.data.views import Views
from semgs.training.data.augmentation import Variation, crop_to_size, flip, recolour, roll, vary_exposure
from semgs.training.data.data_settings import Augmentation
from semgs.training.data.teacher import coordinates

SIZE = (48, 70)


def projected(views: Views, points: torch.Tensor) -> torch.Tensor:
    """Pixels of points of the world in each view [v n 2]."""
    seen = points @ views.cameras.camera_from_world[:, :3, :3].mT + views.cameras.camera_from_world[:, None, :3, 3]
    pixels = seen @ views.cameras.intrinsics.mT
    return pixels[..., :2] / pixels[..., 2:]


def in_front(views: Views) -> torch.Tensor:
    """Points of the world that the views see."""
    rays = torch.tensor([[0.1, -0.2, 3.0], [-0.4, 0.3, 2.0], [0.0, 0.0, 4.0]], dtype=torch.float64)
    pose = views.cameras.world_from_camera[0]
    return rays @ pose[:3, :3].T + pose[:3, 3]


def test_a_window_keeps_points_on_their_pixels():
    views = posed_views(2, SIZE, seed=4)
    points = in_front(views)
    before = projected(views, points)
    cut = crop_to_size(views, (30, 40), share=0.75, place=(0.2, 0.9))
    scale = 48 * 0.75 / 30
    width, height = 40 * scale, 30 * scale
    corner = torch.tensor([round(0.9 * (70 - width)), round(0.2 * (48 - height))])
    torch.testing.assert_close(projected(cut, points), (before - corner) / scale)
    # A column of the picture comes along: the one that the middle of the window lies on.
    x, y = (int(float(c)) for c in corner + torch.tensor([width, height]) / 2)
    torch.testing.assert_close(cut.images[..., 15, 20], views.images[..., y, x], atol=0.1, rtol=0)


def test_without_a_crop_the_middle_of_the_largest_window_is_kept():
    views = posed_views(2, SIZE, seed=4)
    assert crop_to_size(views, SIZE) is views
    cut = crop_to_size(views, (24, 24))
    expected = views.cameras.intrinsics[..., 0, 2] / 2 - 5.5
    torch.testing.assert_close(cut.cameras.intrinsics[..., 0, 2], expected)
    torch.testing.assert_close(cut.cameras.focal_px, views.cameras.focal_px / 2)


def test_a_flipped_world_is_seen_in_mirrored_pictures():
    views = posed_views(2, SIZE, seed=4)
    points = in_front(views)
    mirrored = flip(views)
    there = projected(mirrored, points * torch.tensor([-1.0, 1.0, 1.0], dtype=torch.float64))
    here = projected(views, points)
    torch.testing.assert_close(there, torch.stack((SIZE[1] - here[..., 0], here[..., 1]), -1))
    assert torch.equal(mirrored.images, views.images.flip(-1))
    twice = flip(mirrored)
    torch.testing.assert_close(twice.cameras.world_from_camera, views.cameras.world_from_camera)
    torch.testing.assert_close(twice.cameras.intrinsics, views.cameras.intrinsics)


def test_labels_and_depths_are_mirrored_with_their_picture():
    generator = torch.Generator().manual_seed(2)
    views = replace(
        posed_views(2, SIZE, seed=4),
        labels=torch.randint(0, 20, (2, *SIZE), generator=generator).to(torch.uint8),
        depths=1 + torch.rand(2, *SIZE, generator=generator),
    )
    mirrored = flip(views)
    for column in range(SIZE[1]):
        there = SIZE[1] - 1 - column
        assert torch.equal(mirrored.labels[..., there], views.labels[..., column])
        assert torch.equal(mirrored.depths[..., there], views.depths[..., column])


def test_factors_of_a_grey_picture_are_within_their_bounds_and_come_near_them():
    """Saturation leaves grey alone; what is left is exposure, exp(+-0.3), times white balance, exp(+-0.1) in each channel."""
    grey = posed_views(1, (1, 2), seed=4)
    grey = replace(grey, images=torch.full_like(grey.images, 0.4))
    changed = [recolour(grey, 0.3, np.random.default_rng(seed)).images[0, :, 0, 0] for seed in range(300)]
    logs = (torch.stack(changed).double() / 0.4).log()
    apart = logs.amax(1) - logs.amin(1)  # of the channels of one picture: at most 2 * 0.1
    assert 0.18 < apart.max() < 0.2 + 1e-6
    assert 0.36 < logs.amax() < 0.4 + 1e-6
    assert -0.4 - 1e-6 < logs.amin() < -0.36
    assert logs.mean(0).abs().max() < 0.05  # as often up as down: 0.18 / 300^0.5 = 0.01


def test_a_roll_turns_image_and_camera_together():
    """A point of the world stays on its pixel: an image of the places of its own pixels says where they came from."""
    views = posed_views(1, (48, 70), seed=4)
    turned = roll(coordinates(views), 20.0)
    pixel = torch.tensor([41.5, 20.5, 1.0], dtype=torch.float64)
    ray = turned.cameras.intrinsics[0].inverse() @ pixel
    point = turned.cameras.world_from_camera[0] @ torch.cat((3 * ray, torch.ones(1, dtype=torch.float64)))
    seen = views.cameras.intrinsics[0] @ (views.cameras.camera_from_world[0] @ point)[:3]
    there = seen[:2] / seen[2] / torch.tensor([70, 48])
    assert torch.allclose(turned.images[0, :2, 20, 41].double(), there, atol=1e-3)
    labelled = views.changed(labels=torch.zeros(1, 48, 70, dtype=torch.uint8))
    labels = roll(labelled, 20.0).labels
    assert labels is not None
    assert set(labels.unique().tolist()) == {0, 255}
    hidden = torch.zeros(1, 48, 70, dtype=torch.bool)
    hidden[0, :, 30:] = True
    masked = roll(views.changed(images=hidden[:, None].expand(1, 3, -1, -1).float(), hidden=hidden), 20.0)
    assert torch.equal(masked.hidden, masked.images[:, 0] > 0)
    assert torch.equal(roll(views.changed(hidden=hidden), 0.0).hidden, hidden)
    assert torch.equal(roll(labelled, 0.0).images, views.images)


def test_colours_change_alike_in_all_views_and_stay_colours():
    views = posed_views(2, SIZE, seed=4)
    rng = np.random.default_rng(1)
    changed = recolour(views, 0.3, rng)
    assert not torch.allclose(changed.images, views.images, atol=0.02)
    assert (changed.images.min() >= 0, changed.images.max() <= 1) == (True, True)
    one = recolour(views.select([1]), 0.3, np.random.default_rng(1))
    torch.testing.assert_close(one.images, changed.images[1:])


def test_exposure_changes_each_view_by_itself():
    """Two views of the same grey: exposures of exp(+-0.3) differ by 0.2 in the mean of their logs (a third of the range of 0.6)."""
    grey = posed_views(2, (1, 2), seed=4)
    grey = replace(grey, images=torch.full_like(grey.images, 0.4))
    changed = [vary_exposure(grey, 0.3, np.random.default_rng(seed)).images for seed in range(300)]
    logs = (torch.stack(changed)[..., 0, 0].double() / 0.4).log().mean(-1)
    assert 0.18 < (logs[:, 0] - logs[:, 1]).abs().mean() < 0.22
    varied = Variation(Augmentation(exposure=0.3), 3, 7)(grey, (1, 2)).images
    assert abs(float(varied[0].mean() / varied[1].mean()) - 1) > 0.02, "the setting reaches the samples"


def test_the_variation_of_a_sample_depends_on_seed_and_number_alone():
    views = posed_views(3, SIZE, seed=4)
    settings = Augmentation(colour=0.2, crop=0.5, flip=True)
    one, same, other = (Variation(settings, 3, k)(views, (32, 48)) for k in (7, 7, 8))
    assert torch.equal(one.images, same.images)
    assert torch.equal(one.cameras.intrinsics, same.cameras.intrinsics)
    assert not torch.equal(one.images, other.images)
    both = Variation(settings, 3, 7)
    assert torch.equal(both(views.select([2]), (32, 48)).images, one.images[2:]), "contexts and targets vary alike"


def test_without_augmentation_nothing_is_touched():
    views = posed_views(2, SIZE, seed=4)
    assert Variation(Augmentation(), 3, 7)(views, SIZE) is views


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("colour", -0.1, "0 to 1"),
        ("crop", 0.0, "0.2 to 1"),
        ("crop", 1.2, "0.2 to 1"),
        ("roll", -1.0, "0 to 45"),
        ("roll", 50.0, "0 to 45"),
        ("camera", 1.5, "0 to 1"),
        ("exposure", -0.1, "0 to 1"),
    ],
)
def test_augmentations_that_cannot_be_are_refused(name, value, expected):
    with pytest.raises(ValueError, match=f"^{name} is {value}; expected {expected}$"):
        Augmentation(**{name: value})

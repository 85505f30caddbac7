"""Exposure: what is fitted where photos see the same surface, and what it does to photos and Gaussians."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from mapping_walls import SIZE, cameras_at, encoded

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras, back_project
from semgs.run.steps.notes import note_on_exposures
from semgs.scene import exposure
from semgs.scene.encoding import Encoding
from semgs.scene.exposure import Exposures, exposure_as_rendered, fit_exposures
from semgs.scene.overlap import inside

WALL = 4.0


@pytest.fixture(autouse=True)
def few_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    """The images are small: every pixel is compared."""
    monkeypatch.setattr(exposure, "STEP", 1)
    monkeypatch.setattr(exposure, "THIN", 1)
    monkeypatch.setattr(exposure, "FEWEST", 20)


def photos(gains: torch.Tensor, offsets: torch.Tensor, *places: float) -> tuple[Views, Encoding]:
    """Photos of a wall whose colours change slowly, each with its own exposure [v 3], and their Gaussians."""
    cameras = cameras_at(*places)
    depths = torch.full((len(places), *SIZE), WALL)
    x, y, _ = back_project(depths.double(), cameras).unbind(-1)
    colours = torch.stack(((1.1 * x).sin(), (0.9 * y).cos(), (x + y).sin()), 1) * 0.2 + 0.4
    images = gains[..., None, None] * colours + offsets[..., None, None]
    views = Views(images.float(), cameras, [[0.5, 10.0]] * len(places))
    return views, encoded(cameras, depths)


SAME = torch.ones(2, 3), torch.zeros(2, 3)


def test_photos_with_known_exposures_become_equal() -> None:
    """Both cameras are at one place, so every pixel matches. A photo 0.8 c + 0.05 beside c comes to sqrt(1.25), which is the inverse of the other gain."""
    gains, offsets = torch.tensor([[1.0, 1, 1], [0.8, 0.7, 1.2]]), torch.tensor([[0.0, 0, 0], [0.05, 0.1, -0.1]])
    views, encoding = photos(gains, offsets, 0.0, 0.0)
    fitted = fit_exposures(views, encoding.depths, encoding.depth_spread)
    assert fitted.gains[1, 0].item() == pytest.approx(1.25**0.5, rel=1e-5)
    torch.testing.assert_close(fitted.gains[1] / fitted.gains[0], 1 / gains[1])
    torch.testing.assert_close(fitted.gains.prod(0), torch.ones(3))
    torch.testing.assert_close(fitted.offsets.sum(0), torch.zeros(3), atol=1e-6, rtol=0)
    even = fitted.applied(views).images
    torch.testing.assert_close(even[0], even[1], atol=1e-5, rtol=0)
    assert fitted.before > 0.001
    assert fitted.after < 1e-10
    assert fitted.differ


def test_only_surfaces_that_both_see_are_compared_and_warped_by_depth() -> None:
    """1.5 m aside at 4 m depth the images move by 6 of 18 columns; without warping, gains would not be found."""
    gains = torch.tensor([[1.0, 1, 1], [0.75, 0.75, 0.75]])
    views, encoding = photos(gains, torch.zeros(2, 3), 0.0, 1.5)
    fitted = fit_exposures(views, encoding.depths, encoding.depth_spread)
    torch.testing.assert_close(fitted.gains[1] / fitted.gains[0], torch.full((3,), 4 / 3), rtol=0.02, atol=0)
    blind = fit_exposures(views, 1000 * encoding.depths, encoding.depth_spread)
    assert not torch.allclose(blind.gains[1] / blind.gains[0], torch.full((3,), 4 / 3), rtol=0.02, atol=0)


def test_photos_of_one_exposure_stay_as_they_are() -> None:
    views, encoding = photos(*SAME, 0.0, 1.5)
    fitted = fit_exposures(views, encoding.depths, encoding.depth_spread)
    assert not fitted.differ
    torch.testing.assert_close(fitted.gains, torch.ones(2, 3), atol=0.03, rtol=0)
    torch.testing.assert_close(fitted.offsets, torch.zeros(2, 3), atol=0.02, rtol=0)


def test_hidden_and_saturated_pixels_say_nothing() -> None:
    views, encoding = photos(torch.tensor([[1.0] * 3, [0.8] * 3]), torch.zeros(2, 3), 0.0, 0.0)
    images, hidden = views.images.clone(), torch.zeros(2, *SIZE, dtype=torch.bool)
    images[0, :, 0], hidden[0, 0] = 0, True
    images[1, :, 1], hidden[1, 1] = 0, True
    images[0, :, 2] = 1
    fitted = fit_exposures(views.changed(images=images, hidden=hidden), encoding.depths, encoding.depth_spread)
    torch.testing.assert_close(fitted.gains[1] / fitted.gains[0], torch.full((3,), 1.25))


def test_a_flat_wall_says_nothing_about_gains_and_all_about_offsets() -> None:
    views, encoding = photos(*SAME, 0.0, 0.0)
    images = torch.tensor([0.3, 0.5])[:, None, None, None].expand_as(views.images).clone()
    fitted = fit_exposures(views.changed(images=images), encoding.depths, encoding.depth_spread)
    torch.testing.assert_close(fitted.gains, torch.ones(2, 3))
    torch.testing.assert_close(fitted.offsets, torch.tensor([[0.1] * 3, [-0.1] * 3]))


def test_a_photo_that_shares_nothing_keeps_its_exposure_and_others_do_not_mind() -> None:
    gains = torch.tensor([[1.0] * 3, [0.5] * 3, [0.25] * 3])
    views, encoding = photos(gains, torch.zeros(3, 3), 0.0, 0.0, 100.0)
    fitted = fit_exposures(views, encoding.depths, encoding.depth_spread)
    torch.testing.assert_close(fitted.gains, torch.tensor([[0.5**0.5] * 3, [2**0.5] * 3, [1.0] * 3]))
    alone = fit_exposures(views.select([0, 2]), encoding.depths[[0, 2]], encoding.depth_spread[[0, 2]])
    assert torch.equal(alone.gains, torch.ones(2, 3))
    assert (alone.before, alone.after, alone.differ) == (0, 0, False)


def test_three_photos_agree_though_the_outer_two_share_nothing() -> None:
    """Gains of 1, 2 and 4 in a row of cameras: the common exposure is that of the middle one."""
    views, encoding = photos(torch.tensor([[0.5] * 3, [1.0] * 3, [2.0] * 3]) * 0.7, torch.zeros(3, 3), 0.0, 2.5, 5.0)
    fitted = fit_exposures(views, encoding.depths, encoding.depth_spread)
    torch.testing.assert_close(fitted.gains[:, 0], torch.tensor([2.0, 1.0, 0.5]), rtol=0.1, atol=0)


def test_gaussians_get_the_gain_and_offset_of_their_own_photo() -> None:
    """A grey Gaussian, 0.5, becomes 0.5 * 1.2 - 0.05 = 0.55 in photo 0 and 0.5 * 0.9 = 0.45 in photo 1, from every side."""
    _, encoding = photos(*SAME, 0.0, 1.0)
    count = SIZE[0] * SIZE[1]
    exposures = Exposures(torch.tensor([[1.2] * 3, [0.9] * 3]), torch.tensor([[-0.05] * 3, [0.0] * 3]), 1.0, 0.0)
    constant = exposures.recoloured(encoding).gaussians.colour.features[:, 0]
    colours = 0.5 + 0.28209479 * constant
    torch.testing.assert_close(colours[:count], torch.full((count, 3), 0.55))
    torch.testing.assert_close(colours[count:], torch.full((count, 3), 0.45))
    places = encoding.without((torch.arange(2 * count) % 3 == 0).reshape(2, *SIZE))
    assert torch.equal(exposures.recoloured(places).gaussians.colour.features[:, 0], constant[places.places])


def test_photos_of_a_walk_are_compared_with_those_that_see_most_of_them() -> None:
    """Eleven photos a column apart: the first two and the last two are left out by each other. Four at one place are all compared."""
    views, encoding = photos(torch.ones(11, 3), torch.zeros(11, 3), *(0.25 * place for place in range(11)))
    points = back_project(encoding.depths, views.cameras)
    pairs = exposure._partners(points, views.cameras)
    assert len(pairs) == 11 * 10 // 2 - 4
    assert {(0, 9), (0, 10), (1, 9), (1, 10)}.isdisjoint(pairs)
    few, encoded_few = photos(torch.ones(4, 3), torch.zeros(4, 3), 0.0, 0.0, 0.0, 0.0)
    assert len(exposure._partners(back_project(encoded_few.depths, few.cameras), few.cameras)) == 6


@pytest.mark.parametrize("count", [5, 10])
def test_twice_as_many_photos_are_compared_in_twice_the_memory(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each of the height x width points of each photo is put into one camera at a time, not into all."""
    views, encoding = photos(torch.ones(count, 3), torch.zeros(count, 3), *(0.25 * place for place in range(count)))
    sizes = []

    def counted(means: torch.Tensor, cameras: Cameras) -> torch.Tensor:
        sizes.append(len(means) * cameras.batch[0])
        return inside(means, cameras)

    monkeypatch.setattr(exposure, "inside", counted)
    exposure._partners(back_project(encoding.depths, views.cameras), views.cameras)
    assert max(sizes) == count * SIZE[0] * SIZE[1]


def test_a_channel_without_contrast_says_nothing_about_gains() -> None:
    """Red is the same everywhere, 0.4 in one photo and 0.6 in the other: no gain, and offsets of half the difference each. Its noise differs fourfold."""
    views, encoding = photos(*SAME, 0.0, 0.0)
    images = views.images.clone()
    noise = 0.001 * torch.randn(SIZE, generator=torch.Generator().manual_seed(0))
    images[0, 0], images[1, 0] = 0.4 + noise, 0.6 + 4 * noise
    fitted = fit_exposures(views.changed(images=images), encoding.depths, encoding.depth_spread)
    torch.testing.assert_close(fitted.gains[:, 0], torch.ones(2))
    torch.testing.assert_close(fitted.offsets[:, 0], torch.tensor([0.1, -0.1]), atol=1e-3, rtol=0)


def test_a_held_out_photo_gets_the_mean_and_deviation_of_its_rendering() -> None:
    """A photo 0.5 c + 0.2 comes to c, where the rendering is c. Hidden pixels, the upper two rows, do not count: they are black, and would change both."""
    views, _ = photos(*SAME, 0.0, 0.4)
    c, hidden = views.images, torch.zeros(2, *SIZE, dtype=torch.bool)
    hidden[:, :2] = True
    taken = torch.where(hidden[:, None], 0.0, 0.5 * c + 0.2)
    alphas = torch.stack((torch.ones(SIZE), torch.zeros(SIZE)))
    even = exposure_as_rendered(views.changed(images=taken, hidden=hidden), c, alphas).images
    torch.testing.assert_close(even[0][:, 2:], c[0][:, 2:], atol=1e-5, rtol=0)
    assert torch.equal(even[1], taken[1]), "nothing is rendered there, so the photo stays as it was taken"


def test_of_three_photos_the_mean_colours_decide_whether_exposures_differ() -> None:
    """The second photo is 0.1 brighter: of three pairs, two differ by 0.1, so the mean squared difference of means is 2/3 of 0.01; afterwards it is 0. At a wrong depth
    pixels do not match, and a common exposure explains less of their differences; the means stay."""
    offsets = torch.zeros(3, 3)
    offsets[1] = 0.1
    views, encoding = photos(torch.ones(3, 3), offsets, 0.0, 0.0, 0.0)
    fitted = fit_exposures(views, encoding.depths, encoding.depth_spread)
    assert fitted.means_before == pytest.approx(0.02 / 3, rel=1e-4)
    assert fitted.means_after == pytest.approx(0, abs=1e-8)
    noisy = Exposures(fitted.gains, fitted.offsets, 0.03, 0.027, fitted.means_before, fitted.means_after)
    assert noisy.differ
    assert note_on_exposures(noisy).values["before"] == pytest.approx(8.165, rel=1e-3), "100 sqrt(0.02 / 3), of means"
    assert note_on_exposures(replace(noisy, means_before=0.0003)).values["before"] == pytest.approx(17.32, rel=1e-3)
    assert not replace(noisy, means_before=0.0003).differ, "less than 0.02 apart"
    assert not replace(noisy, gains=fitted.gains[:2], offsets=fitted.offsets[:2]).differ, (
        "of two photos the means are always equal afterwards"
    )

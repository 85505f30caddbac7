"""Lenses: distortion is undone to a tenth of a pixel, half pixels included."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from landmarks import drawn, found

from semgs.data.cameras.lens import Lens

SIZE = (240, 330)
FOCAL, CENTRE = (300.0, 290.0), (171.3, 113.6)
DISTORTIONS = [
    (-0.25, 0.08, 0.0, 0.0, 0.0),
    (0.18, -0.1, 0.004, -0.006, 0.03),
    (0.0578421, -0.0805099, -0.000980296, 0.00015575, 0.0),
]
RAYS = np.array([[x, y] for x in np.linspace(-0.42, 0.4, 6) for y in np.linspace(-0.3, 0.34, 4)])


def distorted(rays: np.ndarray, k1: float, k2: float, p1: float, p2: float, k3: float) -> np.ndarray:
    """Pixels of rays (x, y, 1) by the model's formula."""
    x, y = rays.T
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack((FOCAL[0] * u + CENTRE[0], FOCAL[1] * v + CENTRE[1]), axis=1)


@pytest.mark.parametrize("distortion", DISTORTIONS)
def test_known_rays_are_seen_where_the_pinhole_puts_them_after_undistortion(distortion):
    lens = Lens(SIZE, FOCAL, CENTRE, distortion)
    picture = lens.undistorted(drawn(SIZE, distorted(RAYS, *distortion)), lens.maps())
    k = lens.intrinsics
    expected = RAYS * (k[0, 0], k[1, 1]) + (k[0, 2], k[1, 2])
    inside = ((expected > 9) & (expected < np.array(SIZE[::-1]) - 9)).all(axis=1)
    assert inside.sum() >= 12
    seen = found(torch.from_numpy(picture).permute(2, 0, 1) / 255, expected[inside])
    assert (
        np.abs(seen - expected[inside]).max() < 0.1
    )  # without the half pixel it would be 0.5 times the change of scale and more


@pytest.mark.parametrize("distortion", DISTORTIONS)
def test_no_pixel_comes_from_outside_the_picture(distortion):
    x, y = Lens(SIZE, FOCAL, CENTRE, distortion).maps()
    assert min(x.min(), y.min()) > -1
    assert x.max() < SIZE[1]
    assert y.max() < SIZE[0]


def test_the_half_pixel_is_respected():
    # A lens without centre shift and distortion strong at the edge: the ray of the principal point stays on it.
    lens = Lens(SIZE, FOCAL, CENTRE, DISTORTIONS[0])
    x, y = lens.maps()
    k = lens.intrinsics
    row, column = int(k[1, 2]), int(k[0, 2])
    offset = np.array([column + 0.5 - k[0, 2], row + 0.5 - k[1, 2]]) / (k[0, 0], k[1, 1])
    expected = distorted(offset[None], *DISTORTIONS[0])[0]
    assert np.abs(np.array([x[row, column], y[row, column]]) + 0.5 - expected).max() < 1e-3


def test_a_pinhole_keeps_its_numbers():
    lens = Lens(SIZE, FOCAL, CENTRE)
    assert lens.is_pinhole
    np.testing.assert_array_equal(lens.intrinsics, [[300, 0, 171.3], [0, 290, 113.6], [0, 0, 1]])


@pytest.mark.parametrize("distortion", [*DISTORTIONS, (0.0, 0.0, 0.0, 0.0, 0.0)])
def test_directions_are_the_rays_of_stored_pixels(distortion):
    lens = Lens(SIZE, FOCAL, CENTRE, distortion)
    directions = lens.directions(distorted(RAYS, *distortion))
    np.testing.assert_allclose(directions, np.c_[RAYS, np.ones(len(RAYS))], atol=1e-4)
    assert lens.directions(np.zeros((0, 2))).shape == (0, 3)


@pytest.mark.parametrize("distortion", [(-0.25, 0.06, 0.001, 0.0, 0.0), (0.1, -0.08, 0.0, 0.002, 0.01)])
def test_directions_are_exact_at_the_edges_of_wide_lenses(distortion):
    """Rays up to 1.3 from the axis, 104 degrees across: OpenCV's five steps miss them by up to 0.8 px of a focal length of 900."""
    rays = 2.5 * RAYS
    assert np.linalg.norm(rays, axis=1).max() > 1.3
    wide = Lens(SIZE, (170.0, 170.0), (165.0, 120.0), distortion)
    pixels = (distorted(rays, *distortion) - CENTRE) / FOCAL * 170 + (165, 120)
    np.testing.assert_allclose(wide.directions(pixels), np.c_[rays, np.ones(len(rays))], atol=1e-8)


def test_where_a_lens_images_no_ray_there_is_none():
    """r (1 - 0.25 r^2) is 0.7698 at most, at r^2 = 4 / 3: nothing is seen further out in the image, all around, although r = -2.31 would give 0.775."""
    lens = Lens((108, 192), (90.0, 90.0), (96.0, 54.0), (-0.25, 0.0, 0.0, 0.0, 0.0))
    angles = np.linspace(0, 2 * np.pi, 37)
    around = np.stack((np.cos(angles), np.sin(angles)), axis=1)

    for radius in (0.6, 0.76):
        seen = lens.directions(90 * radius * around + lens.centre)
        found = np.linalg.norm(seen[:, :2], axis=1)
        np.testing.assert_allclose(found * (1 - 0.25 * found**2), radius, atol=1e-8)
        np.testing.assert_allclose(seen[:, :2], found[:, None] * around, atol=1e-8)
        assert found.max() < 1.1547
    for radius in (0.775, 0.78, 0.9, 1.2):
        assert np.isnan(lens.directions(90 * radius * around + lens.centre)[:, :2]).all()


def test_pixels_beyond_the_fold_of_a_model_are_empty():
    """The same lens: rays further from the axis than the root of 4 / 3 = 1.1547 are imaged where nearer ones are, too."""
    lens = Lens((108, 192), (90.0, 90.0), (96.0, 54.0), (-0.25, 0.0, 0.0, 0.0, 0.0))
    k, (column, row) = lens.intrinsics, np.meshgrid(np.arange(192) + 0.5, np.arange(108) + 0.5)
    radius = np.hypot((column - k[0, 2]) / k[0, 0], (row - k[1, 2]) / k[1, 1])
    pixel = 1 / k[0, 0]
    empty = lens.empty(lens.maps())
    assert (radius > 1.1547 + pixel).sum() > 50
    assert empty[radius > 1.1547 + pixel].all()
    assert not empty[radius < 1.1547 - pixel].any()
    assert not Lens(SIZE, FOCAL, CENTRE, DISTORTIONS[0]).empty(Lens(SIZE, FOCAL, CENTRE, DISTORTIONS[0]).maps()).any()


def test_labels_are_undone_from_the_nearest_pixel_without_mixing():
    lens = Lens(SIZE, FOCAL, CENTRE, DISTORTIONS[0])
    labels = np.random.default_rng(0).choice(np.array([3, 200], dtype=np.uint8), SIZE)
    maps = lens.maps()
    undone = lens.undistorted(labels, maps, nearest=True)
    x, y = (np.clip(np.floor(part + 0.5).astype(int), 0, side - 1) for part, side in zip(maps, SIZE[::-1], strict=True))
    assert (undone == labels[y, x]).mean() > 0.999  # OpenCV rounds exact halves to even


@pytest.mark.parametrize(
    ("size", "focal", "centre"),
    [
        ((0, 5), FOCAL, CENTRE),
        (SIZE, (0.0, 5.0), CENTRE),
        (SIZE, (float("nan"), 5.0), CENTRE),
        (SIZE, FOCAL, (1.0, float("inf"))),
    ],
)
def test_lenses_that_cannot_be_are_refused(size, focal, centre):
    with pytest.raises(ValueError, match="expected"):
        Lens(size, focal, centre)


@pytest.mark.parametrize("k1", [-1e6, -3.0, -1.0, 1e6])
def test_distortion_that_folds_over_within_the_picture_is_refused(k1):
    with pytest.raises(ValueError, match="cannot be undone over the whole picture"):
        Lens(SIZE, FOCAL, CENTRE, (k1, 0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("size", "focal", "centre", "message"),
    [
        (SIZE, (3.2, 290.0), CENTRE, r"0\.01 to 100 times the longer side of 330 px"),
        (SIZE, (300.0, 33001.0), CENTRE, r"0\.01 to 100 times the longer side of 330 px"),
        (SIZE, FOCAL, (171.3, -3301.0), r"principal point \(171\.3, -3301\.0\) px; expected it within 10 times"),
        ((8192, 8193), (9000.0, 9000.0), (4096.0, 4096.0), "at most 67,108,864 pixels"),
        ((2**40, 2**40), (2.0**40, 2.0**40), CENTRE, "at most 67,108,864 pixels"),
        (SIZE, (np.inf, 290.0), CENTRE, "expected finite numbers"),
        (SIZE, FOCAL, (np.nan, 120.0), "expected finite numbers"),
    ],
)
@pytest.mark.parametrize("distortion", [(0.0,) * 5, DISTORTIONS[0]])
def test_cameras_that_nobody_has_are_refused_with_the_bound(size, focal, centre, message, distortion):
    with pytest.raises(ValueError, match=message):
        Lens(size, focal, centre, distortion)


def test_cameras_at_the_bounds_are_taken():
    assert Lens(SIZE, (3.301, 33000.0), (3300.0, -3300.0)).is_pinhole
    assert Lens((8192, 8192), (9000.0, 9000.0), (4096.0, 4096.0)).is_pinhole


def test_undistortion_says_which_pixels_it_leaves_empty():
    """The sources of the left column are 3 pixels outside of an image of 4x6, those of the last row half a pixel: a pixel's own margin."""
    lens = Lens((4, 6), (5.0, 5.0), (3.0, 2.0))
    x, y = np.meshgrid(np.arange(6.0), np.arange(4.0))
    x[:, 0], y[3] = -3, 3.5
    empty = lens.empty((x, y))
    assert empty[:, 0].all()
    assert not empty[:, 1:].any()

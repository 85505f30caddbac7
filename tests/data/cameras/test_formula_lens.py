"""Lenses that OpenCV does not have, against numbers worked out by hand and against COLMAP itself."""

from __future__ import annotations

from math import atan, hypot, pi, sqrt, tan

import numpy as np
import pytest
import torch
from landmarks import drawn, found

from semgs.data.cameras.formula_lens import FORMULAS, FormulaLens

SIZE = (240, 330)
FOCAL, CENTRE = (300.0, 290.0), (171.3, 113.6)
LENSES = {
    "FULL_OPENCV": (0.1, -0.05, 0.003, -0.004, 0.02, 0.03, -0.01, 0.005),
    "FOV": (0.7,),
    "DIVISION": (-0.1,),
    "EUCM": (0.6, 1.1),
    "THIN_PRISM_FISHEYE": (0.02, -0.01, 0.002, -0.003, 0.004, 0.001, 0.02, -0.01),
    "RAD_TAN_THIN_PRISM_FISHEYE": (0.02, -0.01, 0.004, 0.003, -0.002, 0.001, 0.002, -0.001, 0.03, 0.01, -0.02, 0.015),
}
RAYS = np.array([[x, y] for x in np.linspace(-0.42, 0.4, 6) for y in np.linspace(-0.3, 0.34, 4)])


def lens_of(model: str) -> FormulaLens:
    return FormulaLens(SIZE, FOCAL, CENTRE, model, LENSES[model])


def imaged(model: str, rays: np.ndarray) -> np.ndarray:
    """Pixels of rays (x, y, 1) by COLMAP."""
    pycolmap = pytest.importorskip("pycolmap")
    camera = pycolmap.Camera(model=model, width=SIZE[1], height=SIZE[0], params=[*FOCAL, *CENTRE, *LENSES[model]])
    return camera.img_from_cam(np.c_[rays, np.ones(len(rays))])


@pytest.mark.parametrize(
    ("model", "values", "x"),
    [
        ("FULL_OPENCV", (0.25, 0.0, 0.0, 0.1, 0.0, 1.0, 0.0, 0.0), 0.5 * (1 + 0.0625) / 1.25 + 0.1 * 3 * 0.25),
        ("FOV", (1.0,), atan(2 * 0.5 * tan(0.5))),
        ("FOV", (0.0,), 0.5),
        ("DIVISION", (-0.75,), 2 * 0.5 / (1 + sqrt(1.75))),
        ("EUCM", (0.5, 12.0), 0.5 / (0.5 * 2 + 0.5)),
        ("THIN_PRISM_FISHEYE", (0.0,) * 6 + (0.5, 0.0), atan(0.5) + 0.5 * atan(0.5) ** 2),
        ("RAD_TAN_THIN_PRISM_FISHEYE", (1.0,) + (0.0,) * 11, atan(0.5) * (1 + atan(0.5) ** 2)),
        ("RAD_TAN_THIN_PRISM_FISHEYE", (0.0,) * 9 + (1.0, 0.0, 0.0), atan(0.5) + atan(0.5) ** 4),
        ("RAD_TAN_THIN_PRISM_FISHEYE", (0.0,) * 6 + (0.1,) + (0.0,) * 5, atan(0.5) + 0.3 * atan(0.5) ** 2),
    ],
)
def test_where_a_ray_is_seen_is_worked_out_by_hand(model: str, values: tuple[float, ...], x: float):
    (u,), _ = FORMULAS[model][1](np.array([0.5]), np.array([0.0]), values)
    assert u == pytest.approx(x, abs=1e-12)
    assert len(values) == FORMULAS[model][0]


def test_the_division_of_the_place_in_the_image_gives_the_ray_back():
    (u,), (v,) = FORMULAS["DIVISION"][1](np.array([0.3]), np.array([-0.4]), (-0.2,))
    assert (u / (1 - 0.2 * (u * u + v * v)), v / (1 - 0.2 * (u * u + v * v))) == pytest.approx((0.3, -0.4))


@pytest.mark.parametrize("model", LENSES)
def test_colmap_sees_rays_at_the_same_places_and_they_come_back(model: str):
    pixels = imaged(model, RAYS)
    np.testing.assert_allclose(lens_of(model).directions(pixels), np.c_[RAYS, np.ones(len(RAYS))], atol=1e-9)
    assert lens_of(model).directions(np.zeros((0, 2))).shape == (0, 3)


@pytest.mark.parametrize("model", LENSES)
def test_known_rays_are_seen_where_the_pinhole_puts_them_after_undistortion(model: str):
    lens = lens_of(model)
    picture = lens.undistorted(drawn(SIZE, imaged(model, RAYS)), lens.maps())
    k = lens.intrinsics
    expected = RAYS * (k[0, 0], k[1, 1]) + (k[0, 2], k[1, 2])
    inside = ((expected > 9) & (expected < np.array(SIZE[::-1]) - 9)).all(axis=1)
    assert inside.sum() >= 12
    seen = found(torch.from_numpy(picture).permute(2, 0, 1) / 255, expected[inside])
    assert np.abs(seen - expected[inside]).max() < 0.1


@pytest.mark.parametrize("model", LENSES)
def test_every_pixel_comes_from_the_image_and_one_side_reaches_its_border(model: str):
    x, y = lens_of(model).maps()
    # Positions of pixel centres: the border of the image is half a pixel outside of them.
    assert min(x.min(), y.min()) > -0.5
    assert x.max() < SIZE[1] - 0.5
    assert y.max() < SIZE[0] - 0.5
    assert x.min() < 0.5
    assert not lens_of(model).empty((x, y)).any()


def test_a_field_of_view_without_distortion_keeps_the_numbers_of_the_pinhole():
    lens = FormulaLens(SIZE, FOCAL, CENTRE, "FOV", (0.0,))
    np.testing.assert_allclose(lens.intrinsics, [[300, 0, 171.3], [0, 290, 113.6], [0, 0, 1]], atol=1e-6)


def test_a_map_is_the_place_of_the_centre_of_each_pixel():
    lens = lens_of("EUCM")
    k, (x, y) = lens.intrinsics, lens.maps()
    ray = ((40.5 - k[0, 2]) / k[0, 0], (30.5 - k[1, 2]) / k[1, 1])
    factor = 1 / (0.6 * sqrt(1.1 * hypot(*ray) ** 2 + 1) + 0.4)
    expected = (300 * factor * ray[0] + 171.3 - 0.5, 290 * factor * ray[1] + 113.6 - 0.5)
    assert (x[30, 40], y[30, 40]) == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize(
    ("model", "values", "focal", "what"),
    [
        ("FOV", (0.1, 0.2), 300.0, "lens FOV with 2 coefficients; expected FULL_OPENCV with 8, FOV with 1"),
        ("FISHEYE", (), 300.0, "lens FISHEYE with 0 coefficients"),
        ("EUCM", (0.6, float("nan")), 300.0, "expected finite numbers"),
        ("EUCM", (0.6, -20.0), 300.0, "cannot be undone over the whole picture"),  # the root of a negative number
        ("DIVISION", (4.0,), 300.0, "cannot be undone over the whole picture"),  # it images no ray beyond 1 / 4
        ("THIN_PRISM_FISHEYE", (0.0,) * 8, 2 * 165 / pi - 1, "cannot be undone over the whole picture"),  # half a turn
        ("FULL_OPENCV", (-2.0,) + (0.0,) * 7, 300.0, "cannot be undone over the whole picture"),  # it folds over
    ],
)
def test_what_cannot_be_undone_is_refused(model: str, values: tuple[float, ...], focal: float, what: str):
    with pytest.raises(ValueError, match=what):
        FormulaLens(SIZE, (focal, focal), CENTRE, model, values)

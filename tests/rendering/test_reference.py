"""The specification by hand: single Gaussians, order, thresholds, the clamped Jacobian, finite differences."""

from __future__ import annotations

import math

import pytest
import torch

from semgs.geometry.cameras import Cameras
from semgs.geometry.rotations import covariance, matrix_from_quaternion, quaternion_from_matrix
from semgs.rendering import numba_backend, reference
from semgs.rendering.splats import Layer, Pinhole, Splats

BACKENDS = pytest.mark.parametrize("drawing", [reference, numba_backend], ids=["reference", "numba"])
HEIGHT, WIDTH = 20, 35
FX, FY, CX, CY = 40.0, 36.0, 15.5, 8.5  # the optical axis meets the centre of pixel (row 8, column 15)


def _camera() -> Pinhole:
    pose = torch.eye(4, dtype=torch.float64)
    pose[:3, :3] = matrix_from_quaternion(torch.tensor([0.9, 0.1, -0.3, 0.2], dtype=torch.float64))
    pose[:3, 3] = torch.tensor([0.3, -1.2, 0.7])
    return Pinhole.of(Cameras(pose, [[FX, 0, CX], [0, FY, CY], [0, 0, 1]], (HEIGHT, WIDTH)))


def _splats(camera: Pinhole, inside: list, scales: list, opacities: list, features: list) -> Splats:
    """Gaussians at positions in the camera's frame, with axes along the camera's."""
    numbers = [torch.tensor(one, dtype=torch.float64) for one in (inside, scales, opacities, features)]
    means = numbers[0] @ camera.axes + camera.centre
    quaternions = quaternion_from_matrix(camera.axes.mT).expand(len(means), 4).contiguous()
    return Splats(means, quaternions, *numbers[1:])


def _draw(drawing, splats: Splats, camera: Pinhole, near: float | None = None) -> Layer:
    return drawing.splat(splats, drawing.depth_order(splats.means, camera, near), camera)


@BACKENDS
def test_one_gaussian_on_the_axis_is_what_the_formula_says(drawing) -> None:
    camera = _camera()
    layer = _draw(drawing, _splats(camera, [[0, 0, 2.0]], [[0.1, 0.2, 0.3]], [0.7], [[5.0]]), camera)
    variance_x, variance_y = (FX * 0.1 / 2) ** 2 + 0.3, (FY * 0.2 / 2) ** 2 + 0.3
    for row, column in ((8, 15), (8, 17), (11, 14), (5, 12)):
        alpha = 0.7 * math.exp(-0.5 * ((column - 15) ** 2 / variance_x + (row - 8) ** 2 / variance_y))
        assert alpha > 1 / 255
        assert layer.picture[0, row, column].item() == pytest.approx(5 * alpha, rel=1e-12)
        assert layer.transmittance[row, column].item() == pytest.approx(1 - alpha, rel=1e-12)
    assert layer.picture[0, 19, 34] == 0
    assert layer.transmittance[19, 34] == 1


@BACKENDS
def test_the_front_gaussian_hides_the_back_one_whatever_their_order(drawing) -> None:
    camera = _camera()
    front, back = [0.0, 0.0, 1.0], [0.0, 0.0, 3.0]
    for inside, features in (([front, back], [[1.0], [100.0]]), ([back, front], [[100.0], [1.0]])):
        layer = _draw(drawing, _splats(camera, inside, [[0.2] * 3] * 2, [0.9, 0.9], features), camera)
        assert layer.picture[0, 8, 15].item() == pytest.approx(0.9 + 0.1 * 0.9 * 100, rel=1e-12)


@BACKENDS
def test_equal_depths_are_drawn_in_the_order_of_their_index(drawing) -> None:
    camera = _camera()
    splats = _splats(camera, [[0, 0, 2.0]] * 9, [[0.2] * 3] * 9, [0.5] * 9, [[float(i)] for i in range(9)])
    assert drawing.depth_order(splats.means, camera, None).tolist() == list(range(9))
    expected = sum(i * 0.5 ** (i + 1) for i in range(9))
    assert _draw(drawing, splats, camera).picture[0, 8, 15].item() == pytest.approx(expected, rel=1e-12)


@BACKENDS
def test_no_alpha_exceeds_0_999(drawing) -> None:
    camera = _camera()
    layer = _draw(drawing, _splats(camera, [[0, 0, 2.0]], [[0.2] * 3], [1.0], [[1.0]]), camera)
    assert layer.transmittance[8, 15].item() == pytest.approx(1e-3, rel=1e-10)


@BACKENDS
@pytest.mark.parametrize(("opacity", "drawn"), [(0.99 / 255, False), (1.01 / 255, True)])
def test_what_is_fainter_than_one_255th_is_skipped(drawing, opacity: float, drawn: bool) -> None:
    camera = _camera()
    layer = _draw(drawing, _splats(camera, [[0, 0, 2.0]], [[0.2] * 3], [opacity], [[1.0]]), camera)
    assert (layer.transmittance[8, 15] < 1).item() is drawn
    assert (layer.picture != 0).sum() == drawn  # one pixel alone: its neighbours are below the threshold again


@BACKENDS
def test_a_pixel_is_finished_before_transmittance_would_fall_to_1e_4_and_stays_so(drawing) -> None:
    camera = _camera()
    inside = [[0, 0, z] for z in (1.0, 2.0, 3.0)]
    splats = _splats(camera, inside, [[0.3] * 3] * 3, [1.0, 1.0, 0.5], [[1.0], [1e6], [1e6]])
    layer = _draw(drawing, splats, camera)
    # After the first T is 1e-3; the second would leave 1e-6 and ends the pixel; the third would leave 5e-4, too late.
    assert layer.picture[0, 8, 15].item() == pytest.approx(0.999, rel=1e-12)
    assert layer.transmittance[8, 15].item() == pytest.approx(1e-3, rel=1e-10)


@BACKENDS
def test_the_jacobian_sees_the_position_clamped_to_the_image_and_15_percent(drawing) -> None:
    camera = _camera()
    x, y, z, sx, sy, sz = 6.0, -0.4, 2.0, 0.4, 0.3, 1.2
    slope_x, slope_y = (WIDTH - CX + 0.15 * WIDTH) / FX, y / z
    assert x / z > 3 * slope_x
    j = torch.tensor([[FX / z, 0, -FX * slope_x / z], [0, FY / z, -FY * slope_y / z]], dtype=torch.float64)
    conic = torch.linalg.inv(
        j @ torch.diag(torch.tensor([sx, sy, sz], dtype=torch.float64) ** 2) @ j.mT + 0.3 * torch.eye(2)
    )
    layer = _draw(drawing, _splats(camera, [[x, y, z]], [[sx, sy, sz]], [0.95], [[1.0]]), camera)
    met = 0
    for row in range(HEIGHT):
        for column in range(WIDTH):
            offset = torch.tensor(
                [column + 0.5 - (FX * x / z + CX), row + 0.5 - (FY * y / z + CY)], dtype=torch.float64
            )
            alpha = 0.95 * math.exp(-0.5 * offset @ conic @ offset)
            expected = alpha if alpha >= 1 / 255 else 0.0
            met += expected > 0
            assert layer.picture[0, row, column].item() == pytest.approx(expected, rel=1e-10)
    assert met == 0  # clamped, it stays outside
    free = torch.tensor([[FX / z, 0, -FX * x / z / z], [0, FY / z, -FY * y / z / z]], dtype=torch.float64)
    spread = (free @ torch.diag(torch.tensor([sx, sy, sz], dtype=torch.float64) ** 2) @ free.mT)[0, 0].sqrt()
    assert FX * x / z + CX - 3 * spread < WIDTH  # unclamped, it would have reached into the picture


@BACKENDS
def test_a_clamped_gaussian_beside_the_image_is_drawn_with_the_clamped_covariance(drawing) -> None:
    camera = _camera()
    x, y, z, scales = 1.9, 0.3, 1.5, [0.5, 0.2, 0.4]
    slope_x, slope_y = (WIDTH - CX + 0.15 * WIDTH) / FX, y / z
    assert x / z > slope_x
    j = torch.tensor([[FX / z, 0, -FX * slope_x / z], [0, FY / z, -FY * slope_y / z]], dtype=torch.float64)
    conic = torch.linalg.inv(
        j @ torch.diag(torch.tensor(scales, dtype=torch.float64) ** 2) @ j.mT + 0.3 * torch.eye(2, dtype=torch.float64)
    )
    layer = _draw(drawing, _splats(camera, [[x, y, z]], [scales], [0.95], [[1.0]]), camera)
    offset = torch.tensor([34.5 - (FX * x / z + CX), 15.5 - (FY * y / z + CY)], dtype=torch.float64)
    alpha = 0.95 * math.exp(-0.5 * offset @ conic @ offset)
    assert alpha > 0.05
    assert layer.picture[0, 15, 34].item() == pytest.approx(alpha, rel=1e-10)


@BACKENDS
def test_a_near_bound_hides_what_is_closer_than_a_fifth_of_it(drawing) -> None:
    camera = _camera()
    splats = _splats(camera, [[0, 0, 0.19], [0, 0, 0.21], [0, 0, -1.0]], [[0.01] * 3] * 3, [0.5] * 3, [[1.0]] * 3)
    assert drawing.depth_order(splats.means, camera, 1.0).tolist() == [1]
    assert drawing.depth_order(splats.means, camera, 0.5).tolist() == [0, 1]


@BACKENDS
def test_without_a_near_bound_what_is_closer_than_a_fiftieth_of_the_median_is_hidden(drawing) -> None:
    camera = _camera()
    depths = [0.0399, 0.0401, 2.0, 3.0, 3.0, -5.0, -5.0, -5.0, -5.0]  # the median in front is 2
    splats = _splats(camera, [[0, 0, z] for z in depths], [[0.01] * 3] * 9, [0.5] * 9, [[1.0]] * 9)
    assert drawing.depth_order(splats.means, camera, None).tolist() == [1, 2, 3, 4]


@BACKENDS
def test_nothing_in_front_is_an_empty_picture(drawing) -> None:
    camera = _camera()
    layer = _draw(drawing, _splats(camera, [[0, 0, -1.0]], [[0.1] * 3], [0.9], [[1.0, 2.0]]), camera)
    assert layer.picture.shape == (2, HEIGHT, WIDTH)
    assert (layer.picture == 0).all()
    assert (layer.transmittance == 1).all()


def test_the_covariance_of_the_projection_is_that_of_projected_samples() -> None:
    camera = _camera()
    generator = torch.Generator().manual_seed(3)
    quaternion = torch.tensor([[0.3, -0.5, 0.7, 0.2]], dtype=torch.float64)
    scales = torch.tensor([[0.02, 0.005, 0.03]], dtype=torch.float64)
    mean = torch.tensor([[0.3, -0.2, 2.0]], dtype=torch.float64) @ camera.axes + camera.centre
    splats = Splats(mean, quaternion, scales, torch.ones(1, dtype=torch.float64), torch.ones(1, 1, dtype=torch.float64))
    xx, xy, yy = reference.project(splats, camera).conics[0]
    factor = torch.linalg.cholesky(covariance(quaternion, scales)[0])
    samples = mean + torch.randn(200_000, 3, generator=generator, dtype=torch.float64) @ factor.mT
    inside = (samples - camera.centre) @ camera.axes.mT
    pixels = inside[:, :2] / inside[:, 2:] * torch.tensor(camera.focal_px, dtype=torch.float64)
    expected = torch.cov(pixels.mT) + 0.3 * torch.eye(2)
    found = torch.linalg.inv(torch.stack((xx, xy, xy, yy)).reshape(2, 2))
    assert (found - expected).norm() / expected.norm() < 0.02


@pytest.mark.parametrize(
    ("pixel", "inside"),
    [((3.5, 4.25), True), ((34.9, 19.9), True), ((-5.2, 22.9), True), ((40.2, -2.9), True), ((-5.3, 8.0), False),
     ((15.0, 23.1), False), ((40.3, -3.1), False)],
)  # fmt: skip
def test_the_jacobian_is_exact_within_the_image_and_15_percent_around_it_and_not_beyond(pixel, inside: bool) -> None:
    """The derivative of the projection by autograd; the margin is 5.25 px left and right, 3 px above and below."""
    camera = _camera()
    z = 1.7
    x, y = (pixel[0] - CX) / FX * z, (pixel[1] - CY) / FY * z
    splats = _splats(camera, [[x, y, z]], [[0.3, 0.2, 0.4]], [1.0], [[1.0]])
    quaternion = torch.tensor([[0.3, -0.5, 0.7, 0.2]], dtype=torch.float64)
    splats = Splats(splats.means, quaternion, splats.scales, splats.opacities, splats.features)

    def seen(mean: torch.Tensor) -> torch.Tensor:
        a, b, c = camera.axes @ (mean - camera.centre)
        return torch.stack((FX * a / c + CX, FY * b / c + CY))

    ellipses = reference.project(splats, camera)
    assert ellipses.centres[0].tolist() == pytest.approx(pixel, rel=1e-12)
    j = torch.autograd.functional.jacobian(seen, splats.means[0])
    expected = j @ covariance(quaternion, splats.scales)[0] @ j.mT + 0.3 * torch.eye(2, dtype=torch.float64)
    xx, xy, yy = ellipses.conics[0]
    found = torch.linalg.inv(torch.stack((xx, xy, xy, yy)).reshape(2, 2))
    error = (found - expected).norm() / expected.norm()
    assert error < 1e-12 if inside else error > 1e-3


def test_gradients_of_the_reference_are_those_of_finite_differences() -> None:
    camera = _camera()
    generator = torch.Generator().manual_seed(1)

    def normal(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=generator, dtype=torch.float64)

    inside = torch.stack((0.5 * normal(4), 0.3 * normal(4), 2 + 0.4 * normal(4)), dim=-1)
    inside[3] = torch.tensor([1.6, 0.5, 1.5])  # beyond the Jacobian's clamp in x
    means = inside @ camera.axes + camera.centre
    tensors = (
        means,
        normal(4, 4),
        0.05 + 0.2 * normal(4, 3).abs(),
        torch.tensor([0.5, 0.9, 0.3, 0.8]).double(),
        normal(4, 2),
    )

    def drawn(*tensors: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        splats = Splats(*tensors)
        layer = reference.splat(splats, reference.depth_order(splats.means, camera, None), camera)
        return layer.picture, layer.transmittance

    assert torch.autograd.gradcheck(drawn, [one.requires_grad_() for one in tensors], fast_mode=True)


@BACKENDS
@pytest.mark.parametrize(("opacity", "expected"), [(1.0, 0.0), (0.9995, 0.0), (0.9, 1 - 0.5 * 3)])
def test_there_is_no_gradient_where_the_opacity_of_a_pixel_is_cut_off(drawing, opacity: float, expected: float) -> None:
    """On its axis, a Gaussian of colour 1 before one of opacity 0.5 and colour 3 changes the pixel by 1 - 0.5 * 3 per opacity; from .999 on, by nothing."""
    camera = _camera()
    splats = _splats(camera, [[0, 0, 1.0], [0, 0, 2.0]], [[0.01] * 3] * 2, [opacity, 0.5], [[1.0], [3.0]])
    splats.opacities.requires_grad_()
    _draw(drawing, splats, camera).picture[0, 8, 15].backward()
    assert splats.opacities.grad is not None
    assert splats.opacities.grad[0].item() == pytest.approx(expected, abs=1e-12)
    # What is behind: the light that the first leaves, at most .001 of it, times the colour.
    assert splats.opacities.grad[1].item() == pytest.approx(3 * (1 - min(opacity, 0.999)), rel=1e-9)

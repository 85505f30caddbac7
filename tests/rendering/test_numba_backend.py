"""The fast twin against the slow one, in value and gradient; the same bits in every run; memory linear in pairs."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import pytest
import torch

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering import numba_backend
from semgs.rendering.numba_backend import _stable_order
from semgs.rendering.render import render
from semgs.rendering.splats import Pinhole
from semgs.rendering.tile_kernels import TILE_HEIGHT, TILE_WIDTH

FIELDS = ("images", "semantics", "depths", "alphas")


def _drawn_with_gradients(
    gaussians: Gaussians, cameras: Cameras, backend: str, dtype: torch.dtype
) -> tuple[dict[str, torch.Tensor], list[torch.Tensor]]:
    """The rendering's fields, and the gradients of a random linear function of them in every tensor of the Gaussians."""
    leaves: list[torch.Tensor] = []

    def leaf(tensor: torch.Tensor) -> torch.Tensor:
        leaves.append(tensor.detach().to(dtype).clone().requires_grad_())
        return leaves[-1]

    rendering = render(gaussians.map(leaf), cameras, background=(0.2, 0.7, 0.1), backend=backend)
    fields = {name: getattr(rendering, name) for name in FIELDS}
    generator = torch.Generator().manual_seed(7)
    weights = {name: torch.randn(one.shape, generator=generator, dtype=torch.float64) for name, one in fields.items()}
    sum((fields[name] * weights[name]).sum() for name in FIELDS).backward()
    return {name: one.detach() for name, one in fields.items()}, [one.grad for one in leaves]


def _difference(a: torch.Tensor, b: torch.Tensor) -> float:
    """Norm of the difference over the norm."""
    return float((a.double() - b).norm() / b.norm())


@pytest.mark.parametrize(
    ("seed", "views", "size", "harmonics", "classes"),
    [
        (0, 2, (37, 53), 16, 5),
        (1, 3, (16, 31), 4, 20),
        (2, 4, (33, 17), 1, 2),
        (3, 2, (1, 7), 9, 3),
        (4, 2, (50, 64), 1, 20),
    ],
)
def test_numba_equals_the_reference_in_float64(random_scene, seed, views, size, harmonics, classes) -> None:
    gaussians, cameras = random_scene(seed, 150, views, size, harmonics, classes)
    truth, truth_gradients = _drawn_with_gradients(gaussians, cameras, "reference", torch.float64)
    found, found_gradients = _drawn_with_gradients(gaussians, cameras, "numba", torch.float64)
    for name in FIELDS:
        torch.testing.assert_close(found[name], truth[name], rtol=0, atol=1e-10)
    for one, other in zip(found_gradients, truth_gradients, strict=True):
        assert _difference(one, other) < 1e-10


@pytest.mark.parametrize(("seed", "size"), [(5, (37, 53)), (6, (60, 80))])
def test_numba_in_float32_decides_as_the_float64_reference(random_scene, seed: int, size: tuple[int, int]) -> None:
    gaussians, cameras = random_scene(seed, 200, 2, size)
    gaussians = gaussians.to(torch.float32)
    truth, truth_gradients = _drawn_with_gradients(gaussians, cameras, "reference", torch.float64)
    found, found_gradients = _drawn_with_gradients(gaussians, cameras, "numba", torch.float32)
    for name in FIELDS:
        torch.testing.assert_close(found[name].double(), truth[name], rtol=0, atol=1e-5)
    for one, other in zip(found_gradients, truth_gradients, strict=True):
        assert _difference(one, other) < 1e-4


def test_float32_loses_nothing_a_kilometre_from_the_origin(random_scene) -> None:
    gaussians, cameras = random_scene(8, 200, 2)
    far = torch.tensor([1000.0, -400.0, 250.0])
    moved = gaussians.to(torch.float32).map(lambda tensor: tensor)
    moved = Gaussians(moved.means + far, moved.opacities, moved.colour, moved.semantic)
    poses = cameras.world_from_camera.clone()
    poses[..., :3, 3] += far
    there = Cameras(poses, cameras.intrinsics, cameras.size)
    truth = render(moved.to(torch.float64), there, backend="reference")
    found = render(moved, there, backend="numba")
    for name in FIELDS:
        torch.testing.assert_close(getattr(found, name).double(), getattr(truth, name), rtol=0, atol=1e-5)


def test_thin_slanted_and_screen_filling_gaussians_lose_no_pixel(random_scene) -> None:
    _, cameras = random_scene(9, 1, 2, (70, 90))
    generator = torch.Generator().manual_seed(9)
    count = 40
    means = torch.rand(count, 3, generator=generator, dtype=torch.float64) * 2 + torch.tensor([-1.0, -1.0, 1.0])
    scales = torch.tensor([[1.5, 0.001, 0.001], [1.0, 1.0, 0.01]], dtype=torch.float64).repeat(count // 2, 1)
    look = Appearance(
        torch.randn(count, 4, generator=generator, dtype=torch.float64),
        scales,
        torch.randn(count, 1, 3, generator=generator, dtype=torch.float64),
    )
    opacities = torch.rand(count, generator=generator, dtype=torch.float64) * 0.3
    gaussians = Gaussians(means, opacities, look)
    truth, found = (render(gaussians, cameras, backend=backend) for backend in ("reference", "numba"))
    torch.testing.assert_close(found.alphas, truth.alphas, rtol=0, atol=1e-10)
    torch.testing.assert_close(found.images, truth.images, rtol=0, atol=1e-10)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_two_runs_give_the_same_bits_whatever_the_number_of_threads(random_scene, dtype: torch.dtype) -> None:
    gaussians, cameras = random_scene(10, 300, 2, (50, 64))
    threads = torch.get_num_threads()
    runs = []
    try:
        for count in (1, 2, 2):
            torch.set_num_threads(count)
            runs.append(_drawn_with_gradients(gaussians, cameras, "numba", dtype))
    finally:
        torch.set_num_threads(threads)
    for fields, gradients in runs[1:]:
        assert all(torch.equal(fields[name], runs[0][0][name]) for name in FIELDS)
        assert all(torch.equal(one, other) for one, other in zip(gradients, runs[0][1], strict=True))


def test_two_python_threads_may_render_at_once(random_scene) -> None:
    gaussians, cameras = random_scene(11, 200, 2)
    alone = render(gaussians, cameras).images
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda _: render(gaussians, cameras).images, range(8)))
    assert all(torch.equal(one, alone) for one in together)


def _arguments(gaussians: Gaussians, cameras: Cameras, look: Appearance, requires_grad: bool) -> tuple:
    camera = Pinhole.of(cameras[0])
    tensors = (gaussians.means, look.quaternions, look.scales, gaussians.opacities, look.features)
    order = numba_backend.depth_order(gaussians.means, camera, None)
    leaves = (one.clone().requires_grad_(requires_grad) for one in tensors)
    return *leaves, order, numba_backend.camera_vector(camera), *camera.size


@pytest.mark.long  # it imports the compiler of torch
def test_the_operators_pass_torchs_own_checks(random_scene) -> None:
    gaussians, cameras = random_scene(12, 12, 1, (9, 14), 1, 3)
    arguments = _arguments(gaussians, cameras, gaussians.semantic, True)
    torch.library.opcheck(torch.ops.semgs.splat.default, arguments)
    picture, transmittance, last = torch.ops.semgs.splat(*arguments)
    backward = (
        *(one.detach() for one in arguments[:7]),
        transmittance.detach(),
        last,
        torch.randn(picture.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64),
        torch.ones_like(transmittance).detach(),
    )
    checks = ("test_schema", "test_faketensor")  # it has no gradient of its own
    torch.library.opcheck(torch.ops.semgs.splat_backward.default, backward, test_utils=checks)


def _pairs(inside: list, scales: list, size: tuple[int, int] = (64, 96), copies: int = 1) -> int:
    """Number of (Gaussian, tile) pairs of Gaussians at (column, row, depth) seen by a camera of focal length 100 px."""
    pose = torch.eye(4, dtype=torch.float64)
    pose[:3, 3] = torch.tensor([0.5, -0.25, 2.0])
    camera = Pinhole.of(Cameras(pose, [[100, 0, 30], [0, 100, 20], [0, 0, 1]], size))
    u, v, z = torch.tensor(inside, dtype=torch.float64).unbind(-1)
    means = torch.stack(((u - 30) / 100 * z, (v - 20) / 100 * z, z), dim=-1) + pose[:3, 3]
    means = means.repeat(copies, 1)
    axes = torch.tensor([[0.92387953, 0, 0, 0.38268343]], dtype=torch.float64).repeat(
        len(means), 1
    )  # 45 degrees about z
    widths = torch.tensor(scales, dtype=torch.float64).repeat(copies, 1)
    opacities = torch.full((len(means),), 0.9, dtype=torch.float64)
    order = numba_backend.depth_order(means, camera, None)
    vector = numba_backend.camera_vector(camera)
    projected = numba_backend.Projected.of(means, axes, widths, opacities, order, vector, *size)
    tiles = projected.tiles(projected.count())
    assert tiles.first_in_tile[-1] == tiles.first_pair[-1] == len(tiles.gaussians)
    assert sorted(tiles.pairs.tolist()) == list(range(len(tiles.pairs)))
    return len(tiles.pairs)


def test_pairs_are_as_many_as_the_tiles_that_each_gaussian_meets() -> None:
    small = [0.001] * 3
    assert (TILE_HEIGHT, TILE_WIDTH) == (16, 8)
    assert _pairs([[28, 24, 1]], [small]) == 1
    assert _pairs([[32, 24, 1]], [small]) == 2
    assert _pairs([[32, 32, 1]], [small]) == 4
    assert _pairs([[-50, 24, 1]], [small]) == 0
    assert _pairs([[28, 24, 1]], [[9.0, 9.0, 0.01]]) == 4 * 12  # all tiles of 64 x 96 pixels
    assert _pairs([[28, 24, 1], [32, 32, 1]], [small, small], copies=50) == 50 * 5


def test_pairs_do_not_grow_with_the_picture() -> None:
    assert _pairs([[24, 24, 1]], [[0.05] * 3], (64, 96)) == _pairs([[24, 24, 1]], [[0.05] * 3], (640, 960))


def test_a_thin_diagonal_gaussian_meets_the_tiles_along_it_not_those_of_its_bounding_box() -> None:
    # 21 pixels of a diagonal to each side: columns 11..53 and rows 3..45 are 6 x 3 tiles, of which it crosses half.
    assert 8 <= _pairs([[32.5, 24, 1]], [[0.09, 0.0005, 0.001]]) <= 10


def test_the_fast_order_is_the_stable_one() -> None:
    generator = torch.Generator().manual_seed(0)
    coarse = torch.randint(1, 50, (2000,), generator=generator).double() / 7
    fine = 1 + torch.rand(2000, generator=generator, dtype=torch.float64) * 1e-13
    wide = torch.exp(40 * torch.randn(3000, generator=generator, dtype=torch.float64))
    close = torch.cat((wide, wide * (1 + 4e-16)))
    for depths in (coarse, fine, wide, close, wide[:1], wide[:0]):
        assert torch.equal(_stable_order(depths), torch.argsort(depths, stable=True))


def test_depths_whose_leading_bits_are_equal_are_still_in_order() -> None:
    """Beside 1e-300 and 1e300, of 2^-51 only the index fits into a key: the two numbers about 1 stand in the wrong order."""
    count = 4096
    depths = torch.full((count,), 1.0, dtype=torch.float64)
    depths[0], depths[1] = 1e-300, 1e300
    depths[2], depths[3] = 1 + 2**-51, 1 + 2**-52
    order = _stable_order(depths).tolist()
    assert order == [0, *range(4, count), 3, 2, 1]

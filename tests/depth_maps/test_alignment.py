"""Alignment of depth maps: a tilted plane before several cameras, whose inverse depth is linear in the pixels of each."""

from __future__ import annotations

import math
from statistics import median

import pytest
import torch

from semgs.depth_maps.alignment import LEAST_SPREAD, Reference, align, inverses
from semgs.depth_maps.map_depth import MapPlacement, fits
from semgs.geometry.cameras import Cameras, pixel_centres

SIZE = (60, 80)
NORMAL = torch.tensor([0.2, -0.1, 1.0], dtype=torch.float64)
DISTANCE = 2.5
SCALES = torch.tensor([0.4, 1.7, 3.0])
SHIFTS = torch.tensor([0.1, -0.05, 0.2])


def plane(cameras: Cameras) -> torch.Tensor:
    """The z-depth of the plane NORMAL . x = DISTANCE in each camera."""
    pixels = torch.cat((pixel_centres(SIZE).double(), torch.ones(*SIZE, 1, dtype=torch.float64)), -1)
    depths = []
    for view in range(cameras.batch[0]):
        pose = cameras.world_from_camera[view].double()
        rays = pixels @ torch.linalg.inv(cameras.intrinsics[view].double()).mT @ pose[:3, :3].mT
        depths.append((DISTANCE - NORMAL @ pose[:3, 3]) / (rays @ NORMAL))
    return torch.stack(depths).float()


@pytest.fixture(scope="module")
def cameras() -> Cameras:
    poses = torch.eye(4, dtype=torch.float64).repeat(3, 1, 1)
    poses[:, :3, 3] = torch.tensor([[0.0, 0, 0], [0.3, 0.05, 0], [-0.25, 0.1, 0.1]])
    intrinsics = torch.tensor([[70.0, 0, 40], [0, 70, 30], [0, 0, 1]], dtype=torch.float64).repeat(3, 1, 1)
    return Cameras(poses, intrinsics, SIZE)


@pytest.fixture(scope="module")
def truth(cameras: Cameras) -> torch.Tensor:
    depths = plane(cameras)
    assert depths.min() > 0.5
    return depths


def known(depths: torch.Tensor, spread: float = 0.05) -> Reference:
    return Reference("the truth", depths, torch.full_like(depths, spread))


def test_scale_and_shift_of_inverse_depth_come_back(cameras: Cameras, truth: torch.Tensor):
    maps = (1 / truth - SHIFTS[:, None, None]) / SCALES[:, None, None]
    depths, fits = align(maps, "inverse", known(truth), cameras)
    torch.testing.assert_close(depths, truth, rtol=1e-4, atol=0)
    torch.testing.assert_close(torch.tensor([fit.scale for fit in fits]), SCALES, rtol=1e-4, atol=0)
    torch.testing.assert_close(torch.tensor([fit.shift for fit in fits]), SHIFTS, rtol=0, atol=1e-4)
    assert [fit.known for fit in fits] == [1, 1, 1]
    assert max(fit.residual for fit in fits) < 1e-4
    assert max(fit.disagreement for fit in fits) < 1e-3


def test_the_factor_of_depth_comes_back_and_holes_stay(cameras: Cameras, truth: torch.Tensor):
    maps = truth * SCALES[:, None, None]
    maps[1, :30] = torch.nan
    maps[1, 30:33] = -1.0
    depths, fits = align(maps, "scaled", known(truth), cameras)
    assert [fit.scale for fit in fits] == pytest.approx(SCALES.tolist(), rel=1e-5)
    assert [fit.shift for fit in fits] == [0, 0, 0]
    assert fits[1].known == pytest.approx(27 / 60)
    assert depths[1, :33].abs().max() == 0
    torch.testing.assert_close(depths[1, 33:], truth[1, 33:], rtol=1e-4, atol=0)


@pytest.mark.parametrize("meaning", ["scaled", "inverse"])
def test_a_view_without_a_reference_is_aligned_to_the_other_views(cameras: Cameras, truth: torch.Tensor, meaning: str):
    """Both views start from the factor of the first, which is 40 % off for the second; only the surface that they share can say so."""
    maps = truth * torch.tensor([1.0, 1.15, 1.0])[:, None, None]
    maps = 1 / maps if meaning == "inverse" else maps
    only_first = truth.clone()
    only_first[1] = 0
    depths, fits = align(maps, meaning, known(only_first), cameras)  # type: ignore[arg-type]
    assert math.isnan(fits[1].residual)
    assert fits[1].disagreement < 0.01
    assert float((depths[1] / truth[1] - 1).abs().median()) < 0.01


def test_a_map_that_nothing_confirms_is_not_used_and_its_difference_is_unknown(cameras: Cameras, truth: torch.Tensor):
    """The third camera looks the other way, and has no reference: its scale is that of the others."""
    poses = cameras.world_from_camera.clone()
    poses[2, :3, :3] = torch.diag(torch.tensor([-1.0, 1.0, -1.0]))
    only_two = truth.clone()
    only_two[2] = 0
    around = Cameras(poses, cameras.intrinsics, SIZE)
    _, found = align(3 * truth, "scaled", known(only_two), around)
    assert found[2].scale == pytest.approx(3.0, rel=1e-3)
    assert math.isnan(found[2].residual)
    assert math.isnan(found[2].disagreement)
    assert [fits(fit) for fit in found] == [True, True, False]
    placement = MapPlacement("maps", "scaled", "the truth", found)
    assert "typical difference –" in placement.lines(["a", "b", "c"])[2]
    assert placement.notes(["a", "b", "c"])[0].endswith("(typical difference): c (–).")


def test_a_third_of_outliers_has_no_vote(cameras: Cameras, truth: torch.Tensor):
    wrong = truth.clone()
    wrong[:, :20] *= 0.5
    depths, _ = align(3 * truth, "scaled", known(wrong), cameras)
    torch.testing.assert_close(depths, truth, rtol=0.01, atol=0)


def test_an_exact_map_is_trusted_beside_a_noisy_reference_and_a_bent_one_less(cameras: Cameras, truth: torch.Tensor):
    # Log depths are off by -0.1349 to 0.1349, each equally often: half of them by less than 0.0674, which is 0.1 / 1.4826.
    steps = torch.arange(truth.numel(), dtype=torch.float64) * 0.6180339887
    noisy = known(truth * (0.1349 * (2 * steps.frac() - 1)).exp().float().reshape(truth.shape), 0.1)
    _, exact = align(truth, "scaled", noisy, cameras)
    # The residual is the reference's own 0.1; a tenth of its square is taken as the map's.
    assert median(fit.residual for fit in exact) == pytest.approx(0.1, rel=0.05)
    assert median(fit.spread for fit in exact) == pytest.approx(0.1 * math.sqrt(0.1), rel=0.05)
    bend = 0.2 * torch.linspace(-1, 1, SIZE[1])
    _, bent = align(truth * bend.exp(), "scaled", noisy, cameras)
    assert min(fit.spread for fit in bent) > 0.08
    _, both = align(truth, "scaled", known(truth), cameras)
    assert max(fit.spread for fit in both) == LEAST_SPREAD


@pytest.mark.parametrize("first", [0, 1, 3])
def test_every_sparse_point_is_used_wherever_it_is(cameras: Cameras, truth: torch.Tensor, first: int):
    """The reference is known at every 12th pixel from `first` on: of these only those from 3 on are on the grid of every 6th from 3 on."""
    sparse = torch.zeros_like(truth)
    sparse[:, first::12, first::12] = truth[:, first::12, first::12]
    assert (sparse > 0).sum((1, 2)).tolist() == [5 * 7, 5 * 7, 5 * 7]
    maps = (1 / truth - SHIFTS[:, None, None]) / SCALES[:, None, None]
    depths, fits = align(maps, "inverse", known(sparse), cameras)
    torch.testing.assert_close(torch.tensor([fit.scale for fit in fits]), SCALES, rtol=1e-3, atol=0)
    assert max(fit.residual for fit in fits) < 1e-3  # not NaN: each view has a reference
    torch.testing.assert_close(depths, truth, rtol=1e-3, atol=0)


def test_of_sparse_points_most_decide_and_not_the_few_on_the_grid(cameras: Cameras, truth: torch.Tensor):
    """35 points are right. Four more are half as far away as they should be, and they alone are on the grid."""
    sparse = torch.zeros_like(truth)
    sparse[:, 1::12, 1::12] = truth[:, 1::12, 1::12]
    sparse[:, [3, 27], 3:76:36] = truth[:, [3, 27], 3:76:36] / 2
    depths, fits = align(3 * truth, "scaled", known(sparse), cameras)
    assert [fit.scale for fit in fits] == pytest.approx([3, 3, 3], rel=0.01)
    torch.testing.assert_close(depths, truth, rtol=0.01, atol=0)


def test_what_cannot_be_aligned_is_refused(cameras: Cameras, truth: torch.Tensor):
    with pytest.raises(ValueError, match="a map has no value"):
        align(truth * torch.tensor([1, 1, torch.nan])[:, None, None], "scaled", known(truth), cameras)
    with pytest.raises(ValueError, match="no value where the depth is known"):
        align(truth, "scaled", known(torch.zeros_like(truth)), cameras)


def test_inverse_depths_keep_their_sign_and_depths_are_positive():
    values = torch.tensor([2.0, 0.0, -4.0, torch.inf])
    torch.testing.assert_close(
        inverses(values, "scaled"), torch.tensor([0.5, torch.nan, torch.nan, torch.nan]).double(), equal_nan=True
    )
    torch.testing.assert_close(
        inverses(values, "inverse"), torch.tensor([2.0, 0.0, -4.0, torch.nan]).double(), equal_nan=True
    )


def test_what_two_maps_disagree_is_a_root_of_two_less_than_their_difference(cameras: Cameras):
    """Log depths of two cameras at one place have a noise of 2 % each, so their difference has 2.8 %: each is off by 2 %."""
    large = Cameras(
        torch.eye(4).repeat(2, 1, 1), 4 * cameras.intrinsics[:2] + torch.eye(3) * torch.tensor([0, 0, -3.0]), (240, 320)
    )
    flat = torch.full((2, 240, 320), 2.0)
    noise = 0.02 * torch.randn(flat.shape, generator=torch.Generator().manual_seed(0))
    _, found = align(flat * noise.exp(), "scaled", known(flat), large)
    assert [fit.disagreement for fit in found] == pytest.approx([0.02, 0.02], rel=0.05)


def test_the_part_of_a_reference_that_is_uncertain_counts_less(cameras: Cameras, truth: torch.Tensor):
    """Half of it is 5 % too far and known to 20 %, the other half right and known to 1 %: the factor is that of the other half."""
    wrong, spread = truth.clone(), torch.full_like(truth, 0.01)
    wrong[:, :30], spread[:, :30] = 1.05 * truth[:, :30], 0.2
    _, found = align(truth, "scaled", Reference("half", wrong, spread), cameras)
    assert [fit.scale for fit in found] == pytest.approx([1.0] * 3, abs=0.01)

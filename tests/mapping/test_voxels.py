"""Joining in voxels, by hand and against a dictionary of cells."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.rotations import covariance
from semgs.mapping.voxels import area, join_in_voxels, voxel_keys


def gaussians_at(means: torch.Tensor, opacities: torch.Tensor, scales: tuple[float, float, float]) -> Gaussians:
    """Gaussians of one shape, with classes that are as their opacities."""
    count = len(means)
    turns = torch.tensor([1.0, 0.0, 0.0, 0.0]).expand(count, 4)
    shape = Appearance(turns, torch.tensor(scales).expand(count, 3), opacities[:, None, None].expand(count, 1, 3))
    shares = torch.stack((opacities, 1 - opacities), -1)
    return Gaussians(means, opacities, shape, Appearance(turns, shape.scales, shares))


def test_two_of_one_voxel_become_their_mixture_and_the_third_stays():
    """Weights of 1 to 3, 4 mm apart along x: the mean is 3 mm from the lighter one, and the variance along x grows by 3/16 of 16 mm^2."""
    means = torch.tensor([[0.101, 0.05, -0.05], [0.105, 0.05, -0.05], [0.5, 0.05, -0.05]])
    given = gaussians_at(means, torch.tensor([0.2, 0.6, 0.4]), (0.01, 0.004, 0.02))
    found, places = join_in_voxels(given, torch.tensor([7, 8, 30]), 0.02)
    assert places.tolist() == [30, 8]
    torch.testing.assert_close(found.means[1], torch.tensor([0.104, 0.05, -0.05]))
    torch.testing.assert_close(found.colour.features[1], torch.full((1, 3), 0.5))
    sides = torch.diag(covariance(found.colour.quaternions[1], found.colour.scales[1]))
    torch.testing.assert_close(sides, torch.tensor([1e-4 + 3e-6, 1.6e-5, 4e-4]), rtol=1e-4, atol=1e-9)
    # Opacity times area stays: (0.2 + 0.6) over sqrt(1.03), by which the area has grown.
    assert float(found.opacities[1]) == pytest.approx(0.8 / math.sqrt(1.03), rel=1e-4)
    torch.testing.assert_close(found.map(lambda one: one[:1]).means, means[2:])
    torch.testing.assert_close(found.semantic.features.sum(-1), torch.ones(2))


def test_each_of_many_voxels_gets_the_place_of_its_heaviest_one():
    """50,000 points in almost 8,000 voxels, about 6 in each, against a loop; of equally heavy ones the last counts."""
    draw = torch.Generator().manual_seed(5)
    means = torch.rand(50_000, 3, generator=draw)
    opacities = torch.randint(1, 5, (50_000,), generator=draw) / 5
    given = gaussians_at(means, opacities, (0.01, 0.004, 0.02))
    weights = (opacities * area(given.colour.scales)).numpy()
    heaviest: dict[int, int] = {}
    for number, key in enumerate(voxel_keys(means, 0.05).tolist()):
        if key not in heaviest or weights[number] >= weights[heaviest[key]]:
            heaviest[key] = number
    found, places = join_in_voxels(given, torch.arange(50_000), 0.05)
    assert len(found) == len(heaviest) < 8000
    np.testing.assert_array_equal(np.sort(places.numpy()), np.sort(list(heaviest.values())))


def test_keys_are_equal_for_points_of_one_cell_only():
    draw = torch.Generator().manual_seed(2)
    means = 3 * torch.randn(400, 3, generator=draw)
    keys = voxel_keys(means, 0.7).tolist()
    cells = [tuple(math.floor(side / 0.7) for side in row) for row in means.double().tolist()]
    assert len(set(keys)) == len(set(cells)) == len(set(zip(keys, cells, strict=True)))


def test_an_empty_voxel_size_and_a_scene_that_is_too_large_are_refused():
    with pytest.raises(ValueError, match="expected a positive length"):
        voxel_keys(torch.zeros(1, 3), 0.0)
    with pytest.raises(ValueError, match="too small for a scene that extends over 3000"):
        voxel_keys(torch.tensor([[0.0, 0, 0], [3000.0, 0, 0]]), 0.001)
    with pytest.raises(
        ValueError, match=r"positions 5e\+06 from the origin have steps of 0.6, too coarse for voxels of 0.003"
    ):
        voxel_keys(torch.tensor([[5e6, 0, 0]]), 0.003)


def test_a_walk_far_from_the_origin_is_joined_as_one_near_it():
    """4,096 m out, where float32 has steps of 0.49 mm, the sides of voxels of 3 mm are at 4095.999, 4096.002 and 4096.005 m."""
    along = torch.tensor([4096.0, 4096.001, 4096.004])
    keys = voxel_keys(torch.stack((along, torch.full((3,), 0.05), torch.full((3,), -0.05)), 1), 0.003)
    assert keys[0] == keys[1] != keys[2]
    given = gaussians_at(along[:, None] * torch.tensor([1.0, 0, 0]), torch.tensor([0.2, 0.6, 0.4]), (0.01, 0.004, 0.02))
    found, places = join_in_voxels(given, torch.tensor([7, 8, 30]), 0.003)
    assert places.tolist() == [30, 8]
    # Weights of 1 to 3, two steps of float32 apart: the variance along x grows by 3/16 of (0.98 mm)^2.
    sides = torch.diag(covariance(found.colour.quaternions[1], found.colour.scales[1]))
    assert float(sides[0]) == pytest.approx(1e-4 + 3 / 16 * (2 / 2**11) ** 2, rel=1e-5)

import math

import pytest
import torch
from posed import posed_cameras

from semgs.geometry.cameras import Cameras, back_project, pixel_centres, project
from semgs.geometry.plane_sweep import depth_candidates, expected_depth
from semgs.model.conventions import MVSPLAT, OURS
from semgs.model.cost_volume import cost_volume, unit_features
from semgs.model.heads import CostRegressor


def batched(cameras: Cameras) -> Cameras:
    return Cameras(cameras.world_from_camera[None], cameras.intrinsics[None], cameras.size)


def by_loop(features, cameras: Cameras, candidates) -> torch.Tensor:
    """The mean correlation, texel by texel and plane by plane, each view projected by its own K."""
    views, c, h, w = features.shape
    height, width = cameras.size
    cost = torch.zeros(views, candidates.shape[1], h, w, dtype=features.dtype)
    for i in range(views):
        for row in range(h):
            for column in range(w):
                pixel = torch.tensor([(column + 0.5) * width / w, (row + 0.5) * height / h, 1.0], dtype=torch.float64)
                ray = torch.linalg.inv(cameras.intrinsics[i]) @ pixel
                for k, depth in enumerate(candidates[i]):
                    pose = cameras.world_from_camera[i]
                    world = pose[:3, :3] @ (ray * depth) + pose[:3, 3]
                    products = []
                    for j in range(views):
                        inside = cameras.camera_from_world[j]
                        x, y, z = (cameras.intrinsics[j] @ (inside[:3, :3] @ world + inside[:3, 3])).tolist()
                        if j == i or z <= 0.5e-3:
                            continue
                        u, v = x / z * w / width - 0.5, y / z * h / height - 0.5
                        if not (-0.5 <= u <= w - 0.5 and -0.5 <= v <= h - 0.5):
                            continue
                        left, top = math.floor(u), math.floor(v)
                        sample = torch.zeros(c, dtype=features.dtype)
                        for dx in (0, 1):
                            for dy in (0, 1):
                                weight = (1 - abs(u - left - dx)) * (1 - abs(v - top - dy))
                                sample += (
                                    weight * features[j, :, min(max(top + dy, 0), h - 1), min(max(left + dx, 0), w - 1)]
                                )
                        products.append(features[i, :, row, column] @ sample)
                    cost[i, k, row, column] = sum(products) / len(products) if products else 0
    return cost / math.sqrt(c)


@pytest.mark.parametrize("fused", [False, True])
@pytest.mark.parametrize("size", [(16, 28), (28, 16)])
def test_the_cost_equals_a_loop_over_pixels_and_planes(size, fused):
    cameras = posed_cameras(3, size, seed=4, spread=0.6)
    features = torch.randn(3, 8, size[0] // 4, size[1] // 4, dtype=torch.float64)
    bounds = torch.tensor([0.5, 10.0], dtype=torch.float64).expand(3, 2)
    candidates = depth_candidates(bounds, 7)
    fast = cost_volume(features[None], batched(cameras), bounds[None, :, 0], candidates[None], fused=fused)[0]
    expected = by_loop(features, cameras, candidates)
    assert (expected == 0).any()  # some points no view sees
    assert (fast - expected).abs().max() < 1e-10


@pytest.mark.parametrize("conventions", [OURS, MVSPLAT])
def test_the_fused_kernel_equals_the_plain_form_in_value_and_gradient(conventions):
    cameras = batched(posed_cameras(3, (32, 44), seed=2, spread=0.5))
    near = torch.full((1, 3), 0.5, dtype=torch.float64)
    candidates = depth_candidates(torch.tensor([0.5, 10.0], dtype=torch.float64).expand(1, 3, 2), 21)
    weights = torch.randn(1, 3, 21, 8, 11, dtype=torch.float64)
    results = []
    for fused in (False, True):
        features = torch.randn(1, 3, 16, 8, 11, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
        features.requires_grad_()
        cost = cost_volume(features, cameras, near, candidates, conventions, fused=fused)
        (cost * weights).sum().backward()
        results.append((cost.detach(), features.grad))
    (plain, plain_grad), (fast, fast_grad) = results
    assert (plain - fast).abs().max() < 1e-10
    assert (plain_grad - fast_grad).abs().max() < 1e-10


@pytest.mark.parametrize("size", [(96, 128), (128, 96)])
def test_on_a_plane_of_known_depth_the_peak_is_the_right_candidate(size):
    cameras = posed_cameras(2, size, seed=7)
    depth, candidates = 2.2, depth_candidates(torch.tensor([0.5, 10.0], dtype=torch.float64).expand(2, 2), 16)
    h, w = size[0] // 4, size[1] // 4
    # The plane z = 2.2 of the first camera carries a smooth unit-length pattern of its own position; no two texels are alike.
    first = cameras.world_from_camera[0]
    features = torch.zeros(2, 12, h, w, dtype=torch.float64)
    centres = torch.cat((pixel_centres((h, w)) * 4, torch.ones(h, w, 1, dtype=torch.float64)), dim=-1)
    for view in range(2):
        relative = torch.linalg.inv(first) @ cameras.world_from_camera[view]
        rays = centres @ torch.linalg.inv(cameras.intrinsics[view]).T @ relative[:3, :3].T
        hit = relative[:3, 3] + rays * ((depth - relative[2, 3]) / rays[..., 2])[..., None]
        angles = torch.cat([hit[..., :2] * f for f in (1.0, 2.0, 3.5)], dim=-1)
        features[view] = torch.cat((angles.sin(), angles.cos()), dim=-1).permute(2, 0, 1) / math.sqrt(6)
    cost = cost_volume(features[None], batched(cameras), torch.full((1, 2), 0.5), candidates[None])[0, 0]
    inverse = 1 / candidates[0]
    world = back_project(torch.full(size, depth, dtype=torch.float64)[None], cameras[:1])[0, 2::4, 2::4]
    x, y, z = project(world.reshape(1, -1, 3), cameras[1:])[0].reshape(h, w, 3).unbind(-1)
    seen = (z > 0) & (x > 4) & (x < size[1] - 4) & (y > 4) & (y < size[0] - 4)
    assert seen.double().mean() > 0.3
    error = (inverse[cost.argmax(0)] - 1 / depth).abs()[seen]
    assert (error <= (inverse[1] - inverse[0]) / 2 + 1e-9).double().mean() > 0.97


def test_candidates_run_from_far_to_near_and_each_sampling_has_its_own_expectation():
    bounds = torch.tensor([0.5, 8.0], dtype=torch.float64)
    inverse, linear = depth_candidates(bounds, 4, "inverse"), depth_candidates(bounds, 4, "linear")
    assert torch.allclose(inverse, 1 / torch.tensor([0.125, 0.75, 1.375, 2.0], dtype=torch.float64))
    assert torch.allclose(linear, torch.tensor([8.0, 5.5, 3.0, 0.5], dtype=torch.float64))
    p = torch.tensor([0.1, 0.2, 0.3, 0.4], dtype=torch.float64)[:, None, None]
    assert math.isclose(expected_depth(p, inverse, "inverse").item(), 1 / (0.0125 + 0.15 + 0.4125 + 0.8))
    assert math.isclose(expected_depth(p, linear, "linear").item(), 0.8 + 1.1 + 0.9 + 0.2)
    assert not math.isclose(
        expected_depth(p, inverse, "linear").item(), expected_depth(p, inverse, "inverse").item(), rel_tol=0.1
    )


def test_the_custom_operation_follows_torchs_rules():
    from semgs.model.correlation import _correlate

    cameras = posed_cameras(2, (16, 24))
    features = torch.randn(2, 4, 6, 8, dtype=torch.float64, requires_grad=True)
    other = torch.randn(2, 4, 6, 8, dtype=torch.float64, requires_grad=True)
    matrices = cameras.intrinsics / cameras.intrinsics[:, :1, :1]
    arguments = (
        features, other, matrices, torch.zeros(2, 3, dtype=torch.float64),
        torch.tensor([[1.0, 2.0]] * 2, dtype=torch.float64), torch.full((2,), 1e-3, dtype=torch.float64), True,
    )  # fmt: skip
    torch.library.opcheck(_correlate, arguments)


def test_unit_features_have_one_length_and_no_mean():
    unit = unit_features(torch.randn(2, 12, 5, 7, dtype=torch.float64) * 3 + 5)
    assert torch.allclose(unit.norm(dim=1), torch.tensor(math.sqrt(12), dtype=torch.float64))
    assert unit.mean((-2, -1)).abs().max() < 0.5


def test_with_the_cost_prior_depth_starts_from_the_cost_alone():
    regressor = CostRegressor(8, 16, 8, 8, cost_prior=True)
    torch.nn.init.zeros_(regressor.head[-1].weight)
    torch.nn.init.zeros_(regressor.head[-1].bias)
    cost = torch.randn(2, 16, 8, 12)
    assert torch.allclose(regressor(cost, torch.randn(2, 8, 8, 12), 2), cost)

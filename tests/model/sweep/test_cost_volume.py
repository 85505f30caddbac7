import math

import pytest
import torch
from posed import posed_cameras

from semgs.geometry.cameras import Cameras, back_project, pixel_centres, project
from semgs.geometry.plane_sweep import depth_candidates
from semgs.model.settings import MVSPLAT, OURS, DepthSettings
from semgs.model.sweep.cost_volume import cost_volume, unit_features
from semgs.model.sweep.depth import CostRegressor


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


def pattern(cameras: Cameras, depth: float, grid: tuple[int, int]) -> torch.Tensor:
    """What each view sees of a plane that faces the first camera at `depth`: features of unit length, [views c h w].

    They are a smooth function of the position on the plane that takes no value twice, so no two texels are alike.
    """
    (height, width), (h, w) = cameras.size, grid
    first = cameras.world_from_camera[0]
    texel = torch.tensor([width / w, height / h], dtype=torch.float64)
    centres = torch.cat((pixel_centres(grid) * texel, torch.ones(h, w, 1, dtype=torch.float64)), dim=-1)
    views = []
    for view in range(cameras.batch[0]):
        relative = torch.linalg.inv(first) @ cameras.world_from_camera[view]
        rays = centres @ torch.linalg.inv(cameras.intrinsics[view]).T @ relative[:3, :3].T
        hit = relative[:3, 3] + rays * ((depth - relative[2, 3]) / rays[..., 2])[..., None]
        angles = torch.cat([hit[..., :2] * frequency for frequency in (0.7, 2.0, 3.5, 5.5)], dim=-1)
        views.append(torch.cat((angles.sin(), angles.cos()), dim=-1).permute(2, 0, 1) / math.sqrt(8))
    return torch.stack(views)


def seen_by(cameras: Cameras, depth: float, grid: tuple[int, int], margin: float) -> torch.Tensor:
    """Which source views see the first view's texels at `depth`, at least `margin` texels inside: [sources h w]."""
    (height, width), (h, w) = cameras.size, grid
    world = back_project(torch.full((1, height, width), depth, dtype=torch.float64), cameras[:1])
    # A texel's centre is where its four middle pixels meet.
    world = torch.nn.functional.avg_pool2d(world[0].permute(2, 0, 1), 4).permute(1, 2, 0).reshape(1, -1, 3)
    seen = []
    for view in range(1, cameras.batch[0]):
        x, y, z = project(world, cameras[view : view + 1])[0].reshape(h, w, 3).unbind(-1)
        u, v = x * w / width - 0.5, y * h / height - 0.5
        low, high = -0.5 + margin, -0.5 - margin
        seen.append((z > 0) & (u > low) & (u < w + high) & (v > low) & (v < h + high))
    return torch.stack(seen)


def zoomed(cameras: Cameras) -> Cameras:
    """The cameras with a longer focal length and another principal point in the second."""
    k = cameras.intrinsics.clone()
    k[1] = torch.tensor([[1.25, 0, 0.03 * k[1, 0, 2]], [0, 1.2, -0.05 * k[1, 1, 2]], [0, 0, 1]]) @ k[1]
    return Cameras(cameras.world_from_camera, k, cameras.size)


@pytest.mark.parametrize("fused", [False, True])
@pytest.mark.parametrize("size", [(96, 128), (128, 96)])
@pytest.mark.parametrize("different", [False, True])
def test_on_a_plane_of_known_depth_the_peak_is_the_nearest_candidate(size, different, fused):
    """Also where one source view cannot see the point; the baseline to each is long enough to tell depths apart."""
    cameras = posed_cameras(3, size, seed=9, spread=0.35)
    cameras = zoomed(cameras) if different else cameras
    grid = (size[0] // 4, size[1] // 4)
    bounds = torch.tensor([0.5, 10.0], dtype=torch.float64)
    candidates = depth_candidates(bounds, 16)
    inverse = 1 / candidates
    step = float(inverse[1] - inverse[0])
    depth = 1 / float(inverse[3] + 0.2 * step)
    features = pattern(cameras, depth, grid)
    assert torch.allclose(features.norm(dim=1), torch.ones(1, dtype=torch.float64))
    texels = features[0].flatten(1).T
    assert torch.pdist(texels).min() > 1e-2
    every = candidates.expand(1, 3, -1)
    cost = cost_volume(features[None], batched(cameras), bounds[:1].expand(1, 3), every, fused=fused)[0, 0]
    certain, possible = seen_by(cameras, depth, grid, 1.0), seen_by(cameras, depth, grid, 0.0)
    both, only_one = certain.all(0), certain.any(0) & (possible.sum(0) == 1)
    assert both.sum() > 50
    assert only_one.sum() > 50
    error = (inverse[cost.argmax(0)] - 1 / depth).abs()
    assert (error[both | only_one] <= step / 2).all()
    # Correlation of unit features is 1 / sqrt(c) at the peak, whether one view sees the point or two.
    peak = cost.amax(0)[both | only_one] * math.sqrt(features.shape[1])
    assert (peak - 1).abs().max() < 0.05


def test_where_no_view_sees_the_point_the_cost_is_zero():
    size, grid = (96, 128), (24, 32)
    cameras = posed_cameras(3, size, seed=7, spread=0.9)
    depth = 2.2
    features = pattern(cameras, depth, grid)
    one = torch.full((1, 3, 1), depth, dtype=torch.float64)
    cost = cost_volume(features[None], batched(cameras), torch.full((1, 3), 0.5), one)[0, 0, 0]
    nobody = ~seen_by(cameras, depth, grid, -1e-6).any(0)
    assert nobody.sum() > 20
    assert (cost[nobody] == 0).all()
    assert (cost[seen_by(cameras, depth, grid, 1e-6).any(0)] != 0).all()


@pytest.mark.long
def test_the_custom_operation_follows_torchs_rules():
    from semgs.model.sweep.correlation import _correlate

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
    regressor = CostRegressor(8, DepthSettings(candidates=16, width=8, hidden=8, cost_prior=True))
    torch.nn.init.zeros_(regressor.head[-1].weight)
    torch.nn.init.zeros_(regressor.head[-1].bias)
    cost = torch.randn(2, 16, 8, 12)
    assert torch.allclose(regressor(cost, torch.randn(2, 8, 8, 12), 2), cost)

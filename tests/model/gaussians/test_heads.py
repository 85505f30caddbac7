"""Means, opacities, covariances and sizes of the Gaussians against loops and against the camera that predicts them."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from golden import fill_golden
from networks import network
from posed import posed_cameras, posed_views
from scipy.spatial.transform import Rotation

from semgs.geometry.cameras import back_project
from semgs.geometry.plane_sweep import depth_candidates, expected_depth
from semgs.geometry.rotations import covariance
from semgs.model.gaussians.placing import Rays, colour_appearance, points, semantic_appearance, shapes
from semgs.model.layers.cnn import upsample
from semgs.model.semgs import SemGS
from semgs.model.settings import OURS, Conventions
from semgs.rendering import reference
from semgs.rendering.splats import Pinhole, Splats

SIZE = (6, 9)


@pytest.fixture
def cameras():
    return posed_cameras(2, SIZE, seed=3)


def draw(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def depth_maps() -> torch.Tensor:
    return 1 + draw(2, *SIZE).abs()


def test_means_are_the_pixel_centres_at_z_depth_worked_out_pixel_by_pixel(cameras):
    depths = depth_maps()
    rays = Rays.of(cameras, depths)
    found = points(depths, torch.zeros(2, 2, *SIZE, dtype=torch.float64), rays, OURS)
    for view in range(2):
        pose, (fx, fy) = cameras.world_from_camera[view], cameras.focal_px[view].tolist()
        cx, cy = cameras.intrinsics[view, :2, 2].tolist()
        for row in range(SIZE[0]):
            for column in range(SIZE[1]):
                z = depths[view, row, column].item()
                inside = torch.tensor([(column + 0.5 - cx) / fx * z, (row + 0.5 - cy) / fy * z, z], dtype=torch.float64)
                expected = pose[:3, :3] @ inside + pose[:3, 3]
                assert (found[view, row, column] - expected).abs().max() < 1e-12
    assert torch.allclose(found, back_project(depths, cameras), atol=1e-12)
    assert torch.equal(points(depths, None, rays, OURS), found)


def test_an_offset_moves_a_mean_by_at_most_half_a_pixel_of_its_own_picture(cameras):
    depths = depth_maps()
    rays = Rays.of(cameras, depths)
    raw = torch.zeros(2, 2, *SIZE, dtype=torch.float64)
    raw[:, 0], raw[:, 1] = 50.0, -math.log(3)  # + half a column, and sigmoid(-log 3) = 1/4: up by a quarter of a row
    moved = points(depths, raw, rays, OURS) - points(depths, None, rays, OURS)
    inside = torch.einsum("nij,nhwi->nhwj", cameras.world_from_camera[:, :3, :3], moved)
    pixels = inside[..., :2] / depths[..., None] * cameras.focal_px[:, None, None]
    assert torch.allclose(pixels, torch.tensor([0.5, -0.25], dtype=torch.float64).expand_as(pixels), atol=1e-9)
    assert inside[..., 2].abs().max() < 1e-12


def test_a_covariance_is_r_s_s_r_with_the_head_s_quaternion_turned_by_the_camera(cameras):
    depths = depth_maps()
    raw_scales, raw_quaternions = draw(2, 3, *SIZE, seed=1), draw(2, 4, *SIZE, seed=2)  # the latter (x, y, z, w)
    scales, quaternions = shapes(raw_scales, raw_quaternions, depths, Rays.of(cameras, depths))
    found = covariance(quaternions, scales)
    for view in range(2):
        world = cameras.world_from_camera[view, :3, :3].numpy()
        pixel = 1 / cameras.focal_px[view, 0].item() + 1 / cameras.focal_px[view, 1].item()
        for row in range(SIZE[0]):
            for column in range(SIZE[1]):
                place = (view, slice(None), row, column)
                axes = world @ Rotation.from_quat(raw_quaternions[place].numpy()).as_matrix()
                size = 0.5 + 14.5 / (1 + np.exp(-raw_scales[place].numpy()))
                s = np.diag(size * 0.1 * pixel * depths[view, row, column].item())
                expected = axes @ s @ s.T @ axes.T
                assert (
                    np.abs(found[view, row, column].numpy() - expected).max() < 1e-12 * np.abs(expected).max() + 1e-15
                )


@pytest.mark.parametrize(("raw", "pixels"), [(-50.0, 0.1), (0.0, 1.55), (50.0, 3.0)])
def test_sizes_are_in_pixels_of_the_view_that_predicts_them_whatever_the_depth(raw, pixels):
    """On the optical axis, with fx = fy, a Gaussian that was given a size is seen with it; near and far alike."""
    camera = posed_cameras(1, (20, 35), seed=5)
    k = camera.intrinsics.clone()
    k[0] = torch.tensor([[30.0, 0, 10.5], [0, 30.0, 8.5], [0, 0, 1]])
    camera = type(camera)(camera.world_from_camera, k, camera.size)
    pinhole = Pinhole.of(camera[0])
    for depth in (0.7, 5.0):
        depths = torch.full((1, *camera.size), depth, dtype=torch.float64)
        rays = Rays.of(camera, depths)
        identity = torch.tensor([0.0, 0, 0, 1], dtype=torch.float64)[None, :, None, None].expand(1, 4, *camera.size)
        sizes = torch.full((1, 3, *camera.size), raw, dtype=torch.float64)
        scales, quaternions = shapes(sizes, identity, depths, rays)
        means = points(depths, None, rays, OURS)
        on_axis = (0, 8, 10)
        one = torch.ones(1, dtype=torch.float64)
        splats = Splats(means[on_axis][None], quaternions[on_axis][None], scales[on_axis][None], one, one[None])
        xx, xy, yy = reference.project(splats, pinhole).conics[0].tolist()
        assert xy == pytest.approx(0, abs=1e-9)
        assert (1 / xx - 0.3, 1 / yy - 0.3) == pytest.approx((pixels**2, pixels**2), rel=1e-6)


def test_class_distributions_are_the_softmax_of_their_logits_and_both_branches_have_covariances_of_their_own(cameras):
    depths, raw = depth_maps(), draw(2, 7 + 5, *SIZE, seed=4)
    rays = Rays.of(cameras, depths)
    semantic = semantic_appearance(raw, depths, rays)
    logits = raw[:, 7:].permute(0, 2, 3, 1).flatten(1, 2)
    assert torch.allclose(semantic.features, logits.exp() / logits.exp().sum(-1, keepdim=True))
    other = colour_appearance(draw(2, 7 + 12, *SIZE, seed=5), None, depths, rays, OURS)
    assert not torch.allclose(other.scales, semantic.scales)
    same = colour_appearance(torch.cat((raw[:, :7], draw(2, 12, *SIZE)), 1), None, depths, rays, OURS)
    assert torch.equal(same.scales, semantic.scales)


TINY = {
    "channels": 16, "cnn_widths": (8, 8, 16), "candidates": 8, "cost_width": 8, "upsampled_channels": 16, "harmonics": 4,
    "refine_width": 8, "refine_levels": 3, "projected_channels": 8, "colour_blocks": 2, "semantic_blocks": 2,
}  # fmt: skip


def watched(model: SemGS, **modules: str) -> dict[str, tuple]:
    """Fills a dictionary with (inputs, output) of the named modules whenever the network runs."""
    seen: dict[str, tuple] = {}
    for key, path in modules.items():
        model.get_submodule(path).register_forward_hook(
            lambda module, inputs, output, key=key: seen.__setitem__(key, (inputs, output))
        )
    return seen


def test_depth_is_the_expectation_corrected_by_the_refinement_and_opacity_its_other_channel():
    model = fill_golden(network(**TINY)).double()
    seen = watched(model, logits="colour.depth.regressor", refinement="colour.heads.refinement")
    views = posed_views(2, (32, 48), dtype=torch.float64)
    with torch.inference_mode():
        encoding = model(views)
    near, far = 0.5, 10.0
    p = seen["logits"][1].softmax(1)
    candidates = depth_candidates(views.depth_range, 8)
    disparity = upsample((1 / expected_depth(p, candidates))[:, None], 4, True)[:, 0]
    _, _, read, confidence, _ = seen["refinement"][0]
    _, raw = seen["refinement"][1]
    assert torch.allclose(read, disparity * near)
    assert torch.equal(confidence[:, ::4, ::4], p.amax(1))
    corrected = disparity + raw[:, 0] / near
    assert (raw[:, 0].abs() > 1e-3).any()
    assert torch.allclose(encoding.depths, 1 / corrected.clamp(1 / far, 1 / near))
    assert torch.allclose(encoding.gaussians.opacities.reshape(raw[:, 1].shape), 1 / (1 + (-raw[:, 1]).exp()))


@pytest.mark.parametrize(("bias", "depth"), [(100.0, 0.5), (-100.0, 10.0)], ids=["near", "far"])
def test_a_correction_beyond_near_or_far_ends_there(bias: float, depth: float):
    """Disparities of 1/near = 2 and less, a correction of 100 / near = 200 [1/m]."""
    model = fill_golden(network(**TINY)).double()
    model.colour.heads.refinement.to_disparity[2].bias.data[0] = bias
    with torch.inference_mode():
        depths = model(posed_views(2, (16, 32), dtype=torch.float64)).depths
    assert torch.allclose(depths, torch.full_like(depths, depth), rtol=1e-12, atol=0)


@pytest.mark.parametrize("sampling", ["inverse", "linear"])
def test_the_paper_s_heads_are_its_text(sampling):
    """Depth: the upsampled expectation. Means: pixel centres. Opacity: a CNN on the distribution. Heads: (image, F)."""
    model = fill_golden(network(**TINY, paper_heads=True, conventions=Conventions(candidates=sampling))).double()
    assert not any(
        name.startswith(("colour.heads.refinement", "colour.heads.upsampler")) for name in model.state_dict()
    )
    assert [type(layer).__name__ for layer in model.colour.heads.colour] == ["Conv2d", "GELU", "Conv2d"]
    seen = watched(
        model, logits="colour.depth.regressor", opacity="colour.heads.opacity", colour="colour.heads.colour.0",
        semantic="semantic.head", colour_features="colour.transformer.swin", semantic_features="semantic.transformer.swin",
    )  # fmt: skip
    views = posed_views(2, (32, 48), dtype=torch.float64)
    with torch.inference_mode():
        encoding = model(views)
    p = seen["logits"][1].softmax(1)
    candidates = depth_candidates(views.depth_range, 8, sampling)
    expectation = expected_depth(p, candidates, sampling)
    if sampling == "inverse":
        depths = 1 / upsample(1 / expectation[:, None], 4, True)[:, 0]
    else:
        depths = upsample(expectation[:, None], 4, True)[:, 0]
    assert torch.allclose(encoding.depths, depths)
    assert torch.allclose(encoding.gaussians.means.reshape(2, 32, 48, 3), back_project(depths, views.cameras))
    (distribution,), logit = seen["opacity"]
    assert torch.allclose(distribution, upsample(p, 4, True))
    assert torch.allclose(encoding.gaussians.opacities.reshape(2, 32, 48), logit[:, 0].sigmoid())
    for branch in ("colour", "semantic"):
        features = seen[f"{branch}_features"][1].flatten(0, 1)
        expected = torch.cat((views.images, upsample(features, 4, True)), 1)
        assert torch.allclose(seen[branch][0][0], expected)

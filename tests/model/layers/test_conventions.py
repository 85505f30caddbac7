"""Where MVSplat's code differs from our geometry: what each difference does, theirs and ours (D1 to D8 of docs/method.md)."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import pytest
import torch
from golden import fill_golden
from networks import network
from posed import posed_cameras, posed_views
from torch.nn.functional import normalize

from semgs.geometry.cameras import Cameras, project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.harmonics import basis, colours_from_harmonics, rotate_harmonics
from semgs.geometry.plane_sweep import sweep
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.model.attention.transformer import Windows
from semgs.model.gaussians.placing import Rays, points
from semgs.model.layers.cnn import upsample
from semgs.model.semgs import SemGS
from semgs.model.settings import MVSPLAT, OURS, Conventions
from semgs.model.sweep.cost_volume import cost_volume
from semgs.rendering.render import render

SIZE, GRID = (32, 48), (8, 12)
TINY = {
    "channels": 16, "cnn_widths": (8, 8, 16), "candidates": 8, "cost_width": 8, "upsampled_channels": 16, "harmonics": 4,
    "refine_width": 8, "refine_levels": 3, "projected_channels": 8, "colour_blocks": 1, "semantic_blocks": 1,
}  # fmt: skip


def draw(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def differs(a: torch.Tensor, b: torch.Tensor, limit: float = 1e-3) -> bool:
    return bool((a - b).norm() / b.norm() > limit)


def test_the_two_sets_differ_in_every_kept_difference_and_the_paper_s_sampling_is_neither_s():
    names = {field.name for field in fields(Conventions)}
    same = {name for name in names if getattr(OURS, name) == getattr(MVSPLAT, name)}
    assert same == {"candidates"}
    assert Conventions() == OURS


@pytest.mark.parametrize("name", [field.name for field in fields(Conventions)])
def test_each_field_reaches_the_network(name: str):
    """Cameras have each their own K, off-centre, the near bound is not 1, and some points are seen by no other view."""
    theirs = "linear" if name == "candidates" else getattr(MVSPLAT, name)
    views = posed_views(3, SIZE, seed=4, dtype=torch.float64)
    made = []
    for conventions in (OURS, replace(OURS, **{name: theirs})):
        model = fill_golden(network(**TINY, conventions=conventions)).double()
        with torch.inference_mode():
            made.append(model(views).gaussians)
    ours, other = made
    if name == "standard_harmonics":
        assert torch.equal(ours.means, other.means)
        assert differs(other.colour.features[:, 1:], ours.colour.features[:, 1:])
    else:
        assert differs(other.means, ours.means, 1e-5)


def test_d1_the_shift_mask_goes_by_view_and_theirs_by_token_mixes_the_regions_for_more_than_two_views():
    """Theirs would be the mask repeated along the tokens; with two views both are the same, so no weight depends on it."""
    q = draw(1, 3, 4, 6, 8)
    region = (torch.bucketize(torch.arange(4), torch.tensor([1, 3]), right=True)[:, None] * 3) + torch.bucketize(
        torch.arange(6), torch.tensor([1, 4]), right=True
    )
    mask = torch.where(region.flatten()[:, None] == region.flatten(), 0.0, -100.0)
    own, others = q[0, 0].flatten(0, 1), q[0, 1:].flatten(0, 2)  # keys are (view, token)
    logits = own @ others.mT / 8**0.5
    by_view, by_token = (
        (logits + m).softmax(-1) @ others for m in (mask.repeat(1, 2), mask.repeat_interleave(2, dim=-1))
    )
    windows = Windows((4, 6), 2, True)
    ours = windows.attend(q, q, q, True)[0, 0].flatten(0, 1)
    assert torch.allclose(ours, by_view)
    doubled = q[:, [0, 1, 2, 1, 2]]
    assert torch.allclose(windows.attend(doubled, doubled, doubled, True)[0, 0].flatten(0, 1), ours)
    assert (ours - by_token).abs().max() > 1e-2
    with_two = q[:, :2]
    assert torch.allclose(
        windows.attend(with_two, with_two, with_two, True)[0, 0].flatten(0, 1),
        (own @ q[0, 1].flatten(0, 1).mT / 8**0.5 + mask).softmax(-1) @ q[0, 1].flatten(0, 1),
    )


@pytest.mark.parametrize("own", [True, False])
def test_d2_the_sweep_projects_with_the_source_s_k_and_theirs_with_the_reference_s(own: bool):
    cameras = posed_cameras(2, SIZE, seed=3)
    k = cameras.intrinsics.clone()
    k[1, 0, 0] *= 1.4
    cameras = Cameras(cameras.world_from_camera, k, SIZE)
    plan = sweep(cameras[:1], cameras[1:], GRID, own_intrinsics=own)
    texel, depth = torch.tensor([3.0, 5.0, 1.0], dtype=torch.float64), 2.0
    pixel = torch.tensor([14.0, 22.0, 1.0], dtype=torch.float64)  # 4 px a texel, centres at .5
    pose = cameras.world_from_camera[0]
    world = pose[:3, :3] @ torch.linalg.inv(k[0]) @ pixel * depth + pose[:3, 3]
    used = Cameras(cameras.world_from_camera[1], k[1 if own else 0], SIZE)
    x, y, _ = project(world[None], used)[0].tolist()
    u, v, w = (plan.matrix[0] @ texel * depth + plan.offset[0]).tolist()
    assert (u / w, v / w) == pytest.approx((x / 4 - 0.5, y / 4 - 0.5), rel=1e-10)
    shared = Cameras(cameras.world_from_camera, k[:1].expand(2, 3, 3), SIZE)
    same = [sweep(shared[:1], shared[1:], GRID, own_intrinsics=one).matrix for one in (True, False)]
    assert torch.equal(*same)


@pytest.mark.parametrize("z_depth", [True, False])
def test_d3_a_depth_is_along_the_axis_and_theirs_along_the_ray(z_depth: bool):
    cameras = posed_cameras(2, (6, 9), seed=3)
    depths = 1 + draw(2, 6, 9).abs()
    means = points(depths, None, Rays.of(cameras, depths), replace(OURS, z_depth=z_depth))
    inside = (means - cameras.centres[:, None, None]).flatten(1, 2) @ cameras.world_from_camera[:, :3, :3]
    measured = inside[..., 2] if z_depth else inside.norm(dim=-1)
    assert torch.allclose(measured.unflatten(1, (6, 9)), depths)
    assert differs(inside.norm(dim=-1), inside[..., 2])  # at the corners they are not the same


def mvsplat_colours(harmonics: torch.Tensor, directions: torch.Tensor) -> torch.Tensor:
    """What MVSplat's renderer shows: its basis is the standard one with (x, y, z) read as (z, x, y)."""
    values = basis(directions.roll(1, dims=-1), math.isqrt(harmonics.shape[-2]) - 1)
    return (0.5 + (values[..., None] * harmonics).sum(-2)).clamp(min=0)


def e3nn_rotated(harmonics: torch.Tensor, rotation: torch.Tensor) -> torch.Tensor:
    """Degrees 0 and 1 as e3nn's Wigner matrices turn them: the three of degree 1 are a vector (x, y, z)."""
    return torch.cat((harmonics[..., :1, :], rotation @ harmonics[..., 1:4, :]), dim=-2)


def test_d4_harmonics_of_ours_turn_with_the_camera():
    rotation = matrix_from_quaternion(torch.tensor([0.8, 0.3, -0.5, 0.2], dtype=torch.float64))
    harmonics, directions = 0.2 * draw(1, 50, 16, 3), normalize(draw(50, 3, seed=1), dim=-1)
    turned = rotate_harmonics(harmonics, rotation[None])[0]
    assert torch.allclose(
        colours_from_harmonics(turned, directions @ rotation.T), colours_from_harmonics(harmonics[0], directions)
    )


def test_d4_mvsplat_s_colours_render_the_same_after_conversion_to_the_standard_basis():
    """Degree 1 in MVSplat's own reckoning: turned by e3nn's rule, seen by its renderer; the picture against ours."""
    camera = posed_cameras(1, (20, 35), seed=4)
    pose = camera.world_from_camera[0]
    rotation = pose[:3, :3]
    count = 40
    inside = torch.cat((draw(count, 2).clamp(-1, 1), 2 + draw(count, 1, seed=1).abs()), dim=-1)
    means = inside @ rotation.T + pose[:3, 3]
    predicted = 0.3 * draw(count, 4, 3, seed=2)
    quaternions, scales = draw(count, 4, seed=3), 0.05 + 0.1 * draw(count, 3, seed=4).abs()
    opacities = torch.full((count,), 0.7, dtype=torch.float64)

    theirs = mvsplat_colours(e3nn_rotated(predicted, rotation), normalize(means - pose[:3, 3], dim=-1))
    constant = ((theirs - 0.5) / 0.28209479177387814)[:, None]  # the colour itself, whatever the direction

    def picture(harmonics: torch.Tensor) -> torch.Tensor:
        return render(Gaussians(means, opacities, Appearance(quaternions, scales, harmonics)), camera).images

    converted = rotate_harmonics(predicted[None], rotation[None], mvsplat_basis=True)[0]
    assert torch.allclose(picture(converted), picture(constant), atol=1e-10)
    assert differs(picture(rotate_harmonics(predicted[None], rotation[None])[0]), picture(constant), 1e-2)


@pytest.mark.parametrize("centres", [True, False])
def test_d6_texels_have_their_centres_at_a_half_and_theirs_at_integers(centres: bool):
    cameras = posed_cameras(2, SIZE, seed=3)
    plan = sweep(cameras[:1], cameras[1:], GRID, pixel_centres=centres)
    column, row, depth = 3, 5, 2.0
    half = 0.5 if centres else 0.0
    pixel = torch.tensor([4 * (column + half), 4 * (row + half), 1.0], dtype=torch.float64)
    pose = cameras.world_from_camera[0]
    world = pose[:3, :3] @ torch.linalg.inv(cameras.intrinsics[0]) @ pixel * depth + pose[:3, 3]
    x, y, _ = project(world[None], cameras[1])[0].tolist()
    u, v, w = (plan.matrix[0] @ torch.tensor([column, row, 1.0], dtype=torch.float64) * depth + plan.offset[0]).tolist()
    assert (u / w, v / w) == pytest.approx((x / 4 - half, y / 4 - half), rel=1e-10)


@pytest.mark.parametrize("centres", [True, False])
def test_d6_upsampling_keeps_the_corners_of_the_picture_and_theirs_the_centres_of_the_corner_texels(centres: bool):
    """A ramp over the columns, upsampled four times: ours has a texel's value at its centre, 1.5 pixels inside it."""
    ramp = torch.arange(5, dtype=torch.float64).expand(1, 1, 3, 5)
    wide = upsample(ramp, 4, centres)[0, 0, 6]
    if centres:
        expected = [min(max((column + 0.5) / 4 - 0.5, 0), 4) for column in range(20)]
    else:
        expected = [4 * column / 19 for column in range(20)]
    assert wide.tolist() == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("fused", [False, True])
def test_what_a_source_cannot_see_does_not_count_and_theirs_is_a_zero_in_the_mean(fused: bool):
    """Two source views of one scene, one of which looks away: ours is the other's cost, theirs half of it."""
    cameras = posed_cameras(3, SIZE, seed=7, spread=0.02)
    poses = cameras.world_from_camera.clone()
    poses[2, :3, :3] = poses[2, :3, :3] @ torch.diag(torch.tensor([-1.0, 1, -1], dtype=torch.float64))
    cameras = Cameras(poses[None], cameras.intrinsics[None], SIZE)
    features, near = draw(1, 3, 8, *GRID), torch.full((1, 3), 0.5, dtype=torch.float64)
    depths = torch.full((1, 3, 2), 6.0, dtype=torch.float64)
    ours, theirs = (
        cost_volume(features, cameras, near, depths, replace(OURS, mask_unseen=masked), fused=fused)[0, 0]
        for masked in (True, False)
    )
    middle = (slice(None), slice(3, 5), slice(4, 8))
    alone = cost_volume(features[:, :2], cameras[:, :2], near[:, :2], depths[:, :2], fused=fused)[0, 0]
    assert torch.allclose(ours[middle], alone[middle])
    assert torch.allclose(theirs[middle], alone[middle] / 2)


def test_d7_a_pose_a_little_off_a_rotation_is_made_one_and_the_network_runs():
    views = posed_views(2, SIZE)
    poses = views.cameras.world_from_camera.clone()
    poses[:, :3, :3] += 1e-3 * draw(2, 3, 3)
    nearly = replace(views, cameras=Cameras(poses, views.cameras.intrinsics, SIZE))
    rotation = nearly.cameras.world_from_camera[:, :3, :3]
    assert torch.allclose(rotation @ rotation.mT, torch.eye(3, dtype=torch.float64).expand(2, 3, 3), atol=1e-12)
    with torch.inference_mode():
        assert torch.isfinite(fill_golden(network(**TINY))(nearly).gaussians.means).all()


@pytest.mark.parametrize("relative", [True, False])
def test_d8_the_refinement_knows_no_unit_and_theirs_reads_one_over_metres(relative: bool):
    """The same numbers where the near bound is 1; elsewhere only ours scales with the world."""
    model = fill_golden(network(**TINY, conventions=replace(OURS, relative_disparity=relative))).double()
    ours = fill_golden(network(**TINY)).double()
    views = posed_views(2, SIZE, dtype=torch.float64)

    def depths(network: SemGS, near: float) -> torch.Tensor:
        poses = views.cameras.world_from_camera.clone()
        poses[:, :3, 3] *= near
        bounds = torch.tensor([near, 20 * near], dtype=torch.float64).expand(2, 2)
        cameras = Cameras(poses, views.cameras.intrinsics, SIZE)
        with torch.inference_mode():
            return network(replace(views, cameras=cameras, depth_range=bounds)).depths

    assert torch.allclose(depths(model, 1.0), depths(ours, 1.0))
    assert differs(depths(model, 3.0), 3 * depths(model, 1.0)) is not relative

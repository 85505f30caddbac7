"""Refinement on input photos: its steps by hand, what it may change and what not, and when it stops."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from golden import fill_golden
from networks import preset
from posed import posed_views

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras, back_project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.scene.encoding import Encoding
from semgs.scene.photo_refinement import (
    Unknown,
    Unknowns,
    refine,
    refine_until,
    seen_by_several,
    with_faded_borders,
)

SIZE = (29, 37)


@pytest.fixture(scope="module")
def views() -> Views:
    return posed_views(2, SIZE)


@pytest.fixture(scope="module")
def encoding(views: Views) -> Encoding:
    model = fill_golden(preset("small_plain"))
    with torch.no_grad():
        return replace(model(views), classes=None)


def errors(encoding: Encoding, views: Views) -> torch.Tensor:
    """The mean squared error of each view."""
    return (encoding.render(views.cameras).images - views.images).square().mean((1, 2, 3))


@pytest.mark.parametrize(
    ("together", "expected"), [(False, [[0.9, -1.9], [0.8, -1.8]]), (True, [[0.91515, -1.88686], [0.8303, -1.77373]])]
)
def test_steps_are_adams(together: bool, expected: list[list[float]]) -> None:
    """A constant gradient (3, -4) moves each number by the rate; together by rate / sqrt((9 + 16) / 2) times the gradient."""
    unknown = Unknown(torch.tensor([1.0, -2.0]), 0.1, together)
    for wanted in expected:
        unknown.value.grad = torch.tensor([3.0, -4.0])
        unknown.step(1.0)
        torch.testing.assert_close(unknown.value.detach(), torch.tensor(wanted), rtol=0, atol=2e-5)


def test_a_step_at_half_the_rate_is_half_as_long() -> None:
    unknown = Unknown(torch.tensor([1.0]), 0.1)
    unknown.value.grad = torch.tensor([7.0])
    unknown.step(0.5)
    assert unknown.value.item() == pytest.approx(0.95)


def test_images_come_closer_to_the_photos_and_what_is_no_image_stays(encoding: Encoding, views: Views) -> None:
    refined = refine(encoding, views, 10)
    assert (errors(refined, views) < 0.85 * errors(encoding, views)).all()
    before, after = encoding.gaussians, refined.gaussians
    assert len(after) == len(before)
    assert torch.equal(after.semantic.features, before.semantic.features)
    assert torch.equal(after.semantic.quaternions, before.semantic.quaternions)
    assert not torch.equal(after.means, before.means)
    after.checked()


def test_depths_follow_the_gaussians_and_class_gaussians_grow_with_them(encoding: Encoding, views: Views) -> None:
    """A pixel's depth times the ratio of its Gaussian's old and new depth; sizes of semantic Gaussians by the same ratio."""
    refined = refine(encoding, views, 5)
    ratios = refined.placed_depths(views.cameras) / encoding.placed_depths(views.cameras)
    assert (ratios - 1).abs().max() > 1e-4
    torch.testing.assert_close(refined.depths, encoding.depths * ratios, rtol=1e-4, atol=0)
    sizes = refined.gaussians.semantic.scales / encoding.gaussians.semantic.scales
    own = encoding.per_gaussian(ratios[:, None])[:, 0]
    torch.testing.assert_close(sizes, own[:, None].expand(-1, 3), rtol=1e-3, atol=0)


def test_gaussians_that_a_sensor_placed_do_not_move(encoding: Encoding, views: Views) -> None:
    refined = refine_until(encoding, views, 3, moves=False).encoding
    assert torch.equal(refined.gaussians.means, encoding.gaussians.means)
    assert torch.equal(refined.depths, encoding.depths)
    assert (errors(refined, views) < errors(encoding, views)).all()


def test_the_same_seed_gives_the_same_bits(encoding: Encoding, views: Views) -> None:
    one, again, other = (refine(encoding, views, 5, seed=seed) for seed in (3, 3, 4))
    assert all(torch.equal(a, b) for a, b in zip(one.tensors(), again.tensors(), strict=True))
    assert not torch.equal(one.gaussians.means, other.gaussians.means)


def test_gaussians_of_merged_windows_know_their_photos(encoding: Encoding, views: Views) -> None:
    """Without every third Gaussian, each of the others gets as much deeper in its own photo as the depth of its block does."""
    places = torch.arange(len(encoding.gaussians))
    places = places[places % 3 > 0]
    merged = replace(encoding, gaussians=encoding.gaussians.map(lambda tensor: tensor[places]), places=places)
    refined = refine(merged, views, 4)
    assert (errors(refined, views) < errors(merged, views)).all()
    rows_and_columns = 15 * 19  # ceil(29 / 2), ceil(37 / 2)
    pose = views.cameras.world_from_camera.float()[places // rows_and_columns]
    before, after = (((one.gaussians.means - pose[:, :3, 3]) * pose[:, :3, 2]).sum(-1) for one in (merged, refined))
    own = merged.per_gaussian((refined.depths / merged.depths)[:, None])[:, 0]
    assert (own - 1).abs().max() > 1e-3
    torch.testing.assert_close(after / before, own, rtol=1e-4, atol=0)


def test_the_pass_that_renders_the_other_view_best_is_kept(encoding: Encoding, views: Views) -> None:
    refined = refine_until(encoding, views, 6, check=views)
    assert len(refined.curve) == 7
    assert refined.passes == max(range(7), key=refined.curve.__getitem__)
    error = float((refined.encoding.render(views.cameras, clamp=False).images - views.images).square().mean())
    assert max(refined.curve) == pytest.approx(-10 * torch.log10(torch.tensor(error)).item(), abs=1e-4)


def test_a_scene_that_only_gets_worse_stays_as_it_was(encoding: Encoding, views: Views) -> None:
    now = encoding.render(views.cameras, clamp=False).images
    refined = refine_until(encoding, views, 3, check=views.changed(images=now))
    assert refined.passes == 0
    assert refined.curve[0] == pytest.approx(120)  # of equal images, by the least error that counts
    assert refined.encoding is encoding


def test_each_step_is_told(encoding: Encoding, views: Views) -> None:
    told: list[int] = []
    refine_until(encoding, views, 3, done=told.append)
    assert told == [1, 2, 3, 4, 5, 6]


def test_what_cannot_be_refined_is_refused(encoding: Encoding, views: Views) -> None:
    with pytest.raises(ValueError, match="passes is 0; expected 1 or more"):
        refine(encoding, views, 0)
    with pytest.raises(ValueError, match=r"depths \(2, 29, 37\); expected those of 3 views of 29x37"):
        refine(encoding, posed_views(3, SIZE), 1)


def test_hidden_pixels_teach_nothing(encoding: Encoding, views: Views) -> None:
    """The left half of the photos is hidden, so what is there does not matter."""
    hidden = torch.zeros(2, *SIZE, dtype=torch.bool)
    hidden[..., :18] = True
    images = views.images.clone()
    images[..., :18] = 1 - images[..., :18]
    one, other = (refine(encoding, views.changed(images=shown, hidden=hidden), 2) for shown in (views.images, images))
    assert all(torch.equal(a, b) for a, b in zip(one.tensors(), other.tensors(), strict=True))


def test_gaussians_without_opacity_stay_so(encoding: Encoding, views: Views) -> None:
    gone = torch.arange(len(encoding.gaussians)) % 5 == 0
    gaussians = replace(encoding.gaussians, opacities=encoding.gaussians.opacities.masked_fill(gone, 0))
    refined = refine(replace(encoding, gaussians=gaussians), views, 2).gaussians.opacities
    assert not refined[gone].any()
    assert refined[~gone].min() > 0


def test_what_one_photo_alone_sees_changes_its_colour_only(encoding: Encoding, views: Views) -> None:
    shared = seen_by_several(encoding, views)
    assert 0.05 < shared.float().mean() < 0.95
    refined = refine(encoding, views, 4)
    before, after = encoding.gaussians, refined.gaussians
    alone = ~shared
    assert torch.equal(after.means[alone], before.means[alone])
    assert torch.equal(after.opacities[alone], before.opacities[alone])
    assert torch.equal(after.colour.scales[alone], before.colour.scales[alone])
    assert torch.equal(after.colour.quaternions[alone], before.colour.quaternions[alone])
    assert (after.colour.features[alone] - before.colour.features[alone]).abs().max() > 1e-3
    assert (after.means[shared] - before.means[shared]).abs().max() > 1e-5


def two_walls() -> tuple[Encoding, Views]:
    """Two cameras with a focal length of 10 px, 0.8 m apart, before a wall at 4 m: columns shift by 2. In the second photo, columns 17 to 19 are half as deep."""
    poses = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    poses[1, 0, 3] = 0.8
    intrinsics = torch.tensor([[10.0, 0, 10], [0, 10, 4], [0, 0, 1]], dtype=torch.float64).expand(2, 3, 3)
    cameras, ranges = Cameras(poses, intrinsics, (8, 20)), torch.tensor([[1.0, 9], [1, 9]], dtype=torch.float64)
    depths = torch.full((2, 8, 20), 4.0)
    depths[1, :, 17:] = 2.0
    count = depths.numel()
    shape = Appearance(
        quaternions=torch.eye(4)[0].expand(count, 4),
        scales=torch.full((count, 3), 0.1),
        features=torch.ones(count, 1, 3),
    )
    gaussians = Gaussians(back_project(depths, cameras).flatten(0, 2).float(), torch.ones(count), shape)
    walls = Encoding(gaussians, depths, torch.ones_like(depths), torch.zeros_like(depths), ranges)
    views = Views(images=torch.zeros(2, 3, 8, 20), cameras=cameras, depth_range=ranges)
    return walls, views


def test_a_gaussian_is_shared_where_the_other_photo_has_the_same_depth() -> None:
    """Columns 0 and 1 of the first photo fall outside of the second, 19 onto its near part."""
    shared = seen_by_several(*two_walls()).reshape(2, 8, 20)
    assert [int(column) for column in shared[0].all(0).nonzero()] == list(range(2, 19))
    assert [int(column) for column in shared[1].all(0).nonzero()] == list(range(17))
    assert torch.equal(shared.any(1), shared.all(1))


def test_what_several_photos_see_fades_towards_their_borders() -> None:
    """The border has 12 % of 8 px. The outermost pixels are 0.5 px inside: 0.5 + 0.5 * 0.5 / 0.96 = 0.7604. What one photo alone sees stays."""
    walls, views = two_walls()
    opacities = with_faded_borders(walls, views, seen_by_several(walls, views)).gaussians.opacities.reshape(2, 8, 20)
    expected = torch.ones(2, 8, 20)
    expected[0, [0, 7], 2:19] = expected[1, [0, 7], :17] = expected[1, :, 0] = 0.7604
    torch.testing.assert_close(opacities, expected, rtol=0, atol=1e-4)


def test_colour_gaussians_that_move_to_twice_the_depth_are_twice_as_large(encoding: Encoding, views: Views) -> None:
    """So they cover the same pixels. All depths shift by log 2."""
    unknowns = Unknowns(encoding, views, moves=True, shared=torch.ones(len(encoding.gaussians), dtype=torch.bool))
    before = unknowns.gaussians()
    unknowns.depth.value.data.fill_(math.log(2))
    after = unknowns.gaussians()
    torch.testing.assert_close(after.colour.scales, 2 * before.colour.scales)
    centres = views.cameras.world_from_camera[encoding.own_views, :3, 3].float()
    torch.testing.assert_close(after.means - centres, 2 * (before.means - centres), rtol=1e-5, atol=1e-5)

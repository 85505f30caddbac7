"""Targets rendered with the nearest input views' Gaussians: by hand, and against networks that got only those views."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from golden import fill_golden
from networks import preset
from posed import posed_cameras, posed_views

from semgs.geometry.cameras import Cameras
from semgs.model.semgs import SemGS
from semgs.scene.overlap import NearestViews

SIZE = (29, 37)


@pytest.fixture(scope="module")
def small() -> SemGS:
    return fill_golden(preset("small_plain")).double()


def moved(cameras: Cameras, by: list[float]) -> Cameras:
    """Cameras in another place."""
    return cameras.relative_to([-side for side in by])


def test_the_two_of_three_centres_that_are_nearest_are_chosen_in_their_order():
    cameras = posed_cameras(3, SIZE)
    poses = cameras.world_from_camera.clone()
    poses[:, :3, 3] = torch.tensor([[5.0, 1, 0], [0.0, 1, 0], [2.0, 1, 0]])
    contexts, target = Cameras(poses, cameras.intrinsics, SIZE), Cameras(poses[0], cameras.intrinsics[0], SIZE)
    # The target is at x = 5: distances 0, 5 and 3; then at x = 0.9: 4.1, 0.9 and 1.1.
    assert NearestViews(2, 0.5).chosen(contexts, target) == [0, 2]
    assert NearestViews(2, 0.5).chosen(contexts, moved(target, [-4.1, 0, 0])) == [1, 2]
    assert NearestViews(1, 0.5).chosen(contexts, moved(target, [-4.1, 0, 0])) == [1]
    assert NearestViews(9, 0.5).chosen(contexts, target) == [0, 1, 2]


def test_sizes_are_those_of_a_scene_without_the_other_views(small: SemGS):
    views = posed_views(4, SIZE, dtype=torch.float64)
    target = views.cameras[3:]
    nearest = NearestViews(2, small.placer.shrink_seen)
    assert nearest.chosen(views.cameras, target) == [2, 3]
    with torch.inference_mode():
        found = nearest(small(views), views.cameras, target)
        placer, small.placer = small.placer, replace(small.placer, shrink_seen=0.0)
        plain = small(views)
        small.placer = placer
    each = len(plain.gaussians) // 4
    # Two views never shrink anything, so the sizes are those that the network predicts before its rule.
    torch.testing.assert_close(found.gaussians.colour.scales, plain.gaussians.colour.scales[2 * each :])
    for name in ("means", "opacities"):
        assert torch.equal(getattr(found.gaussians, name), getattr(plain.gaussians, name)[2 * each :])
    assert torch.equal(found.depths, plain.depths[2:])
    assert found.gaussians.semantic is not None
    assert plain.gaussians.semantic is not None
    assert torch.equal(found.gaussians.semantic.scales, plain.gaussians.semantic.scales[2 * each :])


def test_three_of_four_views_shrink_what_all_three_see(small: SemGS):
    """A Gaussian that four views see is (2/4)^0.5 of its size; without the fourth view, (2/3)^0.5: it grows by (4/3)^0.5."""
    views = posed_views(4, SIZE, dtype=torch.float64)
    nearest = NearestViews(3, small.placer.shrink_seen)
    with torch.inference_mode():
        encoding = small(views)
        found = nearest(encoding, views.cameras, views.cameras[3:])
    each = len(encoding.gaussians) // 4
    growth = found.gaussians.colour.scales / encoding.gaussians.colour.scales[each:]
    values = set(growth.flatten().round(decimals=6).tolist())
    assert round((4 / 3) ** 0.5, 6) in values
    assert values <= {1.0, round((4 / 3) ** 0.5, 6), round((3 / 2) ** 0.5, 6)}


def test_all_views_change_nothing(small: SemGS):
    views = posed_views(2, SIZE, dtype=torch.float64)
    with torch.inference_mode():
        encoding = small(views)
    assert NearestViews(2, 0.5)(encoding, views.cameras, views.cameras[:1]) is encoding


def test_no_view_at_all_is_refused():
    with pytest.raises(ValueError, match="count is 0; expected at least one input view"):
        NearestViews(0, 0.5)

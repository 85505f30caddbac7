"""Which places `scripts/locate_depth_errors.py` counts a texel to."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest
import torch

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras
from semgs.model.weights.load import load

SCRIPT = runpy.run_path(str(Path(__file__).parents[3] / "scripts" / "locate_depth_errors.py"))
SIZE = (32, 64)


@pytest.fixture
def wall() -> Views:
    """A grey wall at 4 m, seen by two cameras with focal length 32 px, the second 2 m to the right: its picture moves by 16 px."""
    poses = torch.eye(4, dtype=torch.float64).repeat(2, 1, 1)
    poses[1, 0, 3] = 2.0
    intrinsics = torch.tensor([[32.0, 0, 32], [0, 32, 16], [0, 0, 1]], dtype=torch.float64).repeat(2, 1, 1)
    images, bounds = torch.full((2, 3, *SIZE), 0.5), torch.tensor([[1.0, 8.0]]).repeat(2, 1)
    return Views(images, Cameras(poses, intrinsics, SIZE), bounds, depths=torch.full((2, *SIZE), 4.0))


def shares(views: Views) -> dict[str, float]:
    return {name: float(mask.float().mean()) for name, mask in SCRIPT["places"](views).items()}


def test_a_bare_wall_is_flat_and_three_quarters_of_it_are_seen_by_both(wall: Views):
    assert shares(wall) == {
        "all": 1, "textured": 0, "flat": 1, "border": 0, "near an edge": 0, "elsewhere": 1, "seen by both": 0.75, "seen by one": 0.25,
    }  # fmt: skip


def test_half_of_a_wall_with_a_pattern_on_its_left_half_is_textured(wall: Views):
    images = wall.images.clone()
    images[..., :32:2] = 0.9
    assert shares(wall.changed(images=images))["textured"] == pytest.approx(0.5, abs=1 / 16)


def test_a_step_in_depth_is_a_border_and_what_the_other_view_does_not_agree_with_is_seen_by_one(wall: Views):
    depths = wall.depths.clone()
    depths[0, :, 34:] = 5.0
    found = SCRIPT["places"](wall.changed(depths=depths))
    assert found["border"][0].nonzero()[:, 1].unique().tolist() == [8]  # texel 8 is pixel 34, next to the step
    assert not found["seen by both"][0][:, 9:].any()


def test_six_pixels_to_each_side_of_a_step_are_near_an_edge(wall: Views):
    depths = wall.depths.clone()
    depths[0, :, 34:] = 5.0
    near = SCRIPT["places"](wall.changed(depths=depths))["near an edge"]
    # In 3x3 pixels around columns 33 and 34 depth differs, so columns 27 to 40 are near; texels 7 to 9 have theirs at 30, 34 and 38.
    assert near[0].nonzero()[:, 1].unique().tolist() == [7, 8, 9]
    assert not near[1].any()


def test_of_eight_gaussians_at_a_step_the_two_that_hang_between_the_surfaces_are_flyers():
    truth = torch.tensor([[2.0] * 20 + [3.0] * 20]).expand(
        1, 2, 40
    )  # a step at column 20, one row of Gaussians of 2x2 pixels
    depths = truth.clone()
    for column, depth in ((18, 2.5), (20, 2.2), (22, 2.1), (24, 2.9), (26, 2.5), (28, 3.5), (4, 2.5), (14, 1.7)):
        depths[..., column : column + 2] = depth
    # 2.1 and 2.9 are within 7 % of a surface; 2.5 at column 26 has its pixel at 27, seven from the near surface; 3.5 and 1.7 are behind
    # and before both; at column 4 there is one surface.
    assert SCRIPT["flyers"](depths, truth, 2)[0, 0].nonzero()[:, 0].tolist() == [9, 10]
    unknown = truth.clone()
    unknown[..., 20:] = 0
    assert not SCRIPT["flyers"](depths, unknown, 2).any()


def test_texels_without_true_depth_are_nowhere(wall: Views):
    depths = wall.depths.clone()
    depths[:, :16] = 0
    assert shares(wall.changed(depths=depths))["all"] == 0.5


def test_of_a_wall_with_a_pattern_the_included_weights_match_most_of_what_both_views_see(wall: Views):
    """The picture moves by 32 px * 2 m / 4 m = 16 px; the first view's left 16 columns are out of the second's sight."""
    pattern = torch.nn.functional.interpolate(
        torch.rand(1, 3, 16, 40, generator=torch.Generator().manual_seed(0)), (32, 80)
    )[0]
    views = wall.changed(images=torch.stack([pattern[:, :, :64], pattern[:, :, 16:]]))
    truth = torch.full((2, 8, 16), 4.0)
    found = SCRIPT["found"](load("small"), views, truth)
    assert list(found.depths) == list(SCRIPT["STEPS"])
    assert found.flying.shape == (2, 16, 32)
    both = SCRIPT["places"](views)["seen by both"]
    assert found.right[both].float().mean() > 0.9
    assert (found.depths["raw cost"][both] / truth[both] - 1).abs().median() < 0.05

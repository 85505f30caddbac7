"""The trivial rows, on a wall whose every pixel is known."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from semgs.data.views import Views
from semgs.evaluation.scoring.baselines import copy_nearest, predict_majority, warp_contexts
from semgs.geometry.cameras import Cameras, pixel_centres
from semgs.geometry.rotations import matrix_from_quaternion

SIZE = (24, 40)
FOCAL, CENTRE = (32.0, 30.0), (17.5, 13.25)
WALL = 2.0


def look(shift: float, label_step: float = 0.25, post: bool = False) -> Views:
    """A camera `shift` metres to the right, before a wall 2 m away whose colours and labels are stripes; perhaps a post at 1 m."""
    turn = matrix_from_quaternion(torch.tensor([0.9, 0.1, -0.3, 0.2], dtype=torch.float64))
    pose = torch.eye(4, dtype=torch.float64)
    pose[:3, :3] = turn
    pose[:3, 3] = turn @ torch.tensor([shift, 0.0, 0.0], dtype=torch.float64) + torch.tensor([3.0, -1.0, 0.5])
    intrinsics = torch.tensor([[FOCAL[0], 0, CENTRE[0]], [0, FOCAL[1], CENTRE[1]], [0, 0, 1]])
    rays = (pixel_centres(SIZE) - torch.tensor(CENTRE)) / torch.tensor(FOCAL)
    x, y = rays[..., 0] * WALL + shift, rays[..., 1] * WALL
    image = torch.stack((0.5 + 0.3 * torch.sin(2 * x), 0.5 + 0.3 * torch.cos(y), torch.full_like(x, 0.4)))
    labels = (torch.floor(x / label_step) % 7).byte()
    depths = torch.full(SIZE, WALL)
    if post:
        before = (rays[..., 0] * 1.0 + shift).abs() < 0.08
        depths = torch.where(before, 1.0, depths)
        labels = torch.where(before, 9, labels).byte()
        image = torch.where(before, 0.9, image)
    return Views(
        image[None].float(), Cameras(pose[None], intrinsics[None], SIZE), [(0.5, 10.0)],
        labels=labels[None], depths=depths[None].float(),
    )  # fmt: skip


def test_a_copy_is_the_context_itself():
    context = look(0.1)
    found = copy_nearest(context)
    assert context.labels is not None
    assert context.depths is not None
    assert found.labels is not None
    assert found.image is not None
    assert found.depths is not None
    assert torch.equal(found.labels, context.labels[0])
    assert torch.equal(found.image, context.images[0])
    assert torch.equal(found.depths, context.depths[0])


def test_a_warped_wall_is_what_the_target_sees_where_a_context_sees_it():
    target, left, right = look(0.0), look(-0.25), look(0.25)
    found = warp_contexts([left, right], target)
    assert found is not None
    assert found.labels is not None
    assert found.image is not None
    assert target.labels is not None
    assert found.unseen is not None
    assert not found.unseen.any()
    # A quarter of a metre is a shift of exactly four pixels: nothing is interpolated.
    assert torch.equal(found.labels, target.labels[0])
    assert (found.image - target.images[0]).abs().max() < 1e-6
    alone = warp_contexts([left], target)
    assert alone is not None
    assert alone.unseen is not None
    assert (alone.unseen.sum(1) == 4).all()
    assert alone.unseen[:, -4:].all()


def test_what_no_context_sees_is_the_nearest_ones_own_pixel():
    target, left = look(0.0), look(-0.25)
    found = warp_contexts([left], target)
    assert found is not None
    assert found.labels is not None
    assert left.labels is not None
    assert torch.equal(found.labels[:, -4:], left.labels[0, :, -4:])
    assert found.image is not None
    assert torch.equal(found.image[..., -4:], left.images[0, ..., -4:])


def test_a_point_behind_a_post_is_not_taken_from_the_post():
    target, hidden, other = look(0.0, post=True), look(0.25, post=True), look(-0.5)
    found = warp_contexts([hidden, other], target)
    assert found is not None
    assert found.labels is not None
    assert target.labels is not None
    assert found.unseen is not None
    seen = ~found.unseen
    wall = (target.labels[0] != 9) & seen
    assert torch.equal(found.labels[wall], target.labels[0][wall])
    lone = warp_contexts([hidden], target)
    assert lone is not None
    assert lone.unseen is not None
    # The wall behind the post in the nearer context is only in the other one.
    assert (lone.unseen & wall)[:, 4:-4].any()


def test_pixels_of_unknown_depth_are_copied():
    target, left = look(0.0), look(-0.25)
    assert target.depths is not None
    depths = target.depths.clone()
    depths[0, 5, 20] = 0
    holed = Views(target.images, target.cameras, target.depth_range, target.labels, depths)
    found = warp_contexts([left], holed)
    assert found is not None
    assert found.image is not None
    assert found.unseen is not None
    assert found.unseen[5, 20]
    assert torch.equal(found.image[:, 5, 20], left.images[0, :, 5, 20])


def test_without_true_depth_nothing_is_warped():
    target, left = look(0.0), look(-0.25)
    assert warp_contexts([left], Views(target.images, target.cameras, target.depth_range)) is None
    assert warp_contexts([Views(left.images, left.cameras, left.depth_range)], target) is None


def test_the_majority_is_that_of_all_images_together():
    truths = [np.array([5, 3, 0]), np.array([0, 4, 1])]
    first, second = predict_majority(truths)
    assert first.tolist() == [[0, 5, 0], [0, 3, 0], [0, 0, 0]]
    assert second.tolist() == [[0, 0, 0], [0, 4, 0], [0, 1, 0]]
    assert (first.sum() + second.sum()) == pytest.approx(13)

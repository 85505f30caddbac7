"""Equation 1: the projection that attention multiplies with is the camera's own, from the first view's frame."""

from __future__ import annotations

import torch
from posed import posed_cameras

from semgs.geometry.cameras import Cameras, inverse_rigid, project
from semgs.model.attention.camera_attention import normalised_projections

SIZE = (32, 48)
NEAR = torch.tensor([0.5], dtype=torch.float64)


def batched(cameras: Cameras) -> Cameras:
    return Cameras(cameras.world_from_camera[None], cameras.intrinsics[None], cameras.size)


def unit_of(cameras: Cameras) -> float:
    """The mean distance between the centres of different views."""
    count = len(cameras.centres)
    return float(torch.cdist(cameras.centres, cameras.centres).sum() / (count * (count - 1)))


def test_a_point_is_projected_to_where_its_camera_sees_it_as_a_share_of_the_picture_from_its_middle() -> None:
    cameras = posed_cameras(3, SIZE)
    there, _ = normalised_projections(batched(cameras), NEAR)
    generator = torch.Generator().manual_seed(0)
    inside = torch.rand(20, 3, generator=generator, dtype=torch.float64) + torch.tensor([-0.5, -0.5, 2.0])
    first = cameras.world_from_camera[0]
    world = inside @ first[:3, :3].mT + first[:3, 3]
    unit = unit_of(cameras)
    homogeneous = torch.cat((inside / unit, torch.ones(20, 1, dtype=torch.float64)), dim=1)
    height, width = SIZE
    for view in range(3):
        x, y, depth = project(world, cameras[view]).unbind(-1)
        u, v, z, one = (homogeneous @ there[0, view].mT).unbind(-1)
        torch.testing.assert_close(z * unit, depth)
        torch.testing.assert_close(u / z, x / width - 0.5)
        torch.testing.assert_close(v / z, y / height - 0.5)
        assert (one == 1).all()


def test_two_projections_hold_the_relative_pose_alone() -> None:
    """P_i P_j^-1 = [K_i R | K_i t] of camera i from camera j, wherever the first camera is."""
    cameras = posed_cameras(3, SIZE, seed=2)
    there, back = normalised_projections(batched(cameras), NEAR)
    order = [2, 0, 1]
    again, again_back = normalised_projections(batched(cameras[torch.tensor(order)]), NEAR)
    for i in range(3):
        for j in range(3):
            relative = there[0, i] @ back[0, j]
            torch.testing.assert_close(again[0, order.index(i)] @ again_back[0, order.index(j)], relative)
    relative = inverse_rigid(cameras.world_from_camera[1]) @ cameras.world_from_camera[2]
    # The centre of camera 2 in camera 1's frame, in units of the mean distance, behind the lift of K.
    centre = there[0, 1] @ back[0, 2] @ torch.tensor([0.0, 0, 0, 1], dtype=torch.float64)
    torch.testing.assert_close(centre[2] * unit_of(cameras), relative[2, 3])


def test_a_world_in_other_units_has_the_same_projections() -> None:
    cameras = posed_cameras(2, SIZE)
    poses = cameras.world_from_camera.clone()
    poses[:, :3, 3] *= 7
    scaled = Cameras(poses, cameras.intrinsics, SIZE)
    for one, other in zip(
        normalised_projections(batched(cameras), NEAR), normalised_projections(batched(scaled), 7 * NEAR), strict=True
    ):
        torch.testing.assert_close(one, other, rtol=0, atol=1e-12)

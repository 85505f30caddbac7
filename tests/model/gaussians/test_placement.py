"""Placing Gaussians, by hand: where, how large, how turned, of what colour and class."""

from __future__ import annotations

import pytest
import torch
from posed import posed_cameras

from semgs.geometry.cameras import back_project, pixel_centres, project
from semgs.geometry.harmonics import basis
from semgs.geometry.rotations import covariance, matrix_from_quaternion
from semgs.model.gaussians.placing import Rays, colour_appearance, points, semantic_appearance
from semgs.model.settings import MVSPLAT, OURS

SIZE, VIEWS = (6, 9), 2


@pytest.fixture
def cameras():
    return posed_cameras(VIEWS, SIZE)


def drawn(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


DEPTHS = 1 + drawn(VIEWS, *SIZE, seed=9).exp()
RAYS_LIKE = torch.zeros(1, dtype=torch.float64)


def test_without_a_shift_means_are_back_projected_pixel_centres(cameras) -> None:
    rays = Rays.of(cameras, RAYS_LIKE)
    still = points(DEPTHS, torch.zeros(VIEWS, 2, *SIZE, dtype=torch.float64), rays, OURS)
    torch.testing.assert_close(still, back_project(DEPTHS, cameras))


def test_a_shift_moves_a_mean_within_its_pixel_and_leaves_its_depth(cameras) -> None:
    rays = Rays.of(cameras, RAYS_LIKE)
    raw = drawn(VIEWS, 2, *SIZE, seed=1)
    seen = project(points(DEPTHS, raw, rays, OURS).flatten(1, 2), cameras).unflatten(1, SIZE)
    torch.testing.assert_close(seen[..., 2], DEPTHS)
    expected = pixel_centres(SIZE) + raw.sigmoid().permute(0, 2, 3, 1) - 0.5
    torch.testing.assert_close(seen[..., :2], expected)


def test_mvsplats_depth_is_the_distance_along_the_ray(cameras) -> None:
    rays = Rays.of(cameras, RAYS_LIKE)
    placed = points(DEPTHS, drawn(VIEWS, 2, *SIZE, seed=2), rays, MVSPLAT)
    distances = (placed - cameras.centres[:, None, None]).norm(dim=-1)
    torch.testing.assert_close(distances, DEPTHS)


def test_sizes_are_a_tenth_to_three_pixels_at_the_gaussians_depth(cameras) -> None:
    rays = Rays.of(cameras, RAYS_LIKE)
    raw = drawn(VIEWS, 7 + 4, *SIZE, seed=3)
    raw[:, 0], raw[:, 1], raw[:, 2] = -40.0, 0.0, 40.0
    scales = semantic_appearance(raw, DEPTHS, rays).scales.unflatten(1, SIZE)
    pixel = (1 / cameras.focal_px).sum(-1)[:, None, None] * DEPTHS
    for axis, share in enumerate((0.05, 0.775, 1.5)):
        torch.testing.assert_close(scales[..., axis], share * pixel)


def test_axes_are_the_networks_x_y_z_w_turned_by_the_camera(cameras) -> None:
    rays = Rays.of(cameras, RAYS_LIKE)
    raw = drawn(VIEWS, 7 + 3 * 4, *SIZE, seed=4)
    for look in (
        colour_appearance(raw, None, DEPTHS, rays, OURS),
        semantic_appearance(raw[:, :11], DEPTHS, rays),
    ):
        found = covariance(look.quaternions, look.scales).unflatten(1, SIZE)
        x, y, z, w = raw[:, 3:7].unbind(1)
        own = matrix_from_quaternion(torch.stack((w, x, y, z), dim=-1))
        axes = cameras.world_from_camera[:, None, None, :3, :3] @ own
        sizes = look.scales.unflatten(1, SIZE)
        torch.testing.assert_close(found, axes @ torch.diag_embed(sizes**2) @ axes.mT)


def test_a_gaussian_has_the_colour_in_the_world_that_it_has_before_its_camera(cameras) -> None:
    rays = Rays.of(cameras, RAYS_LIKE)
    raw = drawn(VIEWS, 7 + 3 * 9, *SIZE, seed=5)
    harmonics = colour_appearance(raw, None, DEPTHS, rays, OURS).features.unflatten(1, SIZE)
    damping = torch.tensor([1.0] + [0.1 / 4] * 3 + [0.1 / 16] * 5, dtype=torch.float64)
    inside = raw[:, 7:].unflatten(1, (3, 9)) * damping[:, None, None]
    directions = torch.nn.functional.normalize(drawn(5, 3, seed=6), dim=-1)
    for view in range(VIEWS):
        before = torch.einsum("dk,ckhw->hwdc", basis(directions, 2), inside[view])
        world = directions @ cameras.world_from_camera[view, :3, :3].mT
        torch.testing.assert_close(torch.einsum("dk,hwkc->hwdc", basis(world, 2), harmonics[view]), before)


def test_mvsplats_harmonics_are_read_in_its_own_basis(cameras) -> None:
    rays = Rays.of(cameras, RAYS_LIKE)
    raw = drawn(VIEWS, 7 + 3 * 4, *SIZE, seed=7)
    theirs = colour_appearance(raw, None, DEPTHS, rays, MVSPLAT).features.unflatten(1, SIZE)
    # Its renderer's linear harmonics are (z, x, y) of a direction, up to a factor: the cyclic order after e3nn's half-turn.
    inside = raw[:, 7:].unflatten(1, (3, 4))[:, :, 1:] * 0.1 / 4
    directions = torch.nn.functional.normalize(drawn(5, 3, seed=8), dim=-1)
    factor = (3 / (4 * torch.pi)) ** 0.5
    for view in range(VIEWS):
        turn = cameras.world_from_camera[view, :3, :3]
        # e3nn's degree 1 is a vector: the coefficients of a camera's frame turn as one.
        vectors = torch.einsum("ij,cjhw->cihw", turn, inside[view])
        x, y, z = directions.roll(1, dims=-1).unbind(-1)
        read = factor * torch.stack((-y, z, -x), dim=-1)
        expected = torch.einsum("di,cihw->hwdc", read, vectors)
        constant = 0.28209479177387814 * raw[view, 7:].unflatten(0, (3, 4))[:, 0]
        found = torch.einsum("dk,hwkc->hwdc", basis(directions, 1), theirs[view])
        torch.testing.assert_close(found, expected + constant.permute(1, 2, 0)[:, :, None])


def test_classes_are_a_distribution_at_each_pixel(cameras) -> None:
    rays = Rays.of(cameras, RAYS_LIKE)
    raw = drawn(VIEWS, 7 + 4, *SIZE, seed=10)
    classes = semantic_appearance(raw, DEPTHS, rays).features.unflatten(1, SIZE)
    logits = raw[:, 7:].permute(0, 2, 3, 1)
    torch.testing.assert_close(classes, logits.exp() / logits.exp().sum(-1, keepdim=True))

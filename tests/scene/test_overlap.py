"""Gaussians that more than two input views see are smaller: by hand, and against a loop over Gaussians and cameras."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from golden import fill_golden
from networks import preset
from posed import posed_cameras, posed_views

from semgs.data.views import Views, stack
from semgs.geometry.cameras import Cameras, project
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.model.gaussians.heads import RawGaussians
from semgs.model.gaussians.placing import Placer
from semgs.model.layers.network_input import Chunks, NetworkInput
from semgs.model.semgs import SemGS
from semgs.model.settings import OURS, Conventions
from semgs.scene.encoding import Encoding
from semgs.scene.overlap import Others, seen_by, shrinkage

SIZE = (29, 37)
TURN = matrix_from_quaternion(torch.tensor([0.3, -0.7, 0.2, 0.5], dtype=torch.float64))


def side_by_side(world: list[float], dtype: torch.dtype = torch.float64) -> Views:
    """Three cameras one metre apart that look the same way; a point 5 m away moves by 2 px from each to the next."""
    poses = torch.eye(4, dtype=torch.float64).repeat(3, 1, 1)
    poses[:, :3, :3] = TURN
    poses[:, :3, 3] = torch.tensor(world, dtype=torch.float64) + torch.arange(3)[:, None] * TURN[:, 0]
    k = torch.tensor([[10.0, 0, 9], [0, 12, 5], [0, 0, 1]], dtype=torch.float64).expand(3, 3, 3)
    bounds = torch.tensor([0.5, 10.0], dtype=torch.float64).expand(3, 2)
    return Views(torch.zeros(3, 3, 8, 20, dtype=dtype), Cameras(poses, k, (8, 20)), bounds)


def wall(scene: NetworkInput, views: Views, shrink_seen: float) -> Encoding:
    """Gaussians on a wall 5 m before the cameras, with raw sizes of 0."""
    depths = torch.full_like(scene.small[:, 0], 5.0)
    raw = torch.zeros_like(depths)[:, None].expand(-1, 7 + 3, -1, -1) + 0.1
    decoded = RawGaussians(depths, depths / 10, raw, depths / 10, depths / 10)
    placer = Placer(1, False, OURS, shrink_seen)
    rays = placer.rays(scene, views.size, depths)
    return placer(decoded, raw, scene.small, rays, scene.depth_range.flatten(0, 1), views.size)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("world", [[0.7, -2.0, 1.5], [4e6, -3e6, 2e6]], ids=["near the origin", "far from the origin"])
def test_a_gaussian_seen_by_two_keeps_its_size_and_one_seen_by_three_has_the_root_of_two_thirds(world, dtype):
    views = side_by_side(world, dtype)
    scene = NetworkInput.of(views, views.images, 1)
    plain, shrunk = wall(scene, views, 0.0).gaussians, wall(scene, views, 0.5).gaussians
    found = (shrunk.colour.scales / plain.colour.scales).unflatten(1, views.size)
    # By the columns of each view: column c of the first is c - 2 in the second and c - 4 in the third, of 20.
    three = (2 / 3) ** 0.5
    columns = torch.tensor([[1.0] * 4 + [three] * 16, [1.0] * 2 + [three] * 16 + [1.0] * 2, [three] * 16 + [1.0] * 4])
    expected = columns[:, None, :, None].expand_as(found).to(found)
    torch.testing.assert_close(found, expected)
    assert torch.equal(shrunk.semantic.scales, plain.semantic.scales)


def test_the_factor_by_hand():
    factors = shrinkage(torch.tensor([1.0, 2.0, 4.0, 8.0]), 0.5)
    torch.testing.assert_close(factors, torch.tensor([1.0, 1.0, 0.5**0.5, 0.5]))


def test_a_point_behind_a_camera_is_not_seen_by_it():
    poses = torch.eye(4, dtype=torch.float64).repeat(1, 2, 1, 1)
    poses[0, 1, :3, :3] = torch.diag(torch.tensor([-1.0, 1, -1]))  # looks back
    k = torch.tensor([[10.0, 0, 9], [0, 12, 5], [0, 0, 1]], dtype=torch.float64).expand(1, 2, 3, 3)
    others = Others.of(Cameras(poses, k, (8, 20)), (8, 20), poses)
    # On the optical axis of both, before the first and behind the second; and the other way round.
    points = torch.tensor([0.0, 0, 3], dtype=torch.float64).expand(2, 1, 1, 3)
    assert seen_by(points, others).flatten().tolist() == [1, 1]
    assert seen_by(-points, others).flatten().tolist() == [2, 2]


def scattered(seed: int, dtype: torch.dtype) -> Views:
    """Views far enough apart that some Gaussians are seen by one, some by two, some by all; the last one looks back."""
    views = posed_views(4, SIZE, seed, dtype)
    cameras = posed_cameras(4, SIZE, seed, spread=0.5)
    poses = cameras.world_from_camera.clone()
    poses[-1, :3, :3] = poses[-1, :3, :3] @ torch.diag(torch.tensor([-1.0, 1, -1], dtype=torch.float64))
    poses[-1, :3, 3] += 3 * cameras.world_from_camera[0, :3, 2]
    return replace(views, cameras=Cameras(poses, cameras.intrinsics, SIZE))


def counted_slowly(encoding: Encoding, views: Views) -> torch.Tensor:
    """For each Gaussian of a scene, the cameras that have its mean in their picture, and its own."""
    means, count = encoding.gaussians.means, len(views)
    each = len(means) // count
    found = []
    for index, mean in enumerate(means.double()):
        seen = 0
        for other in range(count):
            x, y, z = project(mean[None], views.cameras[other])[0].tolist()
            inside = z > 0 and 0 <= x < SIZE[1] and 0 <= y < SIZE[0]
            seen += other == index // each or inside
        found.append(seen)
    return torch.tensor(found, dtype=torch.float64)


def switched_off(model: SemGS, views: Views) -> Encoding:
    placer, model.placer = model.placer, replace(model.placer, shrink_seen=0.0)
    try:
        return model(views)
    finally:
        model.placer = placer


@pytest.fixture(scope="module")
def small() -> SemGS:
    return fill_golden(preset("small_plain")).double()


@pytest.mark.long
@pytest.mark.parametrize("conventions", [OURS, replace(OURS, z_depth=False)], ids=["z-depth", "distance"])
def test_sizes_follow_the_views_that_a_loop_counts_in_every_scene_of_a_batch(small: SemGS, conventions: Conventions):
    scenes = [scattered(1, torch.float64), scattered(5, torch.float64)]
    placer, small.placer = small.placer, replace(small.placer, conventions=conventions)
    with torch.inference_mode():
        plain, found = switched_off(small, stack(scenes)), small(stack(scenes))
        parts = small(stack(scenes), Chunks(heads=3))
    small.placer = placer
    for index, views in enumerate(scenes):
        seen = counted_slowly(plain.map(lambda tensor, at=index: tensor[at]), views)
        assert set(seen.tolist()) >= {1, 2, 3}
        expected = plain.gaussians.colour.scales[index] * (2 / seen.clamp(min=2))[:, None].sqrt()
        torch.testing.assert_close(found.gaussians.colour.scales[index], expected)
    torch.testing.assert_close(parts.gaussians.colour.scales, found.gaussians.colour.scales)
    for one, other in (
        (found.gaussians.means, plain.gaussians.means),
        (found.gaussians.opacities, plain.gaussians.opacities),
        (found.gaussians.colour.features, plain.gaussians.colour.features),
        (found.gaussians.semantic.scales, plain.gaussians.semantic.scales),
        (found.gaussians.semantic.features, plain.gaussians.semantic.features),
    ):
        assert torch.equal(one, other)


def test_two_views_have_the_sizes_that_the_head_says(small: SemGS):
    views = posed_views(2, SIZE, dtype=torch.float64)
    with torch.inference_mode():
        plain, found = switched_off(small, views), small(views)
    assert torch.equal(found.gaussians.colour.scales, plain.gaussians.colour.scales)


def test_the_rule_is_on_in_small_networks_alone():
    exponents = [preset(name).placer.shrink_seen for name in ("small", "small_plain", "base", "mvsplat")]
    assert exponents == [0.5, 0.5, 0.0, 0.0]

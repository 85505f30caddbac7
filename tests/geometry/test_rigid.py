from __future__ import annotations

import torch
from posed import posed_cameras

from semgs.geometry.gaussians import Appearance, Gaussians, move_cameras, move_gaussians
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.rendering.render import render


def motion(*quaternion: float) -> torch.Tensor:
    moved = torch.eye(4, dtype=torch.float64)
    moved[:3, :3] = matrix_from_quaternion(torch.tensor(quaternion, dtype=torch.float64))
    moved[:3, 3] = torch.tensor([3.0, -1.0, 0.5])
    return moved


def some_gaussians() -> Gaussians:
    draw = torch.Generator().manual_seed(3)

    def shape(features: torch.Tensor) -> Appearance:
        quaternions = torch.nn.functional.normalize(torch.randn(40, 4, generator=draw), dim=-1)
        return Appearance(quaternions, 0.05 + 0.2 * torch.rand(40, 3, generator=draw), features)

    centre = posed_cameras(1, (9, 12)).world_from_camera[0]
    means = (centre[:3, 3] + 3 * centre[:3, 2]).float() + torch.randn(40, 3, generator=draw)
    colours = 0.3 * torch.randn(40, 16, 3, generator=draw)
    return Gaussians(means, torch.rand(40, generator=draw), shape(colours), shape(torch.rand(40, 5, generator=draw)))


def test_a_moved_scene_looks_the_same_from_moved_cameras() -> None:
    gaussians, cameras, moved = some_gaussians(), posed_cameras(2, (18, 24)), motion(0.3, -0.8, 0.5, 0.1)
    here = render(gaussians, cameras, near=0.1)
    there = render(move_gaussians(moved, gaussians), move_cameras(moved, cameras), near=0.1)
    assert here.alphas.max() > 0.5
    assert torch.allclose(here.images, there.images, atol=2e-4)
    assert here.semantics is not None
    assert there.semantics is not None
    assert torch.allclose(here.semantics, there.semantics, atol=2e-4)
    assert torch.allclose(here.depths, there.depths, atol=2e-3)


def test_a_quarter_turn_about_z_takes_x_to_y() -> None:
    gaussians = some_gaussians()
    moved = move_gaussians(motion(2**-0.5, 0, 0, 2**-0.5), gaussians)
    x, y, z = gaussians.means.unbind(-1)
    assert torch.allclose(moved.means, torch.stack((3 - y, x - 1, z + 0.5), -1), atol=1e-6)
    # Y_1,-1 goes with y, Y_1,1 with x: what was red towards x is red towards y.
    before, after = gaussians.colour.features, moved.colour.features
    assert torch.allclose(after[:, 1], before[:, 3], atol=1e-6)
    assert torch.allclose(after[:, 2], before[:, 2], atol=1e-6)
    assert torch.allclose(after[:, 3], -before[:, 1], atol=1e-6)
    assert moved.colour.scales is gaussians.colour.scales


def test_a_scaled_scene_has_all_lengths_scaled_before_it_is_moved() -> None:
    gaussians, moved = some_gaussians(), motion(0.3, -0.8, 0.5, 0.1)
    larger = move_gaussians(moved, gaussians, scale=4.0)
    expected = 4 * gaussians.means.double() @ moved[:3, :3].T + moved[:3, 3]
    torch.testing.assert_close(larger.means, expected.float())
    assert gaussians.semantic is not None
    assert larger.semantic is not None
    assert torch.equal(larger.colour.scales, 4 * gaussians.colour.scales)
    assert torch.equal(larger.semantic.scales, 4 * gaussians.semantic.scales)
    assert torch.equal(larger.colour.features, move_gaussians(moved, gaussians).colour.features)

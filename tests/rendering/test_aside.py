"""What a Gaussian beside the optical axis shows: z for depth, and the colour of the direction in which it is seen."""

from __future__ import annotations

import torch
from posed import posed_cameras

from semgs.geometry.cameras import project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering.render import render

SIZE = (20, 35)


def one_aside(harmonics: torch.Tensor):
    """A Gaussian [k 3] far right of and below the axis at z = 2, its cameras, and the pixel that it covers."""
    cameras = posed_cameras(1, SIZE)
    inside = torch.tensor([[0.5, 0.3, 2.0]], dtype=torch.float64)
    pose = cameras.world_from_camera[0]
    means = inside @ pose[:3, :3].mT + pose[:3, 3]
    look = Appearance(
        torch.tensor([[1.0, 0, 0, 0]], dtype=torch.float64),
        torch.full((1, 3), 0.1, dtype=torch.float64),
        harmonics[None],
    )
    x, y, _ = project(means, cameras[0])[0].tolist()
    assert SIZE[1] / 2 < x < SIZE[1]
    assert SIZE[0] / 2 < y < SIZE[0]
    gaussians = Gaussians(means, torch.tensor([0.9], dtype=torch.float64), look)
    return gaussians, cameras, (int(y), int(x))


def test_rendered_depth_is_z_not_a_distance() -> None:
    gaussians, cameras, (row, column) = one_aside(torch.zeros(1, 3, dtype=torch.float64))
    depths = render(gaussians, cameras, backend="reference").depths
    torch.testing.assert_close(depths[0, row, column], torch.tensor(2.0, dtype=torch.float64))


def test_colour_is_that_of_the_direction_from_the_camera_to_the_gaussian() -> None:
    harmonics = torch.zeros(4, 3, dtype=torch.float64)
    harmonics[1:] = torch.diag(torch.tensor([0.4, 0.5, 0.6], dtype=torch.float64))
    gaussians, cameras, (row, column) = one_aside(harmonics)
    rendering = render(gaussians, cameras, backend="reference")
    x, y, z = torch.nn.functional.normalize(gaussians.means[0] - cameras.centres[0], dim=0).tolist()
    factor = (3 / (4 * torch.pi)) ** 0.5
    expected = torch.tensor([0.5 - 0.4 * factor * y, 0.5 + 0.5 * factor * z, 0.5 - 0.6 * factor * x]).double()
    found = rendering.images[0, :, row, column] / rendering.alphas[0, row, column]
    torch.testing.assert_close(found, expected)

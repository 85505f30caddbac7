"""Other classes for the Gaussians of an encoding."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from semgs.data.tables.classes import ClassTable
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering.temperatures import Temperatures
from semgs.scene.encoding import Encoding

TABLE = ClassTable("three", ("wall", "mug", "socket"), ((1, 2, 3), (4, 5, 6), (7, 8, 9)), (0, 1, 2))


def encoding(stride: int, classes: int | None, size: tuple[int, int] = (3, 5)) -> Encoding:
    """Two views; a Gaussian for each block of pixels, its means counting them."""
    rows, columns = (-(-side // stride) for side in size)
    count = 2 * rows * columns
    quaternions = torch.tensor([1.0, 0, 0, 0]).expand(count, 4)
    colour = Appearance(quaternions, torch.full((count, 3), 0.1), torch.zeros(count, 1, 3))
    own = None if classes is None else Appearance(quaternions, torch.full((count, 3), 0.3), torch.rand(count, classes))
    gaussians = Gaussians(torch.arange(3.0 * count).view(count, 3), torch.full((count,), 0.5), colour, own)
    maps = torch.ones(2, *size)
    return Encoding(gaussians, maps, maps, maps, torch.tensor([[0.5, 5.0]] * 2), stride=stride)


def test_each_gaussian_takes_the_mean_of_its_pixels_and_those_at_the_border_of_what_is_there():
    """Blocks of 2x2 of 3x5 pixels: the last column of Gaussians has 2 pixels, the last row 2, and their corner 1."""
    maps = torch.zeros(2, 3, 3, 5)
    maps[:, 0] = 1
    maps[1, :, 0, 0] = torch.tensor([0.0, 1, 0])
    maps[1, :, 0, 4] = torch.tensor([0.0, 0, 1])
    maps[1, :, 2, 4] = torch.tensor([0.0, 0.5, 0.5])
    before = replace(encoding(2, 20), temperatures=Temperatures(0.8, 1.1))
    after = before.with_classes(maps, TABLE)
    features = after.gaussians.semantic.features.view(2, 2, 3, 3)
    assert (features[0] == torch.tensor([1.0, 0, 0])).all()
    torch.testing.assert_close(features[1, 0, 0], torch.tensor([0.75, 0.25, 0]))
    torch.testing.assert_close(features[1, 0, 2], torch.tensor([0.5, 0, 0.5]))
    torch.testing.assert_close(features[1, 1, 2], torch.tensor([0, 0.5, 0.5]))
    assert after.classes is TABLE
    assert after.temperatures is None
    assert after.gaussians.semantic.scales is before.gaussians.semantic.scales
    assert after.gaussians.means is before.gaussians.means


def test_without_a_semantic_branch_they_take_the_shapes_of_colour():
    maps = torch.full((2, 3, 3, 5), 1 / 3)
    after = encoding(1, None).with_classes(maps, TABLE)
    assert after.gaussians.semantic.features.shape == (30, 3)
    assert after.gaussians.semantic.scales is after.gaussians.colour.scales


@pytest.mark.parametrize(
    ("maps", "message"),
    [
        (torch.full((2, 3, 3, 4), 1 / 3), r"are \(2, 3, 3, 4\); expected \(2, 3, 3, 5\)"),
        (torch.full((2, 4, 3, 5), 1 / 4), r"the 3 classes of three"),
        (torch.full((2, 3, 3, 5), 0.3), "do not sum to 1"),
        (torch.full((2, 3, 3, 5), torch.nan), "do not sum to 1"),
    ],
)
def test_maps_that_are_no_distributions_of_these_pixels_are_refused(maps, message):
    with pytest.raises(ValueError, match=message):
        encoding(1, 20).with_classes(maps, TABLE)

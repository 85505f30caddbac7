"""A camera looks down from 2 m, one Gaussian per pixel: what lies within 3 cm of the floor and continues it is floor."""

from __future__ import annotations

import pytest
import torch

from semgs.data.tables.classes import SCANNET20
from semgs.data.views import Views
from semgs.depth_maps.measured_floor import with_measured_floor
from semgs.geometry.cameras import Cameras, back_project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.scene.encoding import Encoding

SIZE = (20, 30)
FLOOR, CHAIR = SCANNET20.index("floor"), SCANNET20.index("chair")


def found(depths: torch.Tensor, labels: torch.Tensor, measured: torch.Tensor | None = None) -> torch.Tensor:
    """The likeliest class of each pixel [h w] afterwards."""
    cameras = Cameras(torch.eye(4)[None], torch.tensor([[[30.0, 0, 15], [0, 30, 10], [0, 0, 1]]]), SIZE)
    count = SIZE[0] * SIZE[1]
    quaternions, scales = torch.tensor([1.0, 0, 0, 0]).expand(count, 4), torch.full((count, 3), 0.01)
    distributions = 0.8 * torch.nn.functional.one_hot(labels.flatten(), 20) + 0.01
    gaussians = Gaussians(
        back_project(depths[None], cameras).reshape(-1, 3).float(),
        torch.ones(count),
        Appearance(quaternions, scales, torch.zeros(count, 1, 3)),
        Appearance(quaternions, scales, distributions),
    )
    maps, bounds = torch.ones(1, *SIZE), torch.tensor([[0.5, 9.0]])
    sensor = depths if measured is None else torch.where(measured, depths, 0.0)
    views = Views(torch.zeros(1, 3, *SIZE), cameras, bounds, depths=sensor[None])
    encoding = Encoding(gaussians, depths[None], maps, 0.01 * maps, bounds, classes=SCANNET20)
    after = with_measured_floor(encoding, views).gaussians.semantic
    assert after is not None
    torch.testing.assert_close(after.features.sum(-1), torch.full((count,), 1.0))
    return after.features.argmax(-1).reshape(SIZE)


def floor_with_chair(columns: slice) -> torch.Tensor:
    labels = torch.full(SIZE, FLOOR)
    labels[:, columns] = CHAIR
    return labels


@pytest.mark.parametrize(("above", "expected"), [(0.0, FLOOR), (0.02, FLOOR), (0.05, CHAIR)])
def test_what_is_within_3_cm_of_the_floor_is_floor(above: float, expected: int):
    depths = torch.full(SIZE, 2.0)
    depths[:, 20:26] -= above
    after = found(depths, floor_with_chair(slice(20, 26)))
    assert (after[:, 21:25] == expected).all()  # at the steps, normals are not level
    assert (after[:, :19] == FLOOR).all()


def test_what_was_not_measured_keeps_its_class():
    measured = torch.ones(SIZE, dtype=torch.bool)
    measured[:10, 20:26] = False
    after = found(torch.full(SIZE, 2.0), floor_with_chair(slice(20, 26)), measured)
    assert (after[:10, 20:26] == CHAIR).all()
    assert (after[10:, 20:26] == FLOOR).all()


def test_a_bed_of_which_a_little_is_called_floor_stays_a_bed():
    """A quarter of the only level piece has the class floor."""
    labels = floor_with_chair(slice(8, 30))
    assert (found(torch.full(SIZE, 2.0), labels) == labels).all()


@pytest.mark.parametrize(("columns", "expected"), [(1, FLOOR), (3, CHAIR)])
def test_a_level_with_a_twentieth_of_everything_below_it_is_a_table(columns: int, expected: int):
    """1 or 3 of 30 columns, 3 or 10 %, are 0.5 m lower."""
    depths = torch.full(SIZE, 2.0)
    depths[:, :columns] += 0.5
    after = found(depths, floor_with_chair(slice(20, 26)))
    assert (after[:, 21:25] == expected).all()


def test_without_a_floor_nothing_changes():
    """5 of 600 pixels are less than a hundredth."""
    labels = torch.full(SIZE, CHAIR)
    labels[0, :5] = FLOOR
    assert (found(torch.full(SIZE, 2.0), labels) == labels).all()

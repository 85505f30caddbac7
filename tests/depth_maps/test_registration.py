"""Whether depth maps lie on their images: a bright box before a dark wall."""

from __future__ import annotations

import pytest
import torch

from semgs.depth_maps.sensor_depth import Registration, registration

SIZE = (120, 160)


def box(right: int = 0, down: int = 0) -> torch.Tensor:
    """Where the box is, moved by some pixels: 60 wide and 50 high, upper left corner at row 40 and column 50."""
    inside = torch.zeros(2, *SIZE, dtype=torch.bool)
    inside[:, 40 + down : 90 + down, 50 + right : 110 + right] = True
    return inside


def images() -> torch.Tensor:
    """The box at 0.7, the wall at 0.3, and faint stripes that are no edges of depth."""
    stripes = 0.02 * torch.sin(torch.arange(SIZE[1]) / 3.0)
    return (torch.where(box(), 0.7, 0.3) + stripes)[:, None].expand(-1, 3, -1, -1)


def depths(right: int = 0, down: int = 0) -> torch.Tensor:
    return torch.where(box(right, down), 1.5, 2.0)


def test_registered_depth_is_not_shifted():
    assert not registration(images(), depths()).shifted


@pytest.mark.parametrize(("right", "down"), [(10, 0), (-8, 12), (0, -12)])
def test_shifted_depth_is_found_to_within_half_a_window(right: int, down: int):
    found = registration(images(), depths(right, down))
    assert found.shifted
    assert abs(found.right - right) <= 4
    assert abs(found.down - down) <= 4


@pytest.mark.parametrize(
    ("found", "shifted"),
    [
        (Registration(14, 0, 1.3, 5000), True),
        (Registration(0, -16, 1.3, 5000), False),  # the largest that is tried: the best may lie further away
        (Registration(2, -2, 1.3, 5000), False),
        (Registration(14, 0, 1.1, 5000), False),
        (Registration(14, 0, 1.3, 900), False),
    ],
)
def test_only_clear_shifts_count(found: Registration, shifted: bool):
    assert found.shifted == shifted


def test_holes_along_the_edges_change_nothing():
    """Nothing measured within two pixels of the box's outline, as behind real sensors."""
    holey = depths(10, 0)
    outline = torch.nn.functional.max_pool2d(box(10).float(), 5, 1, 2) != -torch.nn.functional.max_pool2d(
        -box(10).float(), 5, 1, 2
    )
    holey[outline] = 0
    assert registration(images(), holey).shifted
    assert abs(registration(images(), holey).right - 10) <= 4
    holey = depths()
    holey[outline.roll(-10, -1)] = 0
    assert not registration(images(), holey).shifted


def test_a_bare_wall_says_nothing():
    found = registration(images(), torch.full((2, *SIZE), 2.0))
    assert (found.pixels, found.gain, found.shifted) == (0, 1.0, False)
    assert registration(images(), torch.zeros(2, *SIZE)).pixels == 0


def test_images_smaller_than_the_largest_shift_say_nothing():
    assert not registration(images()[..., :30, :40], depths()[..., :30, :40]).shifted

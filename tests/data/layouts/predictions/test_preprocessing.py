"""Where a photo is in its processed image: numbers worked out by hand from each tool's steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from semgs.data.layouts.predictions.preprocessing import (
    Placement,
    Plan,
    depth_anything,
    dust3r,
    map_anything,
    vggt,
)

WIDE, UPRIGHT = (100, 140), (140, 100)
"""(height, width) of photos."""


def plan(tool: Callable, sizes: list, processed: tuple[int, int], padded: bool = False) -> Plan | None:
    """The first plan that gives the processed size, None if there is none."""
    return next((one for one in tool(sizes, processed, padded) if one.size == processed), None)


@pytest.mark.parametrize(
    ("tool", "photo", "processed", "padded", "scale", "shift"),
    [
        # 4032 -> 504 is an eighth; 3024 / 8 = 378 = 27 * 14.
        (depth_anything, (3024, 4032), (378, 504), False, (1 / 8, 1 / 8), (0, 0)),
        # 1080 * 504 / 1920 = 283.5, which becomes 284 and then the nearest multiple of 14, 280: x and y differ.
        (depth_anything, (1080, 1920), (280, 504), False, (0.2625, 280 / 1080), (0, 0)),
        # 504 x 360, and 360 is nearer to 364 than to 350.
        (depth_anything, WIDE, (364, 504), False, (3.6, 3.64), (0, 0)),
        # upper_bound_crop: 350 of the 360 rows, 5 fewer at the top.
        (depth_anything, WIDE, (350, 504), False, (3.6, 3.6), (0, -5)),
        # process_res = 252: half of the first.
        (depth_anything, (3024, 4032), (196, 252), False, (252 / 4032, 196 / 3024), (0, 0)),
        # lower_bound_resize: the shorter side becomes 504; 140 * 5.04 = 705.6 -> 706 -> 700.
        (depth_anything, WIDE, (504, 700), False, (5.0, 5.04), (0, 0)),
        # 518 wide; 100 * 3.7 / 14 = 26.4 -> 26 * 14 = 364.
        (vggt, WIDE, (364, 518), False, (3.7, 3.64), (0, 0)),
        # 518 wide; 140 * 5.18 / 14 = 51.8 -> 728 rows, of which (728 - 518) / 2 = 105 are cut at the top.
        (vggt, UPRIGHT, (518, 518), False, (5.18, 5.2), (0, -105)),
        # pad: 518 high, 364 wide, (518 - 364) / 2 = 77 white columns on the left.
        (vggt, UPRIGHT, (518, 518), True, (3.64, 3.7), (77, 0)),
        # pad of a wide photo: 77 white rows at the top.
        (vggt, WIDE, (518, 518), True, (3.7, 3.64), (0, 77)),
        # 1.4 is nearer to 1.321 than to 1.542: 518 x 392. Scale 3.92, 548 x 392, (548 - 518) / 2 = 15 columns are cut.
        (map_anything, WIDE, (392, 518), False, (548 / 140, 3.92), (-15, 0)),
        (map_anything, UPRIGHT, (518, 392), False, (3.92, 548 / 140), (0, -15)),
        # 512 x 366, and 352 = 22 * 16 of the 366 rows, 7 fewer at the top.
        (dust3r, WIDE, (352, 512), False, (512 / 140, 3.66), (0, -7)),
        # A square becomes 4:3: rows 64 to 448 of 512.
        (dust3r, (100, 100), (384, 512), False, (5.12, 5.12), (0, -64)),
        # 224: 314 x 224, and 224 of the 314 columns, 45 fewer on the left.
        (dust3r, WIDE, (224, 224), False, (314 / 140, 2.24), (-45, 0)),
    ],
)
def test_a_photo_is_where_its_tool_puts_it(tool, photo, processed, padded, scale, shift):
    found = plan(tool, [photo], processed, padded)
    assert found is not None
    (placement,) = found.placements
    np.testing.assert_allclose(placement.scale, scale, rtol=1e-12)
    assert placement.shift == shift


def test_depth_anything_crops_photos_of_two_sizes_to_the_smaller_sides():
    """504x364 and 364x504 become 364x364: 70 pixels are cut on the left of one, and at the top of the other."""
    found = plan(depth_anything, [WIDE, UPRIGHT], (364, 364))
    assert [one.shift for one in found.placements] == [(-70, 0), (0, -70)]


def test_vggt_pads_photos_of_two_sizes_to_the_larger_sides():
    """518x364 gets 77 white rows at the top, as the other is 518 high."""
    found = plan(vggt, [WIDE, UPRIGHT], (518, 518))
    assert [one.shift for one in found.placements] == [(0, 77), (0, -105)]


@pytest.mark.parametrize("tool", [depth_anything, vggt, map_anything, dust3r])
def test_a_size_that_the_tool_does_not_make_of_a_photo_has_no_plan(tool):
    assert plan(tool, [WIDE], (336, 350)) is None


def test_the_camera_of_a_photo_undoes_scale_and_shift():
    """x of the processed image is 2 x - 15: focal 100 / 2, centre (41 + 15) / 2."""
    lens = Placement((60, 50), (2.0, 4.0), (-15.0, 3.0)).lens(np.array([[100.0, 0, 41], [0, 120, 103], [0, 0, 1]]))
    assert lens.size == (60, 50)
    assert lens.focal == (50.0, 30.0)
    assert lens.centre == (28.0, 25.0)

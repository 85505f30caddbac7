from __future__ import annotations

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest
import torch
from blocks import BLOCKS, room_of_blocks, turned

import semgs
from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.robotics.floor import NoFloorError, floor_height
from semgs.robotics.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy, closed, occupancy, passes, rays_of

SHAPE = (5, 4, 3)
"""Of a small grid."""


def at(found: Occupancy, x: float, y: float) -> int:
    """The cell at a position."""
    column, row = (
        int(np.floor((side - low) / found.resolution)) for side, low in zip((x, y), found.origin, strict=False)
    )
    return int(found.cells[row, column])


def voxel(found: Occupancy, x: float, y: float, z: float) -> tuple[int, int, int]:
    """The index of the voxel at a position."""
    column, row, layer = (
        int(np.floor((side - low) / found.resolution)) for side, low in zip((x, y, z), found.origin, strict=True)
    )
    return layer, row, column


@pytest.fixture(scope="module")
def found() -> Occupancy:
    scene = room_of_blocks()
    return occupancy(scene.gaussians, scene.cameras, stride=1)


def test_the_floor_is_free_the_wall_and_the_chair_are_occupied_and_their_shadows_are_unknown(found: Occupancy) -> None:
    assert found.floor == pytest.approx(0, abs=1e-6)
    assert found.resolution == 0.05
    assert at(found, 1.6, -0.1) == FREE
    assert at(found, 3.0, -0.1) == FREE  # between the chairs
    assert at(found, 2.03, 0.5) == OCCUPIED  # the front of the first chair
    assert at(found, 4.03, -0.1) == OCCUPIED  # the wall
    assert (
        at(found, 2.9, 0.75) == UNKNOWN
    )  # behind a chair: 0.78 m high and seen from 1.2 m, it hides 2.48 m / 1.2 m * 0.78 m behind it
    assert at(found, 0.3, 0.0) == UNKNOWN  # below the camera, out of its picture


def test_what_no_ray_reached_is_never_free(found: Occupancy) -> None:
    column = int((4.1 - found.origin[0]) / found.resolution)
    assert column < found.cells.shape[1]
    assert not (found.cells[:, column:] == FREE).any()  # behind the wall
    assert not (found.voxels[:, :, column:] == FREE).any()
    assert found.voxels[voxel(found, 2.25, 0.55, 0.4)] == UNKNOWN  # inside the chair


def test_voxels_know_their_class_and_have_one_only_if_they_are_occupied(found: Occupancy) -> None:
    layer, row, column = voxel(found, 2.03, 0.5, 0.4)
    assert found.voxels[layer, row, column] == OCCUPIED
    assert found.labels[layer, row, column] == SCANNET20.index("chair")
    assert (found.labels[found.voxels != OCCUPIED] == IGNORE).all()
    assert found.voxels[voxel(found, 1.5, 0.0, 0.5)] == FREE
    # From 0.1 m below the floor to 1.5 m above it: 32 layers of 5 cm.
    assert found.voxels.shape[0] == 32
    assert found.origin[2] == pytest.approx(-0.1, abs=1e-6)


def test_what_is_below_the_step_or_above_the_robot_is_no_obstacle() -> None:
    plate = ("table", (1.4, -0.4, 0.0), (1.8, 0.4, 0.08))
    scene = room_of_blocks((*BLOCKS[:2], plate))
    assert at(occupancy(scene.gaussians, scene.cameras, stride=1), 1.6, 0.0) != OCCUPIED
    assert at(occupancy(scene.gaussians, scene.cameras, stride=1, step=0.05), 1.6, 0.0) == OCCUPIED
    scene = room_of_blocks()
    low = occupancy(scene.gaussians, scene.cameras, stride=1, step=0.05, height=0.4)
    assert at(low, 2.03, 0.5) == OCCUPIED
    assert not (low.labels[low.voxels == OCCUPIED][:, None] == SCANNET20.index("floor")).all()


def test_a_world_that_lies_on_its_side_gives_the_same_plan_with_its_up(found: Occupancy) -> None:
    scene = room_of_blocks()
    side = torch.eye(4, dtype=torch.float64)
    side[:3, :3] = matrix_from_quaternion(torch.tensor([0.6, 0.5, -0.2, 0.3], dtype=torch.float64))
    moved = turned(scene, side)
    again = occupancy(moved.gaussians, moved.cameras, stride=1, up=side[:3, 2].tolist())
    assert again.floor == pytest.approx(0, abs=1e-5)
    for content, within in (
        (FREE, 0.08),
        (OCCUPIED, 0.2),
    ):  # the grid is turned about z, so a thin wall takes other cells
        assert (again.cells == content).sum() == pytest.approx((found.cells == content).sum(), rel=within)


def test_uncertain_depth_frees_less_and_gaussians_in_no_order_need_no_depths(found: Occupancy) -> None:
    scene = room_of_blocks()
    spread = torch.full_like(scene.depths, 0.5)
    less = occupancy(scene.gaussians, scene.cameras, stride=1, depth_spread=spread)
    assert (less.voxels == FREE).sum() < 0.6 * (found.voxels == FREE).sum()
    order = torch.randperm(len(scene.gaussians), generator=torch.Generator().manual_seed(1))[:-7]
    merged = scene.gaussians.map(lambda tensor: tensor[order])
    again = occupancy(merged, scene.cameras, depths=scene.depths)
    assert (again.cells != found.cells).mean() < 0.01
    # Rendered depths blend at edges, and a wall seen at a slant has other pixels.
    again = occupancy(merged, scene.cameras)
    assert again.cells.shape == found.cells.shape
    assert (again.cells != found.cells).mean() < 0.03
    for place, content in (
        ((1.6, -0.1), FREE),
        ((2.03, 0.5), OCCUPIED),
        ((4.03, -0.1), OCCUPIED),
        ((2.9, 0.75), UNKNOWN),
    ):
        assert at(again, *place) == content


def test_the_floor_is_the_fullest_level_of_its_class_and_without_classes_the_lowest_full_one() -> None:
    heights = np.concatenate(
        (np.full(300, 0.72), np.full(200, 0.03), np.full(10, -0.6))
    )  # a table, the floor, and noise
    weights, eyes = np.ones(510), np.array([1.2])
    assert floor_height(heights, weights, eyes) == pytest.approx(0.03)
    assert floor_height(heights, weights, eyes, heights < 0.5) == pytest.approx(0.03)
    with pytest.raises(NoFloorError, match="41% of the Gaussians are below what looks most like one"):
        floor_height(
            heights, weights, eyes, heights > 0.5
        )  # a table that has the class of a floor: 210 of 510 are below it
    assert floor_height(heights, np.where(heights < 0.5, 0.05, 1.0), eyes, heights > 0.5) == pytest.approx(0.72)
    with pytest.raises(NoFloorError, match="fewer than 1% of the Gaussians are below the cameras with the class floor"):
        floor_height(heights, weights, eyes, heights > 5)
    with pytest.raises(NoFloorError, match="below the cameras"):
        floor_height(heights + 2, weights, eyes)


def test_gaps_that_no_disc_fits_into_are_closed() -> None:
    blocked = np.zeros((9, 13), bool)
    blocked[:, [2, 6, 12]] = True  # gaps of three and of five cells
    assert closed(blocked, 4.0)[4].tolist() == [bool(n) for n in (0, 0, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 1)]
    np.testing.assert_array_equal(closed(blocked, 1.0), blocked)


def test_lengths_that_are_whole_numbers_of_cells_but_for_rounding_are_whole() -> None:
    """In floating point 0.28 / 0.04 is above 7 and 0.6 / 0.1 below 6. A disc of 6 cells is one of radius 3, which fits into no gap of five."""
    assert 0.28 / 0.04 > 7
    scene = room_of_blocks()
    found = occupancy(scene.gaussians, scene.cameras, stride=1, resolution=0.04, step=0.28, height=0.4)
    assert found.voxels.shape[0] == 7 + 10
    assert found.origin[2] == pytest.approx(-0.28, abs=1e-6)
    assert 0.6 / 0.1 < 6
    blocked = np.zeros((9, 13), bool)
    blocked[:, [2, 8]] = True
    assert closed(blocked, 0.6 / 0.1)[4].tolist() == [False] * 2 + [True] * 7 + [False] * 4


def test_a_scene_without_classes_and_the_public_name_work() -> None:
    scene = room_of_blocks(classes=False)
    plain = semgs.occupancy(scene.gaussians, scene.cameras, stride=1, resolution=0.1)
    assert at(plain, 1.6, -0.1) == FREE
    assert at(plain, 4.03, -0.1) == OCCUPIED
    assert (plain.labels == IGNORE).all()


def test_arguments_out_of_range_are_refused() -> None:
    scene = room_of_blocks()
    for options in ({"step": 2.0}, {"step": 0.0}, {"resolution": 0.0}, {"reach": -1.0}):
        with pytest.raises(ValueError, match="expected 0 < step < height"):
            occupancy(scene.gaussians, scene.cameras, stride=1, **options)
    for options in ({"height": inf}, {"resolution": inf}, {"narrowest": -0.1}, {"narrowest": nan}):
        with pytest.raises(ValueError, match="expected 0 < step < height, positive others, and narrowest 0 or more"):
            occupancy(scene.gaussians, scene.cameras, stride=1, **options)
    with pytest.raises(ValueError, match=r"leading axes \(\); expected those of the input views, \[v\]"):
        occupancy(scene.gaussians, scene.cameras[0], stride=1)
    with pytest.raises(ValueError, match="there are 9600 Gaussians for 2400 blocks of 2x2 pixels"):
        occupancy(scene.gaussians, scene.cameras, stride=2)
    with pytest.raises(ValueError, match="use a larger resolution"):
        occupancy(scene.gaussians, scene.cameras, stride=1, resolution=0.001)
    two = replace(SCANNET20, name="two", names=("a", "floor"), colours=((0, 0, 0),) * 2, raw_ids=(1, 2))
    with pytest.raises(ValueError, match="expected the 2 of table two"):
        occupancy(scene.gaussians, scene.cameras, stride=1, classes=two)


def test_gaussians_without_a_class_are_no_floor_and_voxels_of_them_have_no_label(found: Occupancy) -> None:
    """In this table the floor is the first class, which the arg max of equal probabilities is."""
    scene = room_of_blocks()
    gaussians, floor_first = scene.gaussians, ("floor", *(name for name in SCANNET20.names if name != "floor"))
    table = replace(SCANNET20, name="floor first", names=floor_first)
    shares = gaussians.semantic.features[:, [SCANNET20.index(name) for name in floor_first]]
    shares[gaussians.semantic.features.argmax(-1) == SCANNET20.index("chair")] = 1 / 20
    given = replace(gaussians, semantic=replace(gaussians.semantic, features=shares))
    plan = occupancy(given, scene.cameras, stride=1, classes=table)
    np.testing.assert_array_equal(plan.cells, found.cells)
    assert at(plan, 2.03, 0.5) == OCCUPIED  # the front of the first chair
    assert plan.labels[voxel(plan, 2.03, 0.5, 0.4)] == IGNORE
    assert plan.labels[voxel(plan, 4.03, -0.1, 0.5)] == floor_first.index("wall")


def test_views_that_know_no_depth_show_no_floor() -> None:
    scene = room_of_blocks()
    some = scene.gaussians.map(lambda tensor: tensor[:77])
    with pytest.raises(NoFloorError, match="the depth of every pixel of the input views is unknown"):
        occupancy(some, scene.cameras, depths=torch.zeros(len(scene.cameras.world_from_camera), *scene.cameras.size))


def test_rays_end_at_the_gaussians_without_their_footprints() -> None:
    """Without a stride, depth is rendered. Footprints, which are 1 m wide here, would fill the images."""
    scene = room_of_blocks()
    wide = replace(scene.gaussians, footprints=torch.ones(len(scene.gaussians)))
    plain, found = (rays_of(one, scene.cameras, np.eye(3), None, None) for one in (scene.gaussians, wide))
    assert len(plain.ends)
    assert np.array_equal(plain.ends, found.ends)


def passes_one_by_one(origins: np.ndarray, ends: np.ndarray, shape: tuple[int, int, int]) -> np.ndarray:
    """The slow twin: a ray passes through a voxel if the part of it between the voxel's six planes is longer than nothing."""
    counts = np.zeros(shape, np.int64)
    for start, end in zip(origins, ends, strict=True):
        for voxel in np.ndindex(shape):
            enters, leaves = 0.0, 1.0
            for axis, side in enumerate(voxel):
                along = end[axis] - start[axis]
                if along == 0:
                    inside = side <= start[axis] < side + 1
                    leaves = leaves if inside else -1.0
                else:
                    one, other = (side - start[axis]) / along, (side + 1 - start[axis]) / along
                    enters, leaves = max(enters, min(one, other)), min(leaves, max(one, other))
            counts[voxel] += enters < leaves
    return counts


def test_a_ray_visits_the_voxels_on_its_way() -> None:
    found = passes(np.array([[0.5, 0.5, 1.5]]), np.array([[2.5, 1.5, 1.5]]), SHAPE)
    # It rises 1 in 2: out of column 0 at x = 1, y = 0.75, and out of row 0 at x = 1.5.
    assert [tuple(place) for place in np.argwhere(found)] == [(0, 0, 1), (1, 0, 1), (1, 1, 1), (2, 1, 1)]
    assert found.max() == 1


def test_random_rays_visit_what_the_slow_twin_says() -> None:
    draw = np.random.default_rng(3)
    origins, ends = draw.uniform(-3, 8, (2, 300, 3))
    origins[:40], ends[:40] = draw.uniform(0, 3, (2, 40, 3))  # inside
    ends[20:60, 1] = origins[20:60, 1]  # along a plane
    ends[30:50, 2] = origins[30:50, 2]
    found = passes(origins, ends, SHAPE)
    np.testing.assert_array_equal(found, passes_one_by_one(origins, ends, SHAPE))
    assert found.sum() > 300


def test_rays_beside_the_grid_and_rays_without_length_visit_nothing() -> None:
    origins = np.array([[-1.0, 0.5, 0.5], [0.5, 0.5, 9.0], [1.5, 1.5, 1.5]])
    ends = np.array([[-1.0, 3.5, 2.5], [4.5, 0.5, 9.0], [1.5, 1.5, 1.5]])
    assert passes(origins, ends, SHAPE)[:, :, :].sum() == 1  # a ray without length is in its voxel
    assert passes(np.zeros((0, 3)), np.zeros((0, 3)), SHAPE).sum() == 0

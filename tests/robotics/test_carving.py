from __future__ import annotations

import numpy as np

from semgs.robotics.carving import passes

SHAPE = (5, 4, 3)


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

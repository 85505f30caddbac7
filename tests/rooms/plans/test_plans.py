import itertools

import numpy as np
import pytest

pytest.importorskip("embreex")

from semgs.data.raycast import Raycaster
from semgs_rooms.pieces.solids import BALL, BOX, CUSHION, CYLINDER, Solid, gather, triangulate
from semgs_rooms.plans.builder import Builder
from semgs_rooms.plans.home import SHARES, draw_home, open_door
from semgs_rooms.plans.outlines import PARTITION, around, overlap, rectangle, two_rooms


def test_furniture_neither_intersects_nor_leaves_the_room():
    kinds = set()
    for seed in range(60):
        plan = draw_home(np.random.default_rng(seed))
        kinds.add(plan.kind)
        for one, other in itertools.combinations(plan.footprints if seed < 8 else (), 2):
            assert not overlap(one, other)
        for corners in plan.footprints:
            assert (np.abs(corners) <= (plan.size[0] / 2 + 1e-9, plan.size[1] / 2 + 1e-9)).all()
        assert 2.3 <= plan.size[2] <= 3.2
    assert {part for kind in kinds for part in kind.split(" + ")} >= set(SHARES) - {"hallway"}
    assert any("+" in kind for kind in kinds)


def test_a_strip_of_a_wall_goes_round_its_holes():
    """Window and door of a wall 5 m long: what is left has the area of the strip less that of the holes in it, and no piece
    reaches into a hole."""
    holes = [(1.0, 2.0, 0.0, 2.1), (3.0, 4.0, 0.9, 2.0)]
    for low, high, area in ((0.0, 2.5, 5 * 2.5 - 2.1 - 1.1), (0.0, 0.1, 0.4), (0.0, 1.4, 5 * 1.4 - 1.4 - 0.5)):
        pieces = around(5.0, low, high, holes)
        assert sum((right - left) * (top - bottom) for left, right, bottom, top in pieces) == pytest.approx(area)
        for (a, b, c, d), (e, f, g, h) in itertools.product(pieces, holes):
            assert b <= e or f <= a or d <= g or h <= c


def test_rectangles_overlap_if_and_only_if_they_share_area():
    base = rectangle(0.3, -0.2, 2.0, 1.0, 0.4)
    along, across = np.array([np.cos(0.4), np.sin(0.4)]), np.array([-np.sin(0.4), np.cos(0.4)])

    def shifted(distance: np.ndarray) -> np.ndarray:
        x, y = np.array([0.3, -0.2]) + distance
        return rectangle(x, y, 2.0, 1.0, 0.4)

    assert overlap(base, shifted(1.99 * along))
    assert not overlap(base, shifted(2.01 * along))
    assert overlap(base, shifted(-0.99 * across))
    assert not overlap(base, shifted(-1.01 * across))
    # Their bounding boxes overlap, they do not.
    assert not overlap(rectangle(0.0, 0.0, 1.0, 1.0, 0.0), rectangle(1.45, 0.55, 1.0, 1.0, np.pi / 4))
    assert overlap(rectangle(0.0, 0.0, 1.0, 1.0, 0.0), rectangle(1.2, 0.2, 1.0, 1.0, np.pi / 4))


@pytest.mark.parametrize("shape", [BOX, CYLINDER, BALL, CUSHION])
def test_a_shape_is_closed_and_fills_its_size(shape):
    part = Solid(0, np.zeros(24), (1.0, -2.0, 0.5), (0.6, 0.4, 1.2), shape)
    corners, owners = triangulate(gather([part]))
    flat = corners.reshape(-1, 3)
    np.testing.assert_allclose(flat.max(0) - flat.min(0), part.size, rtol=0.03)
    np.testing.assert_allclose((flat.max(0) + flat.min(0)) / 2, part.centre, atol=0.02)
    assert (owners == 0).all()
    # Every edge of a closed surface belongs to two triangles.
    edges: dict[frozenset, int] = {}
    for triangle in np.round(corners, 9):
        for a, b in itertools.combinations(map(tuple, triangle), 2):
            edges[frozenset((a, b))] = edges.get(frozenset((a, b)), 0) + 1
    assert set(edges.values()) == {2}


def test_parts_are_tilted_about_their_own_x_axis_before_they_are_turned():
    rotation = gather([Solid(0, np.zeros(24), (0, 0, 0), (1, 1, 1), yaw=np.pi / 2, tilt=0.3)]).rotations[0]
    np.testing.assert_allclose(rotation @ (1, 0, 0), (0, 1, 0), atol=1e-12)
    np.testing.assert_allclose(rotation @ (0, 0, 1), (np.sin(0.3), 0, np.cos(0.3)), atol=1e-12)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)


def test_two_rooms_are_joined_by_an_opening_that_one_can_see_through():
    """A ray through the middle of the opening, at shoulder height, goes from one room into the other; one beside it does not."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        outline = two_rooms(rng, ("living", "dining"), (7.0, 3.5, 2.5))
        builder = Builder(rng, outline)
        open_door(builder, outline)
        for zone in outline.zones:
            builder.shell(zone, wet=False)
        corners, _ = triangulate(gather(builder.parts))
        caster = Raycaster(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        wall, middle = outline.passage[0]
        x, y = wall.at(middle)
        starts = np.array([[x - 0.4, y, 1.4], [x - 0.4, y - middle + 0.05, 1.4]])
        _, distances = caster.cast(starts, np.broadcast_to([1.0, 0.0, 0.0], (2, 3)))
        assert distances[0] > 0.4 + PARTITION + 0.5
        assert distances[1] < 0.4 + 0.01

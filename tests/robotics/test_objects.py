from __future__ import annotations

from dataclasses import replace
from math import degrees

import numpy as np
import pytest
import torch
from blocks import room_of_blocks

import semgs
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.robotics.objects import SURE, objects

pytest.importorskip("sklearn")
pytest.importorskip("trimesh")

CHAIR, WALL, TABLE = (SCANNET20.index(name) for name in ("chair", "wall", "table"))


def gaussians_at(points: np.ndarray, labels: np.ndarray, share: float = 0.8) -> Gaussians:
    """Opaque Gaussians at points, each with a likeliest class."""
    features = torch.full((len(points), 20), (1 - share) / 19)
    features[torch.arange(len(points)), torch.from_numpy(labels)] = share
    shape = Appearance(
        torch.tensor([1.0, 0, 0, 0]).expand(len(points), 4), torch.full((len(points), 3), 0.01), features
    )
    colour = replace(shape, features=torch.zeros(len(points), 1, 3))
    return Gaussians(torch.from_numpy(points).float(), torch.full((len(points),), 0.8), colour, shape)


def plank(yaw: float, middle: tuple[float, float, float]) -> np.ndarray:
    """A lattice of 21 x 11 x 5 points, 1 m x 0.4 m x 0.2 m, turned about z [degrees]."""
    axes = [np.linspace(-side / 2, side / 2, count) for side, count in ((1.0, 21), (0.4, 11), (0.2, 5))]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    a = np.radians(yaw)
    return points @ np.array([[np.cos(a), np.sin(a), 0], [-np.sin(a), np.cos(a), 0], [0, 0, 1]]) + middle


def test_two_chairs_are_two_things_and_walls_are_none() -> None:
    near, far = plank(30.0, (2.0, 0.0, 0.5)), plank(-20.0, (2.0, 1.5, 0.5))[:600]
    wall = plank(90.0, (4.0, 0.0, 1.0))
    points = np.concatenate((wall, far, near))
    labels = np.repeat([WALL, CHAIR, CHAIR], [len(wall), len(far), len(near)])
    found = objects(gaussians_at(points, labels))
    first, second = found.things
    assert (first.instance, first.name, first.count) == (1, "chair", 1155)
    assert (second.instance, second.name, second.count) == (2, "chair", 600)
    assert first.box.size == pytest.approx((1.0, 0.4, 0.2), abs=1e-5)
    assert degrees(first.box.yaw) == pytest.approx(30.0, abs=1e-3)
    assert first.confidence == pytest.approx(0.8, abs=1e-6)
    np.testing.assert_array_equal(found.instances, np.repeat([0, 2, 1], [len(wall), len(far), len(near)]))


def test_the_distance_is_to_the_nearest_point_of_the_box() -> None:
    found = objects(gaussians_at(plank(0.0, (3.0, 0.0, 0.0)), np.full(1155, CHAIR)), seen_from=(0.5, 0.0, 0.0))
    assert found.things[0].distance == pytest.approx(3.0 - 0.5 - 0.5, abs=1e-5)


def test_boxes_turn_about_the_given_up_only() -> None:
    upright = plank(30.0, (2.0, 0.5, 0.5))
    lying = upright[:, [0, 2, 1]] * (1.0, -1.0, 1.0)  # y is down
    found = objects(gaussians_at(lying, np.full(1155, CHAIR)), up=(0.0, -1.0, 0.0)).things[0]
    assert found.box.size == pytest.approx((1.0, 0.4, 0.2), abs=1e-5)
    assert found.box.centre[2] == pytest.approx(0.5, abs=1e-5)


def test_small_transparent_and_thin_groups_are_no_things() -> None:
    few = gaussians_at(plank(0.0, (2.0, 0.0, 0.0))[:180], np.full(180, CHAIR))  # opacities sum to 144
    assert objects(few).things == ()
    assert len(objects(few, min_gaussians=140.0).things) == 1
    clear = gaussians_at(plank(0.0, (2.0, 0.0, 0.0)), np.full(1155, CHAIR))
    assert objects(replace(clear, opacities=clear.opacities / 10)).things == ()
    assert objects(clear, min_size=1.1).things == ()
    assert objects(clear, stuff=("chair",)).things == ()


def test_a_gap_splits_and_a_larger_gap_joins() -> None:
    points = np.concatenate((plank(0.0, (0.0, 0.0, 0.0)), plank(0.0, (1.15, 0.0, 0.0))))  # 15 cm between them
    gaussians = gaussians_at(points, np.full(2310, TABLE))
    assert [len(objects(gaussians, gap=gap).things) for gap in (0.1, 0.2)] == [2, 1]


def test_numbers_are_kept_by_a_selection() -> None:
    points = np.concatenate((plank(0.0, (0.0, 0.0, 0.0)), plank(0.0, (3.0, 0.0, 0.0))[:900]))
    found = objects(gaussians_at(points, np.repeat([CHAIR, TABLE], [1155, 900])))
    tables = found.only(classes=("table",))
    assert [thing.instance for thing in tables.things] == [2]
    np.testing.assert_array_equal(np.unique(tables.instances, return_counts=True), ([0, 2], [1155, 900]))
    assert found.only(min_confidence=0.9).things == ()


def test_things_of_a_scene_that_two_views_see_have_one_number() -> None:
    scene = room_of_blocks()
    found = semgs.objects(scene.gaussians, min_gaussians=40.0)
    assert [thing.name for thing in found.things] == ["chair", "chair"]
    half = len(found.instances) // 2
    for thing in found.things:  # in both views
        assert (found.instances[:half] == thing.instance).any()
        assert (found.instances[half:] == thing.instance).any()
        assert thing.box.size[2] == pytest.approx(0.78, abs=0.08)


def test_what_has_no_classes_and_bad_arguments_are_refused() -> None:
    gaussians = gaussians_at(plank(0.0, (2.0, 0.0, 0.0)), np.full(1155, CHAIR))
    with pytest.raises(ValueError, match="no classes"):
        objects(replace(gaussians, semantic=None))
    with pytest.raises(ValueError, match="positive gap"):
        objects(gaussians, gap=0.0)
    for point in ((1.0, 2.0), (0.0, float("nan"), 0.0)):
        with pytest.raises(ValueError, match="expected a point of three finite numbers"):
            objects(gaussians, seen_from=point)
    with pytest.raises(ValueError, match=r"expected \[g 1\]"):
        objects(gaussians, replace(SCANNET20, names=("a",), colours=((0, 0, 0),), raw_ids=(1,)))


def test_no_gaussians_are_no_things() -> None:
    empty = gaussians_at(np.zeros((0, 3)), np.zeros(0, np.int64))
    assert objects(empty).things == ()


def test_gaussians_whose_classes_are_equally_likely_are_no_thing() -> None:
    """Two classes at one half each: the first of the table would be the likeliest."""
    two = ClassTable("two", ("chair", "table"), ((1, 2, 3), (4, 5, 6)), (0, 1))
    points = np.concatenate((plank(0.0, (2.0, 0.0, 0.5)), plank(0.0, (4.0, 0.0, 0.5))))
    given = gaussians_at(points, np.zeros(len(points), np.int64))
    assert given.semantic is not None
    shares = torch.tensor([[0.5, 0.5], [0.1, 0.9]]).repeat_interleave(1155, 0)
    found = objects(replace(given, semantic=replace(given.semantic, features=shares)), two)
    assert [(one.name, one.count) for one in found.things] == [("table", 1155)]
    assert found.instances.tolist() == [0] * 1155 + [1] * 1155


def test_gaussians_without_any_opacity_are_no_thing() -> None:
    given = gaussians_at(
        np.concatenate((plank(0.0, (2.0, 0.0, 0.5)), plank(0.0, (4.0, 0.0, 0.5)))), np.full(2310, CHAIR)
    )
    given.opacities[:1155] = 0
    assert [one.count for one in objects(given, min_opacity=0.0).things] == [1155]


def shares_of(count: int, chair: float, table: float) -> torch.Tensor:
    """Class distributions with so much of chair and table, and the rest evenly over the other 18 classes."""
    features = torch.full((count, 20), (1 - chair - table) / 18)
    features[:, CHAIR], features[:, TABLE] = chair, table
    return features


def two_halves(gap: float, first: tuple[float, float], second: tuple[float, float]) -> Gaussians:
    """Two planks, so far apart along x [m], each with its shares of chair and table."""
    points = np.concatenate((plank(0.0, (0.0, 0.0, 0.5)), plank(0.0, (1.0 + gap, 0.0, 0.5))))
    given = gaussians_at(points, np.zeros(len(points), np.int64))
    assert given.semantic is not None
    features = torch.cat((shares_of(1155, *first), shares_of(1155, *second)))
    return replace(given, semantic=replace(given.semantic, features=features))


def test_two_halves_that_touch_and_are_alike_are_one_thing_with_the_likeliest_class_of_all_of_it() -> None:
    """sqrt(.5 x .3) + sqrt(.3 x .6) + 18 sqrt(.2/18 x .1/18) = .387 + .424 + .141 = .95; the means are .4 chair and .45 table."""
    found = objects(two_halves(0.05, (0.5, 0.3), (0.3, 0.6)))
    assert [(one.name, one.count) for one in found.things] == [("table", 2310)]
    assert [name for name, _ in found.things[0].likeliest[:2]] == ["table", "chair"]
    assert [share for _, share in found.things[0].likeliest] == pytest.approx([0.45, 0.4, 0.15 / 18], abs=1e-6)
    assert found.things[0].box.size == pytest.approx((2.05, 0.4, 0.2), abs=1e-5)


@pytest.mark.parametrize(
    ("gap", "first", "second"),
    [(0.15, (0.5, 0.3), (0.3, 0.6)), (0.05, (0.9, 0.0), (0.0, 0.9))],
    ids=["apart", "unlike"],
)
def test_halves_that_are_apart_or_unlike_stay_two(gap: float, first: tuple[float, float], second: tuple[float, float]):
    """What is .9 of another class agrees in 18 x .1/18 = .1 only."""
    found = objects(two_halves(gap, first, second))
    assert sorted(one.name for one in found.things) == ["chair", "table"]


def test_a_thing_whose_class_is_not_likely_enough_is_an_unknown_object() -> None:
    """The means are .4 chair and .45 table."""
    halves = two_halves(0.05, (0.5, 0.3), (0.3, 0.6))
    assert [objects(halves, sure=least).things[0].name for least in (0.44, 0.46)] == ["table", "unknown object"]
    unknown = objects(halves, sure=SURE)
    assert (unknown.things[0].name, unknown.things[0].label) == ("unknown object", TABLE)
    assert unknown.only(classes=("table",)).things == ()


def at_height(bottom: float, name: str) -> Gaussians:
    """A plank 0.2 m thick whose bottom is so high, which is a thing of a class with .8."""
    return gaussians_at(plank(0.0, (2.0, 0.0, bottom + 0.1)), np.full(1155, SCANNET20.index(name)))


@pytest.mark.parametrize(
    ("name", "bottom", "floor", "found"),
    [
        ("table", 1.5, None, "table"),
        ("table", 1.5, 0.0, "unknown object"),
        ("table", 1.5, 0.6, "table"),
        ("table", 0.96, 0.0, "table"),
        ("table", 0.98, 0.0, "unknown object"),
        ("picture", 0.81, 0.0, "picture"),
        ("picture", 0.79, 0.0, "unknown object"),
        ("otherfurniture", 2.2, 0.0, "otherfurniture"),
    ],
)
def test_what_is_at_a_height_where_none_of_its_class_is_is_an_unknown_object(
    name: str, bottom: float, floor: float | None, found: str
):
    """In the rooms, bottoms of tables are at most 0.77 m above the floor and those of pictures at least 1 m; 0.2 m more or less may be."""
    thing = objects(at_height(bottom, name), floor=floor).things[0]
    assert (thing.name, thing.label) == (found, SCANNET20.index(name))
    assert thing.likeliest[0] == (name, pytest.approx(0.8, abs=1e-6))


@pytest.mark.parametrize(
    ("shares", "name"),
    [
        ({"desk": 0.5, "table": 0.16}, "desk or table"),
        ({"desk": 0.5, "table": 0.14}, "unknown object"),  # .64 together
        ({"desk": 0.5, "cabinet": 0.2}, "unknown object"),  # seldom taken for each other
        ({"desk": 0.57, "table": 0.2}, "desk"),
    ],
)
def test_two_classes_that_are_often_confused_are_named_both(shares: dict[str, float], name: str):
    given = gaussians_at(plank(0.0, (2.0, 0.0, 0.8)), np.zeros(1155, np.int64))
    assert given.semantic is not None
    features = torch.full((1155, 20), (1 - sum(shares.values())) / 18)
    for one, share in shares.items():
        features[:, SCANNET20.index(one)] = share
    lifted = replace(given, semantic=replace(given.semantic, features=features))
    found = objects(lifted, sure=SURE)
    assert (found.things[0].name, found.things[0].label) == (name, SCANNET20.index("desk"))
    assert len(found.only(classes=("table",)).things) == ("table" in name)
    assert objects(lifted).things[0].name == "desk"

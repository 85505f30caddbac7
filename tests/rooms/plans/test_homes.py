"""What homes are furnished with, and where it stands."""

from collections import Counter

import numpy as np
import pytest

from semgs.data.tables.classes import IGNORE
from semgs_rooms.pieces import cloth, fittings, furniture
from semgs_rooms.pieces import small_things as things
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.plans import home
from semgs_rooms.plans.builder import Builder, snug
from semgs_rooms.plans.outlines import rectangle, rectangular


def furnished(seed: int, size=(6.5, 5.0, 2.6), kind="living") -> Builder:
    return Builder(np.random.default_rng(seed), rectangular(kind, size))


def test_people_live_in_kitchens_living_rooms_and_bedrooms():
    """Of 1,000 outlines a sixth has two rooms; of the rest more than half are one of the three, and a fifth are bathrooms and hallways."""
    rng = np.random.default_rng(0)
    kinds = Counter(" + ".join(zone.kind for zone in home._draw_outline(rng, home.USUAL).zones) for _ in range(1000))
    single = {kind: count for kind, count in kinds.items() if "+" not in kind}
    assert sum(home.SHARES.values()) == pytest.approx(1)
    assert 0.13 < 1 - sum(single.values()) / 1000 < 0.2
    assert 0.53 < (single["living"] + single["kitchen"] + single["bedroom"]) / sum(single.values()) < 0.63
    assert 0.13 < (single["bathroom"] + single["hallway"]) / sum(single.values()) < 0.23


@pytest.mark.parametrize("maker", [furniture.sofa, cloth.corner_sofa])
def test_a_sofa_in_the_room_has_its_back_a_metre_or_more_from_the_wall_behind_it(maker):
    """Its front is 1.5 to 2.6 m from the wall before it, and its sides are 30 cm or more from the others."""
    for seed in range(20):
        builder = furnished(seed)
        (zone,) = builder.outline.zones
        assert home._put_sofa_in_room(builder, zone, snug(maker(np.random.default_rng(seed))))
        back_left, back_right, front_right, front_left = builder.footprints[0]
        ahead = (front_left - back_left) / np.linalg.norm(front_left - back_left)
        half = np.array(builder.size[:2]) / 2

        def room(place, way, half=half):
            """Distance from a place to the wall in that direction [m]."""
            axis = int(np.abs(way).argmax())
            return half[axis] - place[axis] * np.sign(way[axis])

        assert room((back_left + back_right) / 2, -ahead) > 0.99
        assert 1.49 < room((front_left + front_right) / 2, ahead) < 2.61
        aside = np.array([-ahead[1], ahead[0]])
        assert room(back_left, aside) > 0.29
        assert room(back_right, -aside) > 0.29


def test_a_sofa_stays_at_the_wall_of_a_room_too_small_to_walk_behind_it():
    builder = furnished(0, (3.0, 2.8, 2.5))
    assert not home._put_sofa_in_room(
        builder, builder.outline.zones[0], snug(furniture.sofa(np.random.default_rng(0), 2))
    )
    assert not builder.parts


def test_two_desks_of_three_have_a_chair():
    chairs = 0
    for seed in range(60):
        builder = furnished(seed, kind="study")
        home._place(builder, builder.outline.zones[0], snug(furniture.desk(np.random.default_rng(seed))))
        chairs += any(part.label == LABEL["chair"] for part in builder.parts)
    assert 0.5 < chairs / 60 < 0.8


def test_glazed_cabinets_hang_above_counters_and_nothing_tall_stands_under_them():
    """They begin 1.42 m or more above the floor and end below the ceiling; the worktop's back 30 cm are taken there."""
    hung = 0
    for seed in range(40):
        builder = furnished(seed, kind="kitchen")
        wall, counter = builder.outline.zones[0].walls[0], snug(fittings.counter(np.random.default_rng(seed)))
        assert builder.beside_wall(wall, counter, 0.5)
        before, taken = len(builder.parts), len(builder.surfaces[-1].blocked) if builder.surfaces else 0
        home._hang_wall_cabinet(builder, wall, 0.5, counter)
        added = builder.parts[before:]
        if not added:
            continue
        hung += 1
        assert counter.surface is not None
        assert {part.label for part in added} == {LABEL["cabinet"]}
        assert min(part.centre[2] - part.size[2] / 2 for part in added) > 1.41
        assert max(part.centre[2] + part.size[2] / 2 for part in added) < 2.6
        assert len(builder.surfaces[-1].blocked) == taken + 1
        left, right, near, far = builder.surfaces[-1].blocked[-1]
        assert near == 0.0
        assert 0.3 < far < 0.42
        assert 0.39 * counter.size[0] < right - left <= counter.size[0]
    assert 6 <= hung <= 20  # 13 are expected: 55 % of counters have no cabinets of their own, 60 % of them get some


def test_no_glazed_cabinet_hangs_in_a_window():
    for seed in range(20):
        builder = furnished(seed, kind="kitchen")
        wall, counter = builder.outline.zones[0].walls[0], snug(fittings.counter(np.random.default_rng(seed)))
        wall.taken.append((0.4, 4.0, 1.0, 2.2))
        builder.footprints.append(rectangle(*wall.at(0.5), *counter.size[:2], wall.yaw))
        home._hang_wall_cabinet(builder, wall, 0.5, counter)
        assert not builder.parts


@pytest.mark.parametrize("maker", [things.on_desk, things.on_table, things.on_worktop])
def test_what_stands_on_furniture_has_no_class_and_is_smaller_than_a_screen(maker):
    sizes = []
    for seed in range(60):
        thing = snug(maker(np.random.default_rng(seed), 0.25))
        assert {part.label for part in thing.parts} == {IGNORE}
        assert min(part.centre[2] for part in thing.parts) >= 0
        sizes.append(thing.size)
    assert np.max(sizes) < 0.75
    assert thing.name == {things.on_desk: "on a desk", things.on_table: "on a table"}.get(maker, "on a worktop")


@pytest.mark.long
def test_desks_have_screens_and_tables_have_plates():
    """Most of what stands on a desk belongs there; of a table's things none is a laptop or a screen."""
    rng = np.random.default_rng(3)
    names = Counter()
    for seed in range(30):
        for kind, maker in (("study", furniture.desk), ("dining", furniture.dining_table)):
            builder = furnished(seed, kind=kind)
            seen: list[str] = []
            builder.swap = lambda piece, seen=seen: seen.append(piece.name) or piece
            assert builder.stand(snug(maker(rng)), 0.0, 0.0, 0.0)
            home.dressing.scatter_clutter(builder, builder.outline.zones[0])
            names.update((kind, name) for name in seen)
    assert names["study", "on a desk"] > 30
    assert names["dining", "on a table"] > 60
    assert names["study", "on a table"] == names["dining", "on a desk"] == 0

"""Numbers of things that last. A group is Gaussians by their sources, in a row from some place on, 1 cm apart: 40 of them fill one voxel."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import semgs
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.robotics.boxes import Box
from semgs.robotics.objects import Objects, Thing
from semgs.robotics.tracking import Ids

Group = tuple[range, float]


def map_of(*groups: Group, name: str = "chair") -> tuple[Objects, Gaussians, torch.Tensor]:
    """Things with the numbers 1, 2, ... in this order; each has the sources `group[0]`, from x = `group[1]` on. The first Gaussian of the map belongs to none."""
    sources = torch.cat((torch.tensor([-1]), *(torch.tensor(list(one)) for one, _ in groups)))
    places = [torch.tensor([-50.0]), *(at + 0.005 + 0.01 * torch.arange(len(one)) for one, at in groups)]
    means = torch.nn.functional.pad(torch.cat(places)[:, None], (0, 2))
    count = len(means)
    shape = Appearance(torch.tensor([1.0, 0, 0, 0]).expand(count, 4), torch.ones(count, 3), torch.zeros(count, 1, 3))
    box = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.0)
    things = [Thing(n, 0, name, 1.0, box, 0.0, len(one)) for n, (one, _) in enumerate(groups, 1)]
    instances = np.repeat(np.arange(len(groups) + 1), [1, *(len(one) for one, _ in groups)])
    return Objects(tuple(things), instances, np.eye(3)), Gaussians(means, torch.ones(count), shape), sources


def numbers(ids: Ids, *groups: Group, by_place: bool = False, **options: str) -> list[int]:
    """The number of each group after an update; every Gaussian of a group has it, and the one outside has none."""
    found, gaussians, sources = map_of(*groups, **options)
    after = ids.update(found, gaussians, None if by_place else sources)
    assert after.instances[0] == 0
    by_group = [set(after.instances[found.instances == thing.instance].tolist()) for thing in found.things]
    assert all(len(one) == 1 for one in by_group)
    listed = [one for group in by_group for one in group]
    assert [thing.instance for thing in after.things] == sorted(listed)
    return listed


def test_things_keep_their_numbers_whatever_order_they_are_found_in_and_new_ones_get_the_next():
    ids = Ids()
    assert numbers(ids, (range(40), 0.0), (range(100, 120), 3.0)) == [1, 2]
    assert numbers(ids, (range(100, 160), 3.0), (range(40), 0.0)) == [2, 1]
    assert numbers(ids, (range(200, 300), 6.0), (range(100, 160), 3.0), (range(40), 0.0)) == [3, 2, 1]


def test_the_rest_of_a_thing_stays_with_its_number():
    ids = Ids()
    ids.update(*map_of((range(20), 0.0), (range(100, 140), 3.0)))
    found, gaussians, sources = map_of((range(100, 140), 3.0), (range(20), 0.0), name="table")
    after = ids.update(found, gaussians, sources)
    assert [(thing.instance, thing.name, thing.count) for thing in after.things] == [(1, "table", 20), (2, "table", 40)]
    np.testing.assert_array_equal(after.instances, np.repeat([0, 2, 1], [1, 40, 20]))


def test_in_a_corrected_map_gaussians_are_known_again_and_by_place_alone_they_are_not():
    ids = Ids()
    assert numbers(ids, (range(40), 0.0)) == [1]
    assert numbers(ids, (range(40), 5.0)) == [1]
    ids = Ids()
    assert numbers(ids, (range(40), 0.0), by_place=True) == [1]
    assert numbers(ids, (range(40), 5.0), by_place=True) == [2]


def test_what_was_forgotten_and_is_mapped_anew_is_known_by_its_place():
    """120 Gaussians fill the voxels 0, 1 and 2. The next ones fill 2, 3 and 4: one of three is shared, more than a quarter. The last ones fill 6, 7 and 8."""
    ids = Ids()
    assert numbers(ids, (range(120), 0.0)) == [1]
    assert numbers(ids) == []
    assert numbers(ids, (range(1000, 1120), 0.8)) == [1]
    assert numbers(ids, (range(2000, 2120), 2.4)) == [2]


def test_where_two_things_become_one_the_larger_number_of_gaussians_decides_and_both_get_theirs_back():
    ids = Ids()
    assert numbers(ids, (range(10), 0.0), (range(100, 130), 3.0)) == [1, 2]
    assert numbers(ids, (range(10), 0.0), (range(100, 130), 3.0)) == [1, 2]
    found, gaussians, sources = map_of((range(10), 0.0), (range(100, 130), 3.0))
    one = Objects(found.things[:1], found.instances.clip(max=1), found.level_from_world)
    assert [thing.instance for thing in ids.update(one, gaussians, sources).things] == [2]
    assert numbers(ids, (range(10), 0.0), (range(100, 130), 3.0)) == [1, 2]


def test_of_a_thing_that_falls_apart_the_larger_piece_keeps_the_number():
    ids = Ids()
    assert numbers(ids, (range(60), 0.0)) == [1]
    assert numbers(ids, (range(20), 0.0), (range(20, 60), 3.0)) == [2, 1]


@pytest.mark.parametrize(("shared", "number"), [(4, 2), (5, 1)])
def test_a_quarter_of_the_smaller_thing_must_be_shared(shared: int, number: int):
    """The second thing has 20 Gaussians, 4 or 5 of which were of the first, which had 40."""
    ids = Ids()
    assert numbers(ids, (range(40), 0.0)) == [1]
    assert numbers(ids, (range(40 - shared, 60 - shared), 9.0)) == [number]


def test_a_number_is_never_given_to_another_thing():
    ids = Ids()
    given = [numbers(ids, (range(100 * k, 100 * k + 20), 3.0 * k))[0] for k in range(4)]
    assert given == [1, 2, 3, 4]
    assert numbers(ids, (range(100, 120), 3.0)) == [2]
    assert numbers(ids, (range(900, 920), 60.0)) == [5]
    assert ids.last == 5


def test_maps_without_things_or_gaussians_leave_the_numbers_as_they_were():
    ids = Ids()
    assert numbers(ids) == []
    assert numbers(ids, (range(20), 0.0)) == [1]
    found, gaussians, sources = map_of()
    nothing = Objects((), found.instances[:0], found.level_from_world)
    assert ids.update(nothing, gaussians.map(lambda one: one[:0]), sources[:0]).things == ()
    assert numbers(ids, (range(20), 0.0)) == [1]


def test_things_and_sources_of_another_map_are_refused():
    found, gaussians, sources = map_of((range(20), 0.0))
    with pytest.raises(ValueError, match="things are of 21 Gaussians; expected those of this map, of 20"):
        Ids().update(found, gaussians.map(lambda one: one[1:]), sources[1:])
    with pytest.raises(ValueError, match="sources are of 20 Gaussians; expected those of this map, of 21"):
        Ids().update(found, gaussians, sources[1:])


def test_things_that_were_selected_keep_theirs_too():
    """`only` leaves gaps in the numbers before."""
    ids = semgs.Ids()
    found, gaussians, sources = map_of((range(20), 0.0), (range(100, 140), 3.0))
    some = Objects(found.things[1:], np.where(found.instances == 2, 2, 0), found.level_from_world)
    assert [thing.instance for thing in ids.update(some, gaussians, sources).things] == [1]
    assert [thing.instance for thing in ids.update(found, gaussians, sources).things] == [1, 2]

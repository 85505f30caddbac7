import itertools

import numpy as np
import pytest
import torch

pytest.importorskip("embreex")

from semgs_rooms.plans.home import draw_home
from semgs_rooms.plans.other import draw_other
from semgs_rooms.plans.outlines import overlap
from semgs_rooms.sets.room_stream import sample


@pytest.fixture(scope="module")
def plans():
    return [draw_other(np.random.default_rng(seed)) for seed in range(30)]


@pytest.mark.long
def test_furniture_of_the_other_world_neither_intersects_nor_leaves_the_room(plans):
    for plan in plans:
        assert len(plan.footprints) >= 2
        for one, two in itertools.combinations(plan.footprints, 2):
            assert not overlap(one, two)
        for corners in plan.footprints:
            assert (np.abs(corners) <= (plan.size[0] / 2 + 1e-9, plan.size[1] / 2 + 1e-9)).all()


@pytest.mark.long
def test_its_rooms_are_longer_than_those_of_homes(plans):
    def elongation(some):
        return np.median([max(plan.size[:2]) / min(plan.size[:2]) for plan in some])

    homes = [draw_home(np.random.default_rng(seed)) for seed in range(15)]
    assert elongation(plans) > 1.3 * elongation(homes)


def test_all_classes_occur_in_it(plans):
    labels = {part.label for plan in plans for part in plan.parts}
    assert set(range(20)) <= labels


def test_its_samples_are_the_same_bits_each_time_and_no_homes():
    one, two, home = (
        sample(3, 4, size=(24, 32), contexts=2, targets=0, style=style)[0] for style in ("other", "other", "home")
    )
    assert torch.equal(one.images, two.images)
    assert not torch.equal(one.images, home.images)


def test_home_is_the_style_that_is_drawn_unasked():
    home, unasked = (
        sample(2, 1, size=(24, 32), contexts=1, targets=0, **named)[0] for named in ({"style": "home"}, {})
    )
    assert torch.equal(home.images, unasked.images)

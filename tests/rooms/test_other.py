import itertools

import numpy as np
import pytest
import torch

pytest.importorskip("embreex")

from semgs.rooms.footprints import overlap
from semgs.rooms.other import draw_other_plan
from semgs.rooms.plain import build_room
from semgs.rooms.plans import draw_plan
from semgs.rooms.stream import generator, sample


def test_furniture_of_the_other_world_neither_intersects_nor_leaves_the_room():
    for seed in range(30):
        plan = draw_other_plan(np.random.default_rng(seed))
        assert len(plan.footprints) >= 2
        for one, two in itertools.combinations(plan.footprints, 2):
            assert not overlap(one, two)
        for corners in plan.footprints:
            assert (np.abs(corners) <= (plan.size[0] / 2 + 1e-9, plan.size[1] / 2 + 1e-9)).all()


def test_its_rooms_are_longer_than_those_of_homes():
    def elongation(draw):
        return [max(p.size[:2]) / min(p.size[:2]) for p in (draw(np.random.default_rng(seed)) for seed in range(40))]

    assert np.median(elongation(draw_other_plan)) > 1.3 * np.median(elongation(draw_plan))


def test_all_classes_occur_in_it():
    labels = {part.label for seed in range(60) for part in draw_other_plan(np.random.default_rng(seed)).parts}
    assert set(range(20)) <= labels


def test_its_samples_are_the_same_bits_each_time_and_no_homes():
    one, two, home = (
        sample(3, 4, size=(24, 32), contexts=2, targets=0, style=style)[0] for style in ("other", "other", "home")
    )
    assert torch.equal(one.images, two.images)
    assert not torch.equal(one.images, home.images)


def test_a_style_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="style 'house'; expected one of home, other"):
        build_room(generator(1, 1), style="house")

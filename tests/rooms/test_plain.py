import itertools

import numpy as np
import pytest
import torch

pytest.importorskip("embreex")

from semgs.data.classes import IGNORE
from semgs.rooms.footprints import overlap
from semgs.rooms.plain import draw_plain
from semgs.rooms.solids import BOX
from semgs.rooms.stream import sample


def test_plain_rooms_are_boxes_that_stand_apart_inside_the_room():
    for seed in range(10):
        plan = draw_plain(np.random.default_rng(seed))
        assert {part.shape for part in plan.parts} == {BOX}
        for one, other in itertools.combinations(plan.footprints, 2):
            assert not overlap(one, other)
        for corners in plan.footprints:
            assert (np.abs(corners) <= (plan.size[0] / 2, plan.size[1] / 2)).all()


def test_plain_rooms_show_the_first_thirteen_classes_and_no_other():
    views = [sample(4, k, size=(24, 32), contexts=1, targets=0, style="plain")[0] for k in range(40)]
    labels = torch.cat([each.labels.flatten() for each in views])
    assert set(labels.unique().tolist()) == {*range(13), IGNORE}


def test_a_style_is_a_world_of_its_own_and_home_is_the_one_that_is_drawn_unasked():
    home, plain, unasked = (
        sample(2, 1, size=(24, 32), contexts=1, targets=0, **named)[0]
        for named in ({"style": "home"}, {"style": "plain"}, {})
    )
    assert torch.equal(home.images, unasked.images)
    assert not torch.equal(home.images, plain.images)

"""Maps of free space beside the true one, with cells and metres worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from semgs.data.demo_scene import demo_scene
from semgs.data.scenes import open_scene
from semgs.evaluation.frames.free_space import FreeSpace, compare, score_free_space
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.score_records import decode_scores, encode_scores
from semgs.evaluation.scoring.summary import summarise
from semgs.geometry.cameras import Cameras
from semgs.model.encode import encode
from semgs.model.weights.load import load
from semgs.robotics.occupancy import FREE, OCCUPIED, UNKNOWN, Occupancy

LOOKING_ALONG_X = np.array([[0.0, 0, 1, 0.5], [-1, 0, 0, 1.0], [0, -1, 0, 1.2], [0, 0, 0, 1]])
"""A level camera at (0.5, 1.0)."""


def plan(cells: np.ndarray, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Occupancy:
    """A plan with cells of half a metre."""
    empty = np.zeros((1, *cells.shape), np.int8)
    return Occupancy(cells.astype(np.int8), empty, empty.astype(np.uint8), origin, 0.5, 0.0, np.eye(3))


def cameras() -> Cameras:
    k = torch.tensor([[40.0, 0, 20], [0, 40, 15], [0, 0, 1]], dtype=torch.float64)
    return Cameras(torch.from_numpy(LOOKING_ALONG_X)[None], k[None], (30, 40))


def true_cells() -> np.ndarray:
    """4 x 8 cells, 2 x 4 m, free, with a wall in the last column and a box in row 1, column 5: its middle is at (2.75, 0.75)."""
    cells = np.full((4, 8), FREE)
    cells[:, 7], cells[1, 5] = OCCUPIED, OCCUPIED
    return cells


def test_cells_are_found_at_places_and_nothing_is_known_outside():
    found = plan(true_cells(), (1.0, 0.0, 0.0))
    places = np.array([[3.75, 0.75], [4.74, 0.1], [1.01, 0.1], [0.99, 0.1], [1.5, 2.01]])
    assert found.at(places).tolist() == [OCCUPIED, OCCUPIED, FREE, UNKNOWN, UNKNOWN]
    assert found.middles[1, 5].tolist() == [3.75, 0.75]


def test_the_nearest_obstacle_ahead_is_in_the_lane():
    """The box is 2.25 m ahead and its middle 0.25 m to the side: just inside of half a metre. A narrower lane ends at nothing but the reach: the wall's middles
    are 0.25 m to the side too."""
    truth = plan(true_cells())
    assert truth.ahead(LOOKING_ALONG_X) == pytest.approx(2.25)
    assert truth.ahead(LOOKING_ALONG_X, width=0.4) == 5.0
    assert truth.ahead(LOOKING_ALONG_X, reach=2.0) == 2.0
    back = LOOKING_ALONG_X.copy()
    back[:3, [0, 2]] *= -1
    assert truth.ahead(back) == 5.0, "nothing is behind"


def test_a_missed_box_is_called_free_and_the_wall_is_the_next_obstacle():
    """5 of 32 cells are occupied, the box is called free; of 27 free ones, 3 of the first column are outside of the found plan, whose fourth is unknown. The wall is 3.25 m away."""
    cells = np.full((4, 7), FREE)
    cells[:, 6], cells[0, 0] = OCCUPIED, UNKNOWN
    found = compare(plan(cells, (0.5, 0.0, 0.0)), plan(true_cells()), cameras())
    assert found == FreeSpace(5, 1, 27, 27 - 4 - 1, 1, pytest.approx(1.0))
    assert compare(None, plan(true_cells()), cameras()) == FreeSpace(5, 0, 27, 0, 1, pytest.approx(2.75))


def test_numbers_of_targets_add_up_and_come_back_from_json():
    one = FrameScores("room", "a", ("x",), free_space=FreeSpace(5, 1, 27, 22, 1, 1.0))
    other = FrameScores("room", "b", ("x",), free_space=FreeSpace(15, 0, 13, 8, 1, 0.2))
    found = summarise([one, decode_scores(encode_scores(other), 20)])
    assert [found[name] for name in ("obstacles_free", "free_found", "obstacle_error")] == [1 / 20, 30 / 40, 0.6]
    with pytest.raises(ValueError, match="missing"):
        decode_scores(encode_scores(one) | {"free_space": {"cells": 3}}, 20)


def test_the_map_of_a_scene_beside_its_own_measured_depth():
    """Of random weights, only that numbers are possible; without depth there are none."""
    scene = open_scene(demo_scene())
    views = scene.read([0, 2], (48, 64))
    contexts = views.changed(labels=None, depths=None)
    encoding = encode(load("small").eval(), contexts).encoding
    found = score_free_space(encoding, contexts, views)
    assert found is not None
    assert found.cameras == 2
    assert 0 < found.free_as_free <= found.free
    assert 0 <= found.occupied_as_free < found.occupied
    assert score_free_space(encoding, contexts, contexts) is None
    assert views.depths is not None
    hollow = views.changed(depths=torch.where(torch.arange(2)[:, None, None] == 0, views.depths, 0.0))
    assert score_free_space(encoding, contexts, hollow) is None

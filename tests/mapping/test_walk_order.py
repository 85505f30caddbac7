"""The order in which the frames of a recording are taken."""

from __future__ import annotations

import numpy as np
import pytest

from semgs.mapping.walk_order import walk_order

SHUFFLED = [5, 0, 7, 2, 6, 1, 4, 3]


def poses(places: list[float], angles: list[float] | None = None) -> np.ndarray:
    """Cameras on a line, turned around its y axis [n 4 4]."""
    made = np.repeat(np.eye(4)[None], len(places), axis=0)
    made[:, 0, 3] = places
    turns = np.zeros(len(places)) if angles is None else np.array(angles)
    made[:, 0, 0] = made[:, 2, 2] = np.cos(turns)
    made[:, 0, 2], made[:, 2, 0] = np.sin(turns), -np.sin(turns)
    return made


@pytest.mark.parametrize(
    "places",
    [
        [float(place) for place in range(8)],
        [0.0, 1, 2, 3, 4, 5, 6, 7, 6, 5, 4, 3, 2, 1],  # there and back
        [0.0, 1, 2, 9, 10, 11, 12, 13],  # with a leap
        [0.0] * 8,
        [3.0, 0, 4],
    ],
)
def test_a_walk_stays_as_the_file_has_it(places: list[float]) -> None:
    found = walk_order([f"{9 - index}.png" for index in range(len(places))], poses(places), 2.0)
    assert found.positions == tuple(range(len(places)))
    assert found.note == ""


def test_shuffled_frames_are_taken_by_their_names_with_numbers_by_value() -> None:
    names = [f"images/{number + 6}.png" for number in SHUFFLED]  # 6.png to 13.png
    found = walk_order(names, poses([float(number) for number in SHUFFLED]), 2.0)
    assert [SHUFFLED[position] for position in found.positions] == list(range(8))
    assert "in the order of their names" in found.note


def test_without_names_that_say_so_the_next_frame_is_the_nearest_from_one_end() -> None:
    """The camera at 7 is farthest from the first of the file, at 3.2."""
    places = [3.2, 0, 7, 2, 6, 1, 4, 5]
    found = walk_order(list("fbhagdce"), poses(places), 2.0)
    assert [places[position] for position in found.positions] == [7, 6, 5, 4, 3.2, 2, 1, 0]
    assert "along the positions of their cameras" in found.note


def test_a_camera_that_only_turns_walks_too() -> None:
    """Steps of 0.2 rad at a depth of 2 are as steps of 0.4."""
    angles = [0.2 * number for number in SHUFFLED]
    found = walk_order(list("fbhagdce"), poses([0.0] * 8, angles), 2.0)
    assert [SHUFFLED[position] for position in found.positions] in ([*range(8)], [*range(7, -1, -1)])

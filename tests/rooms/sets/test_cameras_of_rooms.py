"""How cameras are used in homes, and that those of the held-out world are not."""

import numpy as np
import pytest

pytest.importorskip("embreex")

from semgs_rooms.drawing.room import build_room
from semgs_rooms.drawing.shading import RoomCamera, look, pixel_directions
from semgs_rooms.pieces.furniture import LABEL
from semgs_rooms.pieces.solids import block, gather
from semgs_rooms.sets import carried_cameras as cameras
from semgs_rooms.sets.carried_cameras import USUAL, Habit, draw_camera, draw_habit, draw_path, view_overlap
from semgs_rooms.sets.room_stream import generator, keep_overlap

PIXELS = np.stack(np.meshgrid(np.arange(40) + 0.5, np.arange(30) + 0.5), -1).reshape(-1, 2)
K = np.array([[36.0, 0, 19.0], [0, 35.0, 16.0], [0, 0, 1]])
CAMERA = RoomCamera(K, (30, 40))


def test_the_held_out_world_has_the_usual_cameras_and_no_number_is_spent_on_it():
    one, other = np.random.default_rng(5), np.random.default_rng(5)
    for style in ("other", "home", "closeup"):
        habit = draw_habit(one, style)
        assert (habit == USUAL) == (style == "other")
        assert one.random() == other.random()


def test_a_third_of_the_cameras_in_homes_is_close_and_a_third_takes_long_steps():
    habits = [draw_habit(np.random.default_rng(seed), "home") for seed in range(2000)]
    close, wide, tilted, lens = (
        np.mean([test(habit) for habit in habits])
        for test in (
            lambda habit: habit.close,
            lambda habit: habit.step[1] > 0.4,
            lambda habit: habit.roll != 0,
            lambda habit: habit.focal != USUAL.focal,
        )
    )
    assert close == pytest.approx(0.35, abs=0.04)
    assert wide == pytest.approx(0.35, abs=0.04)
    assert tilted == pytest.approx(0.2, abs=0.04)
    assert lens == pytest.approx(0.25, abs=0.04)
    rolls = np.degrees([habit.roll for habit in habits])
    assert 14 < rolls.max() < 15
    assert -15 < rolls.min() < -14


@pytest.mark.parametrize(("focal", "degrees"), [((0.5, 0.7), (71, 90.1)), ((1.3, 1.6), (34, 42.2))])
def test_other_lenses_have_other_fields_of_view(focal, degrees):
    """An image of 400 px by a focal length of 0.5 of it is seen under 2 atan(1) = 90 degrees."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        intrinsics = draw_camera(rng, (300, 400), Habit(focal=focal)).intrinsics
        across = np.degrees(2 * np.arctan(200 / np.sqrt(intrinsics[0, 0] * intrinsics[1, 1])))
        assert degrees[0] - 0.1 < across < degrees[1]


def test_a_toilet_is_chosen_four_times_as_often_as_a_cabinet():
    """A room with three cabinets, two doors and one toilet: doors are never chosen, the toilet in 4 of 5 cases."""
    labels = [LABEL[name] for name in ("cabinet", "cabinet", "cabinet", "door", "door", "toilet")]
    parts = [block(label, np.zeros(24), (i, 0, 0), (i + 0.5, 0.4, 1)) for i, label in enumerate(labels)]
    pieces = [(i, i + 1) for i in range(len(parts))]
    rng = np.random.default_rng(1)
    chosen = [cameras._subject(rng, pieces, gather(parts)) for _ in range(500)]
    assert {subject.label for subject in chosen} == {LABEL["cabinet"], LABEL["toilet"]}
    assert np.mean([subject.label == LABEL["toilet"] for subject in chosen]) == pytest.approx(0.8, abs=0.05)
    toilet = next(subject for subject in chosen if subject.label == LABEL["toilet"])
    np.testing.assert_allclose((toilet.low, toilet.high), ((5, 0, 0), (5.5, 0.4, 1)))


def test_close_cameras_are_within_90_cm_of_their_subject_and_fill_the_frame_with_it(monkeypatch):
    """Of ten close cameras; the depths are medians of frames."""
    subjects, depths, shares = [], [], []
    choose = cameras._subject
    monkeypatch.setattr(cameras, "_subject", lambda *args: subjects.append(choose(*args)) or subjects[-1])
    for index in range(10):
        rng = generator(31, index)
        room = build_room(rng)
        path = draw_path(rng, room, CAMERA, 0.5, Habit(close=True))
        subject, place = subjects[-1], path.middle
        away = np.linalg.norm(np.maximum(0, np.maximum(subject.low - place, place - subject.high)))
        assert away <= 0.9
        labels, z = look(room, path.pose(0.0), pixel_directions(path.pose(0.0), K, PIXELS))
        depths.append(np.median(z))
        shares.append((labels == subject.label).mean())
    assert np.median(depths) < 1.4
    assert np.median(shares) > 0.35
    assert max(shares) > 0.6


@pytest.mark.long
def test_long_steps_are_up_to_a_third_of_the_depth_and_turning_away_leaves_less_overlap():
    """Six wide cameras that follow what they see and six that turn by 0.45 rad a step, in the same rooms."""
    shares, baselines = np.zeros((2, 6)), np.zeros((2, 6))
    for row, turn in enumerate((0.0, 0.45)):
        wide = Habit(turn=turn, step=(0.4, 1.0), length=0.6, overlap=(0.25, 0.6))
        for index in range(6):
            rng = generator(32, index)
            room = build_room(rng)
            path = keep_overlap(rng, room, draw_path(rng, room, CAMERA, 1.0, wide), CAMERA, wide.overlap)
            one, other = path.pose(-0.5), path.pose(0.5)
            _, z = look(room, one, pixel_directions(one, K, PIXELS))
            shares[row, index] = view_overlap(room, one, other, CAMERA)
            baselines[row, index] = np.linalg.norm(one[:3, 3] - other[:3, 3]) / np.median(z)
    assert shares.min() > 0.25
    assert np.median(shares[0]) > 0.7 > np.median(shares[1])
    assert np.median(baselines) > 0.15  # usual pairs: 0.09
    assert baselines.max() > 0.3

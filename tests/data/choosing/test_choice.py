"""Choice of views: by what they see and from where."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from landmarks import looking

from semgs.data.cameras.lens import Lens
from semgs.data.choosing.choice import choose, choose_named, draw_consecutive, draw_sample, frames_around, preference
from semgs.data.frames import Frame
from semgs.data.maps import DepthMap, InMemory
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.files.images.pictures import write_png

LENS = Lens((120, 170), (150.0, 143.0), (91.3, 55.2))
MIDDLE = 5**0.5
"""The middle depth of a metric scene: of 0.5 and 10 m [m]."""


def scene(poses: Sequence[np.ndarray], unit: str = "metric") -> Scene:
    """A scene of cameras alone."""
    frames = tuple(Frame(f"{n:04d}.png", Path("nowhere"), LENS, pose) for n, pose in enumerate(poses))
    return Scene(Path("nowhere"), "scene", "transforms.json", unit, frames)


def beside(*places: float) -> list[np.ndarray]:
    """Cameras side by side, looking the same way, at these parts of the middle depth."""
    return [looking((place * MIDDLE, 0.1, 0), (place * MIDDLE, 0.1, 5)) for place in places]


def test_a_baseline_in_the_band_is_preferred_to_a_shorter_and_a_longer_one():
    assert choose(scene(beside(0.0, 0.01, 0.11, 0.9)), 2).context in [(0, 2), (1, 2)]
    assert choose(scene(beside(0.9, 0.0, 0.005, 0.1)), 2).context in [(1, 3), (2, 3)]
    for relative in (0.05, 0.1, 0.15):
        assert choose(scene(beside(0.0, relative, 1.1, 1.11)), 2).context == (0, 1)


def test_thepreference_is_one_in_the_middle_of_the_band_three_quarters_at_its_ends_and_a_tenth_far_from_it():
    """exp(-(ln(b / 0.0866) / 0.72)^2 / 2): the logarithms are 0, ln 3^0.5 = 0.549 and 1.545."""
    relative = np.array([0.0866, 0.05, 0.15, 0.0185, 0.406])
    assert preference(relative) == pytest.approx([1.0, 0.7475, 0.7475, 0.1, 0.1], rel=5e-3)


def test_frames_that_look_elsewhere_are_not_chosen_whatever_their_baseline():
    away = looking((0.1 * MIDDLE, 0.1, 0), (0.1 * MIDDLE, 0.1, -5))
    aside = looking((0.09 * MIDDLE, 0.1, 0), (5, 0.1, 0.5))
    assert choose(scene([*beside(0.0), away, aside, *beside(0.2)]), 2).context == (0, 3)


def test_cameras_that_face_each_other_share_nothing():
    face_to_face = [looking((0, 0.1, 0), (0, 0.1, 5)), looking((0, 0.1, 2 * MIDDLE), (0, 0.1, 0))]
    assert choose(scene([*face_to_face, *beside(0.3)]), 2).context == (0, 2)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_the_order_of_the_file_does_not_matter(count):
    generator = np.random.default_rng(3)
    poses = [looking(eye, (0, 0, 4)) for eye in generator.normal(0, 0.5, (12, 3))]
    chosen = {tuple(poses[n][:3, 3]) for n in choose(scene(poses), count).context}
    for _ in range(3):
        shuffled = [poses[n] for n in generator.permutation(12)]
        choice = choose(scene(shuffled), count)
        assert {tuple(shuffled[n][:3, 3]) for n in choice.context} == chosen
        assert list(choice.context) == sorted(choice.context)


def test_further_views_are_added_beside_those_chosen():
    choice = choose(scene(beside(*np.arange(12) * 0.03)), 4)
    assert set(np.diff(choice.context)) == {3}


def test_the_frames_left_between_are_the_targets():
    choice = choose(scene(beside(0.0, 0.03, 0.06, 0.09, 1.5)), 2)
    assert choice.context == (0, 3)
    assert choice.targets == (1, 2)


def test_many_frames_between_give_a_few_targets_spread_over_them():
    choice = choose_named(scene(beside(*np.linspace(0, 0.2, 41))), (0, 40))
    assert choice.targets == (1, 14, 26, 39)


def test_without_frames_between_the_nearest_others_are_the_targets():
    assert choose_named(scene(beside(0.0, 0.1, 0.2, 0.3, 3.0)), (1, 2)).targets == (0, 3)


def test_frames_that_see_something_else_are_no_targets():
    away = looking((0.05 * MIDDLE, 0.1, 0), (0.05 * MIDDLE, 0.1, -5))
    assert choose_named(scene([*beside(0.0), away, *beside(0.06, 0.1)]), (0, 3)).targets == (2,)


def test_a_frame_between_that_looks_aside_is_passed_over_for_one_that_is_covered():
    """The first looks 24 degrees aside and shares about half; the second is outside of the contexts but sees what they see."""
    aside = looking((0.05 * MIDDLE, 0.1, 0), (0.05 * MIDDLE + 2.2, 0.1, 5))
    choice = choose_named(scene([*beside(0.0), aside, *beside(0.1, 0.12)]), (0, 2))
    assert choice.targets == (3,)
    assert choice.notes == ()
    alone = choose_named(scene([*beside(0.0), aside, *beside(0.1)]), (0, 2))
    assert alone.targets == (1,)
    assert alone.notes == (
        "The input views see less than 90% of each held-out frame, so compare the scores over the seen pixels.",
    )


def test_a_frame_that_shares_too_little_is_not_taken_and_fewer_go_in():
    choice = choose(scene(beside(0.0, 0.05, 0.1, 5.0, 9.0)), 4)
    assert choice.context == (0, 1, 2)
    assert choice.notes == ("3 input views instead of 4: no other frame shares 30% of what it sees with them.",)


def test_contexts_leave_a_frame_that_they_cover():
    """The pair that looks aside is the best by 0.92 to 0.8, with its baseline of 8.66 % to 12 %, and leaves no frame that it sees."""
    aside = [looking((0.1, 0.1, z), (5, 0.1, z)) for z in (0.0, 0.0866 * MIDDLE)]
    assert choose(scene([*beside(0.03, 0.15), *aside]), 2).context == (2, 3)
    choice = choose(scene([*beside(0.0, 0.03, 0.15), *aside]), 2)
    assert (choice.context, choice.targets) == ((1, 2), (0,))


def measured(wall: float, places: Sequence[float]) -> Scene:
    """Cameras side by side at these metres that measured a wall [m]."""
    depths = np.full(LENS.size, wall, np.float32)
    poses = [looking((place, 0.1, 0), (place, 0.1, 5), roll=0.0) for place in places]
    bare = scene(poses)
    return replace(bare, frames=tuple(replace(frame, depth=InMemory(depths)) for frame in bare.frames))


def test_the_baseline_is_judged_by_measured_depth():
    """Near a wall at 1 m 0.09 m is 9 %; where nothing is measured the depth of rooms, 2.2 m, wants 0.2 m."""
    near = measured(1.0, (0.0, 0.05, 0.09, 0.25))
    choice = choose(near, 2)
    assert (choice.context, choice.targets) == ((0, 2), (1, 3))
    assert "by measured depth with a median of 1 m, and are 0.09 m (9% of it) apart" in choice.reason
    bare = replace(near, frames=tuple(replace(frame, depth=None) for frame in near.frames))
    assert choose(bare, 2).context == (1, 3)


def test_without_two_frames_that_share_enough_there_is_one_clear_error():
    """A picture is 170 / 150 m wide at 1 m: 0.5 m to the side leaves 56 %, 1 m 12 %."""
    assert choose(measured(1.0, (0.0, 0.5)), 2).context == (0, 1)
    with pytest.raises(
        InputError, match=r"expected two frames that share 30% of what they see, found \d+% at most; .*--context"
    ):
        choose(measured(1.0, (0.0, 1.0)), 2)


def test_the_unit_of_depth_maps_is_named_where_frames_seem_to_share_nothing(tmp_path):
    """Maps of 300 counts are at 0.3 m in millimetres, where images are 0.34 m wide: cameras 0.28 m apart then share little. At 5 mm a count they are at 1.5 m."""
    near = measured(1.0, (0.0, 0.28))
    write_png(tmp_path / "depth.png", np.full(near.frames[0].lens.size, 300, np.uint16))

    def in_unit(unit: float) -> Scene:
        frames = [replace(frame, depth=DepthMap(tmp_path / "depth.png", unit)) for frame in near.frames]
        return replace(near, frames=tuple(frames))

    said = r"by their depth maps, whose median is 0\.3 m if they count in 0\.001 m \(if they count in another unit, give it: --depth-unit\)"
    with pytest.raises(InputError, match=said):
        choose(in_unit(0.001), 2)
    assert choose(in_unit(0.005), 2).context == (0, 1)


def test_the_office_holds_out_what_its_input_views_cover(shared):
    """Frames 0 to 4 are close-ups of the table that 13 and 14 show with the room around it: seen best, but taken in another part of the walk. 12 and 15 are beside."""
    office = open_scene(shared / "data" / "hololens_office")
    for count, context, targets, notes in (
        (2, (13, 14), (12, 15), 1),
        (3, (13, 14, 15), (0, 12, 16), 1),
        (4, (12, 13, 14, 15), (0, 1), 0),
    ):
        choice = choose(office, count)
        assert (choice.context, choice.targets, len(choice.notes)) == (context, targets, notes)


def test_a_walk_that_comes_back_is_compared_with_frames_near_the_input_views():
    """Frames 0 and 14 are 10 cm apart, 13 is between them, and the twelve in between in file order see the same from 90 cm behind."""
    poses = [looking((0.0, 0.1, 0), (0.0, 0.1, 5), roll=0.0)]
    poses += [looking((0.05, 0.1, -0.9 - 0.01 * k), (0.05, 0.1, 5), roll=0.0) for k in range(12)]
    poses += [looking((0.05, 0.1, 0), (0.05, 0.1, 5), roll=0.0), looking((0.1, 0.1, 0), (0.1, 0.1, 5), roll=0.0)]
    bare = scene(poses)
    whole = replace(
        bare, frames=tuple(replace(one, depth=InMemory(np.full(LENS.size, 3.0, np.float32))) for one in bare.frames)
    )
    assert choose_named(whole, (0, 14)).targets == (13,)


def test_one_frame_that_can_be_held_out_gets_a_second_one_beside_the_input_views():
    """Input views 10 cm apart. 5 cm between them is held out, and of those beside them the nearest one, 6 cm away; not one 80 cm away."""
    assert choose_named(scene(beside(0.0, 0.05, 0.1, 0.24, 0.16)), (0, 2)).targets == (1, 4)
    assert choose_named(scene(beside(0.0, 0.05, 0.1, 0.9)), (0, 2)).targets == (1,)


def test_a_close_up_is_chosen_only_if_it_is_much_better():
    """Two pairs with baselines of 9 % and the same overlap, 1 m and 3 m from a wall. The middle of 1, 1, 3 and 3 m is 2 m: near ones count (1 / 1.9)^2."""

    def office(*walls: float) -> Scene:
        poses = [
            looking((x, 0.1, 0), (x, 0.1, 5), roll=0.0) for x in (0.0, 0.09 * walls[0], 50.0, 50.0 + 0.09 * walls[2])
        ]
        bare = scene(poses)
        return replace(
            bare,
            frames=tuple(
                replace(one, depth=InMemory(np.full(LENS.size, wall, np.float32)))
                for one, wall in zip(bare.frames, walls, strict=True)
            ),
        )

    assert choose(office(3.0, 3.0, 3.0, 3.0), 2).context == (0, 1), "the first of equal ones"
    assert choose(office(1.0, 1.0, 3.0, 3.0), 2).context == (2, 3)
    assert choose(office(3.0, 3.0, 1.0, 1.0), 2).context == (0, 1)
    # 2.9 m is above 95 % of the middle, 2.95 m.
    assert choose(office(2.9, 2.9, 3.0, 3.0), 2).context == (0, 1)


def test_all_frames_may_be_contexts():
    assert choose(scene(beside(0.0, 0.1, 0.2)), 3).targets == ()


@pytest.mark.parametrize("count", [-1, 0, 1, 4, 10**9])
def test_absurd_numbers_of_views_are_refused(count):
    with pytest.raises(ValueError, match="expected 2 to 3, the number of usable frames"):
        choose(scene(beside(0.0, 0.1, 0.2)), count)


@pytest.mark.parametrize(
    ("context", "message"), [((1,), "2 to 3"), ((1, 1), "different"), ((0, 3), "no frame 3"), ((0, "x.png"), "x.png")]
)
def test_contexts_that_cannot_be_are_refused(context, message):
    with pytest.raises(ValueError, match=message):
        choose_named(scene(beside(0.0, 0.1, 0.2)), context)


def test_named_contexts_are_taken_in_the_order_given():
    choice = choose_named(scene(beside(0.0, 0.1, 0.2)), ("0002.png", 0))
    assert choice.context == (2, 0)
    assert choice.targets == (1,)


def test_the_reason_has_the_figures():
    reason = choose_named(scene(beside(0.0, 0.1)), (0, 1)).reason
    for part in ("0 (0000.png), 1 (0001.png)", "share 9", "middle depth of 2.2 m", "0.22 m (10% of it)"):
        assert part in reason
    assert "no parallax" not in reason


def test_a_camera_that_only_turns_is_told_to_have_no_parallax():
    turning = [looking((1, 2, 3), (1 + step, 2, 8)) for step in (0.0, 0.3, 0.6)]
    assert "no parallax" in choose(scene(turning), 2).reason


def test_thousands_of_frames_are_no_burden():
    choice = choose(scene(beside(*np.linspace(0, 20, 3000))), 3)
    relative = np.diff(choice.context) * 20 / 2999
    assert ((relative > 0.05) & (relative < 0.15)).all()


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("hololens_office", 2),
        pytest.param("hololens_office", 4, marks=pytest.mark.long),
        ("small_house/living", 3),
        pytest.param("fox", 2, marks=pytest.mark.long),
        pytest.param("fox", 3, marks=pytest.mark.long),
    ],
)
def test_real_scenes_get_views_that_belong_together(shared, name, count):
    real = open_scene(shared / "data" / name)
    choice = choose(real, count)
    assert len(choice.context) == count
    assert choice.targets
    middle = real.depth_range().middle
    centres = np.stack([real.frames[n].world_from_camera[:3, 3] for n in choice.context])
    distances = np.linalg.norm(centres[:, None] - centres, axis=-1) + 9 * np.eye(count)
    assert ((distances.min(axis=1) / middle > 0.03) & (distances.min(axis=1) / middle < 0.2)).all()
    if name != "fox":
        assert " m " in choice.reason


def test_frames_for_training_are_drawn_by_what_they_share():
    away = looking((0.1 * MIDDLE, 0.1, 0), (0.1 * MIDDLE, 0.1, -5))
    room = scene([*beside(*np.arange(0, 0.6, 0.02)), away])
    bounds = room.depth_range()
    baselines, seen = [], set()
    for draw in range(60):
        choice = draw_sample(room, bounds, 3, 2, np.random.default_rng(draw))
        assert (len(set(choice.context)), len(set(choice.targets))) == (3, 2)
        assert not set(choice.context) & set(choice.targets)
        seen |= {*choice.context, *choice.targets}
        if 30 not in choice.context:
            assert 30 not in choice.targets
            baselines += list(0.02 * np.diff(choice.context))
    assert len(seen) > 25, "all frames have their turn"
    assert 0.05 < np.median(baselines) < 0.15, "the baselines are those that choose prefers"


def test_targets_lie_between_the_contexts_and_around_them():
    room = scene(beside(*np.arange(0, 0.6, 0.02)))
    bounds = room.depth_range()
    inside = []
    for draw in range(40):
        choice = draw_sample(room, bounds, 2, 2, np.random.default_rng(draw))
        inside += [min(choice.context) < target < max(choice.context) for target in choice.targets]
    assert 0.05 < np.mean(inside) < 0.8


def test_the_same_numbers_draw_the_same_frames_and_few_frames_are_all_drawn():
    room = scene(beside(0.0, 0.1, 5.0, 9.0))
    bounds = room.depth_range()
    one, two = (draw_sample(room, bounds, 2, 2, np.random.default_rng(4)) for _ in range(2))
    assert one == two
    assert sorted((*one.context, *one.targets)) == [0, 1, 2, 3]
    with pytest.raises(InputError, match="at least 5 usable frames, for 3 input views and 2 to compare with, found 4"):
        draw_sample(room, bounds, 3, 2, np.random.default_rng(4))


def test_the_nearest_in_file_order_alternate_and_one_side_fills_for_the_other():
    assert frames_around(3, 8, 5) == (2, 4, 1, 5, 0)
    assert frames_around(3, 8, 5, forward=True) == (4, 2, 5, 1, 6)
    assert frames_around(1, 8, 4) == (0, 2, 3, 4)
    assert frames_around(0, 2, 1) == (1,)


def test_consecutive_frames_are_a_target_the_contexts_around_it_and_targets_beside_them():
    """Of eight frames, whatever they see: N = 2 with one target more is t-1, t+1 and t-2 or t+2 (0 or 7 at the ends fill in order)."""
    room = scene(beside(*np.arange(0, 0.8, 0.1)))
    found = set()
    for draw in range(60):
        choice = draw_consecutive(room, room.depth_range(), 2, 2, np.random.default_rng(draw))
        found.add((choice.context, choice.targets))
    inner = {((t - 1, t + 1), targets) for t in range(2, 6) for targets in ((t - 2, t), (t, t + 2))}
    ends = {((0, 2), (1, 3)), ((5, 7), (4, 6))}
    assert found == inner | ends
    four = draw_consecutive(room, room.depth_range(), 4, 1, np.random.default_rng(0))
    (target,) = four.targets
    assert sorted((*four.context, target)) == list(range(min(four.context), min(four.context) + 5))


def test_consecutive_frames_need_as_many_and_an_inner_one():
    room = scene(beside(0.0, 0.1))
    with pytest.raises(
        InputError, match="at least 3 usable frames, for 1 input views around one to compare with, found 2"
    ):
        draw_consecutive(room, room.depth_range(), 1, 1, np.random.default_rng(0))

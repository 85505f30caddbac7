"""Choice of all frames that add something, worked out by hand for cameras side by side in front of a plane."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from landmarks import looking

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.cameras.lens import Lens
from semgs.data.choosing.coverage import A_FEW, choose_covering, windows_of
from semgs.data.frames import Frame
from semgs.data.scene import Scene
from semgs.files.errors import InputError

LENS = Lens((100, 100), (100.0, 100.0), (50.0, 50.0))
MIDDLE = 5**0.5
"""The middle depth of a metric scene, which is assumed for all: of 0.5 and 10 m. There, an image shows as much to each side as the plane is away."""


def beside(*places: float) -> Scene:
    """Cameras side by side that look the same way, at these parts of what an image shows."""
    poses = [looking((place * MIDDLE, 0.1, 0), (place * MIDDLE, 0.1, 5)) for place in places]
    frames = tuple(Frame(f"{n:02d}.png", Path("nowhere"), LENS, pose) for n, pose in enumerate(poses))
    return Scene(Path("nowhere"), "scene", "transforms.json", "metric", frames)


@pytest.mark.parametrize(
    ("frames", "held"), [(3, ()), (4, (2,)), (8, (4,)), (9, (2, 6)), (12, (3, 9)), (16, (4, 12)), (17, (2, 8, 14))]
)
def test_one_of_eight_frames_is_held_out_and_none_below_four(frames: int, held: Sequence[int]):
    """Of n frames, ceil(n / 8) in the middles of as many equal parts."""
    choice = choose_covering(beside(*np.linspace(0, 0.5, frames)), None)
    assert choice.targets == held
    others = tuple(number for number in range(frames) if number not in held)
    assert choice.context == others or len(choice.context) >= A_FEW


def test_a_few_frames_are_all_used_but_for_one_from_the_place_of_another():
    choice = choose_covering(beside(0.0, 0.1, 0.2, 0.3, 0.1001, 0.4), None)
    assert choice.targets == (3,)
    assert choice.context in [(0, 1, 2, 5), (0, 2, 4, 5)]
    (left,) = set(range(6)) - {3, *choice.context}
    assert choice.notes == (f"Not needed, because the input views show the same: {left:02d}.png.",)


def test_of_many_frames_each_part_is_seen_by_three():
    """33 frames over 1.6 images: 5 are held out, and 12 of the other 28 are used in any case. By 0.9 of an image more, a point has (0.9 / 0.05) = 18 frames around it,
    of which three are enough, so far fewer than 28 are used."""
    choice = choose_covering(beside(*np.linspace(0, 1.6, 33)), None)
    assert len(choice.targets) == 5
    assert A_FEW <= len(choice.context) <= 14
    assert {0, 32} <= set(choice.context)


def test_with_a_limit_the_frames_that_add_most_are_used():
    """Two images show 0 to 1.1 between them, and 0 to 2 with a third, from 1: it adds more than those between."""
    scene = beside(0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    choice = choose_covering(scene, 3)
    assert len(choice.context) == 3
    assert {0, 6} & set(choice.context)
    (note,) = choice.notes
    assert note.startswith("Left out, although they add something: ")
    assert "at most 3 input views are used; --all uses" in note


def test_two_parts_of_a_room_that_share_nothing_are_both_used():
    choice = choose_covering(beside(0.0, 0.1, 0.2, 0.3, 30.0, 30.1, 30.2), None)
    assert choice.targets == (3,)
    assert choice.context == (0, 1, 2, 4, 5, 6)


def test_frames_that_cannot_be_used_are_left_out_and_named():
    def why_not(position: int, bounds: DepthRange) -> str | None:
        return "its image is black" if position in (1, 2) else None

    choice = choose_covering(beside(0.0, 0.1, 0.2, 0.3), None, why_not)
    assert choice.context == (0, 3)
    assert choice.targets == ()
    assert set(choice.notes) == {f"Left out: {name} (its image is black)." for name in ("01.png", "02.png")}
    with pytest.raises(InputError, match="at least two usable frames that overlap, found none: its image is black"):
        choose_covering(beside(0.0, 0.1, 0.2), None, lambda position, bounds: "its image is black")


def test_frames_of_which_no_two_overlap_are_refused():
    with pytest.raises(InputError, match="expected two frames that share 30% of what they see, found 0% at most"):
        choose_covering(beside(0.0, 10.0, 20.0, 30.0), None)
    alone = choose_covering(beside(0.0, 0.1, 0.2, 0.3, 50.0), None)
    assert "Left out: 04.png. No input view shares 30% of what they see." in alone.notes


def test_a_window_has_the_frame_and_the_two_that_go_best_with_it():
    """A baseline of a twelfth of the depth is best. That of frame 0 is nearest to it with frames 1 and 2; that of frame 3 with 2 and 1."""
    scene = beside(0.0, 0.08, 0.17, 0.26)
    assert windows_of(scene, range(4), MIDDLE)[0] == (0, 1, 2)
    assert windows_of(scene, range(4), MIDDLE)[3] == (1, 2, 3)
    # A frame that shares nothing has the nearest ones, since it must have some.
    assert windows_of(beside(0.0, 0.1, 0.2, 9.0), range(4), MIDDLE)[3] == (1, 2, 3)


@pytest.mark.parametrize(("step", "far"), [(0.2, False), (0.4, True)])
def test_photos_that_are_far_apart_for_their_depth_are_told(step: float, far: bool):
    """An image shows as much as the plane is away, so a step of 0.4 images is 40 % of the depth; the limit is 30 %."""
    choice = choose_covering(beside(0.0, step, 2 * step), None)
    assert [note.split(" than")[0] for note in choice.notes] == ["The photos are far apart: 3 of 3 stand more"] * far


def test_one_photo_apart_from_the_others_is_no_news():
    choice = choose_covering(beside(0.0, 0.1, 0.5), None)
    assert choice.context == (0, 1, 2)
    assert not choice.notes

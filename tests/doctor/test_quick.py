"""The quick test before a reconstruction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgs.data.demo_scene import demo_scene
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.doctor import quick
from semgs.doctor.diagnosis import Finding, diagnose
from semgs.doctor.mistakes import INVERSE_DEPTH
from semgs.doctor.quick import FEATURES, frames_to_test, quick_test


def warnings_of(*arguments, **named) -> list[str]:
    return list(quick_test(*arguments, **named).warnings)


def test_it_warns_of_inverted_poses_and_says_nothing_of_good_ones():
    scene = open_scene(demo_scene())
    assert warnings_of(scene, (1, 3, 2)) == []
    inverted = tuple(replace(frame, world_from_camera=np.linalg.inv(frame.world_from_camera)) for frame in scene.frames)
    (warning,) = warnings_of(replace(scene, frames=inverted), (1, 3, 2))
    assert warning.startswith("The cameras may be wrong.")
    assert "poses inverted" in warning


def turned(scene: Scene, degrees: dict[int, float]) -> Scene:
    """The scene with some cameras turned up by so many degrees."""
    frames = list(scene.frames)
    for position, angle in degrees.items():
        turn, sine, cosine = np.eye(4), np.sin(np.radians(angle)), np.cos(np.radians(angle))
        turn[1:3, 1:3] = [[cosine, -sine], [sine, cosine]]
        frames[position] = replace(frames[position], world_from_camera=frames[position].world_from_camera @ turn)
    return replace(scene, frames=tuple(frames))


def test_of_slightly_wrong_cameras_it_says_what_the_doctor_says_unless_they_were_refined():
    """Turned by 0.5 and 1.0 degrees, two of three cameras miss matches by 245 tan 0.5 = 2.1 px to 4.3 px: all three pairs do."""
    scene = turned(open_scene(demo_scene()), {1: 0.5, 3: 1.0})
    (warning,) = warnings_of(scene, (1, 3, 2))
    found = diagnose(scene, (1, 3, 2), FEATURES)
    assert (found.verdict, warning) == ("slightly wrong", found.without_options)
    assert found.sentence == f"{warning} semgs reconstruct corrects such cameras."
    assert warnings_of(scene, (1, 3, 2), refined=True) == []


def test_two_of_three_pairs_are_too_few_to_call_cameras_slightly_wrong():
    """The third pair, of the cameras that are as they were, fits."""
    scene = turned(open_scene(demo_scene()), {1: 0.5})
    assert diagnose(scene, (1, 3, 2), FEATURES).verdict == "slightly wrong"
    assert warnings_of(scene, (1, 3, 2)) == []


def test_it_warns_of_inverse_depth_unless_the_user_says_so(monkeypatch: pytest.MonkeyPatch):
    scene = open_scene(demo_scene())
    fits = diagnose(scene, (1, 3, 2), FEATURES)
    found = replace(fits, verdict="suspicious", findings=(Finding(INVERSE_DEPTH, 0.4, fits.given),))
    monkeypatch.setattr(quick, "diagnose", lambda *_: found)
    (warning,) = warnings_of(scene, (1, 3, 2))
    assert warning.startswith("The depth maps may be wrong.")
    assert warnings_of(scene, (1, 3, 2), inverse=True) == []


def test_it_says_that_photos_lie_on_their_side(tmp_path: Path):
    """As a phone held upright stores them: the pixels lie, EXIF says how to show them, and COLMAP made cameras for the pixels."""
    scene = open_scene(demo_scene())
    exif = Image.Exif()
    exif[0x0112] = 6
    frames = list(scene.frames)
    for position in (1, 3):
        with Image.open(str(frames[position].picture)) as image:
            image.save(tmp_path / f"{position}.png", exif=exif)
        frames[position] = replace(frames[position], picture=tmp_path / f"{position}.png")
    (warning,) = warnings_of(replace(scene, frames=tuple(frames)), (1, 3, 2))
    assert warning.startswith("Photos lie on their side, as EXIF says, and so do their cameras (2 of 3 tested).")


@pytest.mark.parametrize(
    ("chosen", "count", "tested"),
    [
        ((3, 1), 4, (3, 1, 0, 2)),
        ((5, 1), 6, (5, 1, 0, 2, 3, 4)),
        ((1, 3, 2, 0), 6, (1, 3, 2, 0, 4, 5)),
        (tuple(range(9)), 20, (0, 1, 2, 3, 4, 5)),
    ],
)
def test_six_frames_are_tested_however_few_are_used(chosen: tuple[int, ...], count: int, tested: tuple[int, ...]):
    assert frames_to_test(chosen, count) == tested


def test_two_and_four_views_of_a_scene_get_the_same_warning():
    """Cameras with focal lengths of images of twice the size: of six frames, all are tested whichever are used."""
    scene = open_scene(demo_scene())
    doubled = [
        replace(frame, lens=replace(frame.lens, focal=tuple(2 * side for side in frame.lens.focal)))
        for frame in scene.frames[:6]
    ]
    wrong = replace(scene, frames=tuple(doubled))
    two, four = (warnings_of(wrong, frames_to_test(chosen, 6)) for chosen in ((1, 3), (0, 2, 4, 5)))
    assert two == four
    assert "focal length" in two[0]


def test_cameras_may_be_refined_unless_matches_fit_or_a_mistake_is_found():
    """Depth maps that agree say nothing: the demo's do, and with each camera turned by 0.5 degrees more, matches miss by 2.1 px and more."""
    scene = open_scene(demo_scene())
    assert quick_test(scene, (1, 3, 2)).fits
    assert not quick_test(turned(scene, {1: 0.5, 3: 1.0}), (1, 3, 2)).fits
    inverted = tuple(replace(frame, world_from_camera=np.linalg.inv(frame.world_from_camera)) for frame in scene.frames)
    assert quick_test(replace(scene, frames=inverted), (1, 3, 2)).fits

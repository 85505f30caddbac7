"""The included room: its cameras fit, and mistakes in them are named from its images."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_mistakes import PLANTED

from semgs.data.demo_scene import demo_scene
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.doctor.diagnosis import Evidence, diagnose, judge_cameras
from semgs.doctor.misses import misses
from semgs.doctor.rig import rig_of
from semgs.sfm.matches import MOST_MATCHES, Matches, find_matches


@pytest.fixture(scope="module")
def scene() -> Scene:
    return open_scene(demo_scene())


@pytest.fixture(scope="module")
def matches(scene: Scene) -> Matches:
    return find_matches(scene)


def test_matches_of_the_room_fit_its_cameras_and_its_depth(scene: Scene, matches: Matches):
    assert len(matches.pairs) >= 7
    assert np.bincount(matches.pair).max() <= MOST_MATCHES
    assert matches.measured
    rig = rig_of(scene.frames)
    assert np.median(misses(rig, matches.without_depth())) < 1
    assert np.median(misses(rig, matches)) < 1.5
    assert judge_cameras(rig, Evidence(matches), scene.layout, [frame.name for frame in scene.frames]).verdict == "good"


@pytest.mark.long
@pytest.mark.parametrize(
    "number", [0, 4, 9, 12, *(pytest.param(number, marks=pytest.mark.long) for number in (1, 2, 3, 5, 10, 11))]
)
def test_mistakes_in_its_cameras_are_named(scene: Scene, matches: Matches, number: int):
    planted = PLANTED[number]
    wrong = planted.make(rig_of(scene.frames), np.random.default_rng(1))
    found = judge_cameras(wrong, Evidence(matches), scene.layout, [frame.name for frame in scene.frames])
    assert found.finding is not None
    assert found.finding.mistake.name == planted.name


def test_images_of_different_places_say_nothing(scene: Scene):
    """One image twice does not move, so neither matches nor verdict remain; the depth maps agree with themselves."""
    frame = scene.frames[0]
    twice = replace(scene, frames=(replace(frame, depth=None), replace(frame, name="copy", depth=None)))
    found = diagnose(twice)
    assert found.verdict == "cannot tell"
    assert "Cannot tell" in found.sentence

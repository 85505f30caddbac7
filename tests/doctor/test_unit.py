"""What the doctor says about the unit of lengths: who says metres, and what contradicts them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from semgs.data.demo_scene import demo_scene
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.doctor.diagnosis import Diagnosis, Evidence, judge_cameras
from semgs.doctor.facts import UnitVerdict, judge_unit
from semgs.doctor.rig import rig_of
from semgs.sfm.matches import Matches, find_matches


@cache
def matches() -> Matches:
    """Matches between four frames of the included room, with their depth in metres."""
    return find_matches(open_scene(demo_scene()), (1, 2, 3, 4), 400)


def scaled(lengths: float = 1.0, points: float | None = None, **changes: object) -> Scene:
    """The included room with its positions multiplied by a number, and sparse points in front of each camera."""
    scene = open_scene(demo_scene())
    frames = []
    for frame in scene.frames:
        pose = frame.world_from_camera.copy()
        pose[:3, 3] *= lengths
        frames.append(replace(frame, world_from_camera=pose))
    made = replace(scene, frames=tuple(frames), **changes)
    if points is None:
        return made
    axes = np.stack([frame.world_from_camera for frame in frames])
    return replace(made, points=axes[:, :3, 3].repeat(9, axis=0) + points * axes[:, :3, 2].repeat(9, axis=0))


def found(scene: Scene, depth: float = 1.0) -> Diagnosis:
    """What is known about the cameras of a scene if its depth maps are the room's, multiplied by a number."""
    evidence = Evidence(replace(matches(), depths=depth * matches().depths))
    names = [frame.name for frame in scene.frames]
    return judge_cameras(rig_of(scene.frames), evidence, scene.layout, names, metric=scene.unit == "metric")


def verdict(scene: Scene, depth: float = 1.0) -> UnitVerdict:
    """What the doctor says about the unit."""
    return judge_unit(scene, found(scene, depth))


def test_metres_of_a_room_are_said_by_the_file_and_fit():
    said = verdict(scaled())
    assert said.said == "metres: the file says so"
    assert said.seen.startswith("what is seen is ")
    assert said.seen.endswith(" m away, as in a room")
    assert not said.doubtful


@pytest.mark.parametrize("unit", ["metric", "unknown"])
@pytest.mark.parametrize("factor", [5.0, 0.5])
def test_depth_maps_that_differ_from_parallax_contradict_metres_and_any_other_unit(factor: float, unit: str):
    said = verdict(scaled(unit=unit), factor)
    assert said.said.startswith("metres" if unit == "metric" else "unknown")
    assert said.doubtful
    words = said.seen.split()
    assert words[:4] == ["contradicted:", "depth", "maps", "are"]
    assert float(words[4]) == pytest.approx(factor, rel=0.03)


def test_sparse_points_count_too():
    """Parallax puts the room about 2 m away: points at 3 m may be others, at 20 m they are in another unit."""
    assert not verdict(scaled(points=3.0)).doubtful
    assert verdict(scaled(points=20.0)).seen.startswith("contradicted: sparse points are ")


def test_a_metric_room_of_a_tenth_is_in_doubt_and_a_scene_of_unknown_unit_is_not():
    said = verdict(scaled(0.1), 0.1)
    assert said.seen.startswith("in doubt: what is seen is 0.")
    assert said.seen.endswith(" m away in the median, in rooms it is 0.4 to 15 m")
    assert said.doubtful
    assert verdict(scaled(0.1, unit="unknown"), 0.1) == UnitVerdict("unknown: lengths are in the scene's own unit")


def test_cameras_that_do_not_fit_say_nothing():
    scene = scaled()
    turned = [replace(frame, world_from_camera=np.linalg.inv(frame.world_from_camera)) for frame in scene.frames]
    inverted = replace(scene, frames=tuple(turned))
    assert verdict(inverted, np.nan) == UnitVerdict("metres: the file says so")
    assert verdict(replace(inverted, unit_source="you say so"), np.nan) == UnitVerdict("metres: you say so")


@pytest.mark.parametrize("factor", [0.2, 4.0])
def test_depth_in_another_usual_unit_is_named_with_its_factor(factor: float):
    said = found(scaled(), 1 / factor)
    assert said.verdict == "suspicious"
    assert f"wrong unit of depth (it fits if it is multiplied by {factor:g}; see --depth-unit)" in said.sentence

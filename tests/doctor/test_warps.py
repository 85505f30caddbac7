"""Depth maps of a corner of a room, without any texture: cameras are tested on depth alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from planted_mistakes import PLANTED, Planted
from test_mistakes import NAMES, seen, walk

from semgs.doctor.diagnosis import Evidence, judge_cameras
from semgs.doctor.rig import Rig
from semgs.doctor.warps import CAP_PERCENT, DepthView, warp_error
from semgs.sfm.matches import Matches

SIZE = (24, 32)
NO_MATCHES = Matches(
    np.zeros((0, 2), int), np.zeros(0, int), np.zeros((0, 2, 2)), np.zeros((0, 2)), np.zeros((0, 2))
)  # fmt: skip


def small_walk() -> Rig:
    """The walk with images of 32x24."""
    rig = walk()
    return replace(rig, focal=rig.focal / 10, centre=rig.centre / 10, sizes=rig.sizes / 10)


def corner(rig: Rig) -> tuple[DepthView, ...]:
    """Each camera's depth of three planes, each 2 to 4 m in front of the first camera."""
    first = rig.poses[0]
    rows, columns = np.indices(SIZE) + 0.5
    views = []
    for index, pose in enumerate(rig.poses):
        pixels = np.stack((columns, rows), axis=-1)
        rays = np.concatenate(((pixels - rig.centre[index]) / rig.focal[index], np.ones((*SIZE, 1))), axis=-1)
        depths = np.full(SIZE, np.inf)
        for normal, far in (((0.2, 0.1, 1.0), 3.0), ((1.0, 0.1, 0.5), 2.0), ((-0.2, 1.0, 0.4), 1.5)):
            world = first[:3, :3] @ normal
            distance = far - world @ (pose[:3, 3] - first[:3, 3])
            along = rays @ pose[:3, :3].T @ world
            depths = np.where(along > 1e-6, np.minimum(depths, distance / np.maximum(along, 1e-6)), depths)
        points = np.column_stack((pixels.reshape(-1, 2), depths.ravel()))
        views.append(DepthView(index, points, depths.astype(np.float32), np.eye(3)))
    return tuple(views)


def test_true_cameras_agree_about_depth_up_to_the_size_of_a_pixel():
    rig = small_walk()
    assert warp_error(rig, corner(rig)) < 1


@pytest.mark.long
@pytest.mark.parametrize("number", [0, 1, 3, 5, 8, 9, 10])
def test_mistakes_are_named_from_depth_alone(number: int):
    rig = small_walk()
    planted: Planted = PLANTED[number]
    evidence = Evidence(NO_MATCHES, corner(rig))
    found = judge_cameras(planted.make(rig, np.random.default_rng(0)), evidence, "transforms.json", NAMES)
    assert found.error > 5
    assert found.finding is not None
    assert found.finding.mistake.name == planted.name
    assert found.finding.error < 1
    assert "depth maps disagree by" in found.sentence


def test_frames_that_do_not_overlap_count_as_complete_disagreement():
    rig = small_walk()
    away = rig.poses.copy()
    away[1::2] = away[1::2] @ np.diag([-1.0, 1, -1, 1])
    assert warp_error(replace(rig, poses=away), corner(rig)) == CAP_PERCENT


def test_a_frame_without_pose_is_left_out_and_without_half_of_them_nothing_counts():
    rig = small_walk()
    poses = rig.poses.copy()
    poses[0] = np.nan
    assert warp_error(replace(rig, poses=poses), corner(rig)) < 1
    poses[1::2] = np.nan
    assert warp_error(replace(rig, poses=poses), corner(rig)) == np.inf


def test_depth_twice_as_large_disagrees_by_how_the_cameras_approach():
    """A camera 0.5 m nearer to a wall 2 m away expects 2 - 0.5 / 2 where it measures 1.5, in half of the unit: 1.75 / 1.5 - 1."""
    rig = Rig(
        np.tile(np.eye(4), (2, 1, 1)), np.full((2, 2), 20.0), np.tile((16.0, 12.0), (2, 1)), np.tile((32.0, 24.0), (2, 1)), 2.0
    )  # fmt: skip
    rig.poses[1, 2, 3] = 0.5
    middle = np.array([[16.0, 12.0, 2.0]])
    views = (
        DepthView(0, middle, np.full(SIZE, 2, np.float32), np.eye(3)),
        DepthView(1, middle - [0, 0, 0.5], np.full(SIZE, 1.5, np.float32), np.eye(3)),
    )
    assert warp_error(rig, views) == pytest.approx(100 * (abs(3.5 / 3 - 1) + abs(3.5 / 4 - 1)) / 2)


def test_matches_of_repeated_texture_raise_no_alarm_if_depth_maps_agree():
    """Matches as if the camera had hardly moved, as of a pattern that repeats: only without depth maps are they believed."""
    rig = small_walk()
    poses = rig.poses.copy()
    poses[:, :3, 3] /= 1000
    wrong = seen(replace(rig, poses=poses))
    assert judge_cameras(rig, Evidence(wrong), "transforms.json", NAMES).verdict == "suspicious"
    found = judge_cameras(rig, Evidence(wrong, corner(rig)), "transforms.json", NAMES)
    assert found.verdict == "good"
    assert "The cameras fit: depth maps agree to 0." in found.sentence
    assert "the matches may be wrong" in found.sentence


def test_depth_maps_that_disagree_slightly_get_no_advice_that_needs_matches():
    rig = small_walk()
    poses = rig.poses.copy()
    poses[:, :3, 3] += np.random.default_rng(0).normal(0, 0.02, (len(poses), 3))
    found = judge_cameras(replace(rig, poses=poses), Evidence(NO_MATCHES, corner(rig)), "transforms.json", NAMES)
    assert 1 < found.error < 5
    assert found.verdict == "slightly wrong"
    assert (
        found.sentence
        == f"The cameras or the depth maps are slightly wrong: depth maps disagree by {found.error:.1f} %."
    )

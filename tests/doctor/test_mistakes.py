"""Each usual mistake is named from matches alone: points in a room, seen by six cameras that walk and turn."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from planted_mistakes import PLANTED, Planted
from scipy.spatial.transform import Rotation

from semgs.doctor.diagnosis import Diagnosis, Evidence
from semgs.doctor.diagnosis import judge_cameras as judged_on
from semgs.doctor.misses import fit_disparity, miss, misses, pair_misses, triangulated_depth
from semgs.doctor.mistakes import ALONG_RAY, BAD_DEPTH, INVERSE_DEPTH, MILLIMETRES
from semgs.doctor.rig import FileConvention, Rig, inverse
from semgs.sfm.matches import Matches

NAMES = [f"frame{index}.jpg" for index in range(8, 14)]
POINTS = 14


def walk(step: float = 0.3, turn: float = 0.12) -> Rig:
    """Six cameras of 320x240 on a curve; principal point and focal lengths are unlike in both directions."""
    count = len(NAMES)
    poses = np.tile(np.eye(4), (count, 1, 1))
    along = np.arange(count)
    angles = np.column_stack((0.5 + 0.02 * along**2, -0.3 + turn * along, 0.2 - 0.03 * along))
    poses[:, :3, :3] = Rotation.from_euler("xyz", angles).as_matrix()
    poses[:, :3, 3] = np.column_stack((1 + step * along, 2 + 0.2 * step * along**1.5, -0.5 + 0.3 * step * along))
    return Rig(
        poses, np.tile((250.0, 285.0), (count, 1)), np.tile((150.0, 126.0), (count, 1)), np.tile((320.0, 240.0), (count, 1))
    )  # fmt: skip


def seen(rig: Rig, *, depth: bool = True, seed: int = 0, count: int = POINTS) -> Matches:
    """True matches of all pairs: points 1.5 to 4 m in front of the first camera, wherever they are in the other."""
    rng = np.random.default_rng(seed)
    pairs = np.array(list(combinations(range(len(rig.poses)), 2)))
    points, depths = [], []
    for i, j in pairs:
        a = rng.uniform(0, 1, (count, 2)) * rig.sizes[i]
        z = rng.uniform(1.5, 4, count)
        there = np.column_stack(((a - rig.centre[i]) / rig.focal[i], np.ones(count))) * z[:, None]
        motion = np.linalg.inv(rig.poses[j]) @ rig.poses[i]
        there = there @ motion[:3, :3].T + motion[:3, 3]
        b = there[:, :2] / there[:, 2:] * rig.focal[j] + rig.centre[j]
        points.append(np.stack((a, b), axis=1))
        depths.append(np.column_stack((z, there[:, 2])))
    measured = np.concatenate(depths) if depth else np.full((len(pairs) * count, 2), np.nan)
    return Matches(
        pairs, np.repeat(np.arange(len(pairs)), count), np.concatenate(points), measured, np.ones((len(pairs) * count, 2))
    )  # fmt: skip


def judge_cameras(rig: Rig, matches: Matches) -> Diagnosis:
    return judged_on(rig, Evidence(matches), "transforms.json", NAMES)


def named(rig: Rig, matches: Matches) -> str:
    found = judge_cameras(rig, matches)
    return found.finding.mistake.name if found.finding else found.verdict


@pytest.mark.parametrize("depth", [True, False], ids=["measured", "unmeasured"])
def test_true_cameras_miss_nothing(depth: bool):
    rig = walk()
    matches = seen(rig, depth=depth)
    assert misses(rig, matches).max() < 1e-6
    assert named(rig, matches) == "good"


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
@pytest.mark.parametrize("planted", PLANTED, ids=lambda planted: planted.name)
def test_with_measured_depth_each_mistake_is_named_and_undone(planted: Planted, seed: int):
    rig = walk()
    matches = seen(rig)
    wrong = planted.make(rig, np.random.default_rng(seed))
    found = judge_cameras(wrong, matches)
    assert found.verdict == "suspicious"
    assert found.finding is not None
    assert found.finding.mistake.name == planted.name
    assert found.error > 2
    assert found.finding.error < 0.5  # a searched principal point or focal length is near, not exact
    assert miss(found.finding.rig, matches) == found.finding.error


@pytest.mark.long
@pytest.mark.parametrize("planted", PLANTED, ids=lambda planted: planted.name)
def test_without_depth_scale_cannot_be_told_and_the_rest_is_named(planted: Planted):
    rig = walk()
    matches = seen(rig, depth=False)
    wrong = planted.make(rig, np.random.default_rng(0))
    if "along the ray" in planted.name:
        assert named(wrong, matches) == "good"
    elif "millimetres" in planted.name or "unit of depth" in planted.name:
        found = judge_cameras(wrong, matches)
        assert found.verdict == "good"
        assert planted.name in [one.name for one in found.undecided]
    else:
        assert named(wrong, matches) == planted.name


def test_a_point_between_two_cameras_that_look_away_from_it_counts_as_nonsense():
    """The line through both images is right, but the point would be behind the cameras."""
    rig = walk()
    behind = rig.poses.copy()
    behind[:, :3, 3] *= -1  # E and -E have the same epipolar lines
    matches = seen(rig, depth=False)
    assert miss(replace(rig, poses=behind), matches) > 5


def test_the_miss_of_a_parallel_pair_is_the_distance_from_its_row():
    """Two cameras side by side: a match 3 px below its row is missed by 3 px, to the wrong side by its distance from the vanishing point."""
    rig = Rig(
        np.tile(np.eye(4), (2, 1, 1)), np.full((2, 2), 100.0), np.tile((31.0, 22.0), (2, 1)), np.tile((64.0, 48.0), (2, 1))
    )  # fmt: skip
    rig.poses[1, 0, 3] = 0.5
    points = np.array([[[40.0, 20], [30.0, 23]], [[40.0, 20], [46.0, 28]], [[40.0, 20], [18.0, 24]]])
    depths = np.array([[np.nan, np.nan], [np.nan, np.nan], [2.0, np.nan]])
    matches = Matches(np.array([[0, 1]]), np.zeros(3, int), points, depths, np.ones((3, 2)))
    # The third has depth: 100 px 0.5 m / 2 m = 25 px to the left, exactly: 3 px less, and 4 px down.
    np.testing.assert_allclose(misses(rig, matches), [3, 10, 5], atol=1e-9)
    np.testing.assert_allclose(pair_misses(rig, matches), [5])
    half = replace(matches, shrink=np.full((3, 2), 0.5))
    np.testing.assert_allclose(misses(rig, half), [1.5, 5, 2.5], atol=1e-9)


def test_parallax_gives_the_depth_of_matches():
    """Two cameras side by side, 0.5 m apart, with 100 px: a match 25 px further left is 2 m away, one 10 px further left 5 m."""
    rig = Rig(
        np.tile(np.eye(4), (2, 1, 1)), np.full((2, 2), 100.0), np.tile((31.0, 22.0), (2, 1)), np.tile((64.0, 48.0), (2, 1))
    )  # fmt: skip
    rig.poses[1, 0, 3] = 0.5
    points = np.array([[[40.0, 20], [15.0, 20]], [[50.0, 12], [25.0, 12]], [[40.0, 30], [30.0, 30]]])
    matches = Matches(np.array([[0, 1]]), np.zeros(3, int), points, np.full((3, 2), np.nan), np.ones((3, 2)))
    assert triangulated_depth(rig, matches) == pytest.approx(2)
    turned = walk()
    assert triangulated_depth(turned, seen(turned)) == pytest.approx(np.median(seen(turned).depths[:, 0]))


@pytest.mark.parametrize(("factor", "away"), [(1000, "2,907 m"), (100, "291 m")])
def test_positions_that_put_a_room_far_away_are_not_in_metres(factor: int, away: str):
    """Points are 1.5 to 4 m from the first camera; only a scene that says it is in metres shows it."""
    rig = walk()
    matches = seen(rig, depth=False)
    poses = rig.poses.copy()
    poses[:, :3, 3] *= factor
    far = replace(rig, poses=poses)
    found = judged_on(far, Evidence(matches), "transforms.json", NAMES, metric=True)
    assert found.verdict == "suspicious"
    assert found.finding is not None
    assert found.finding.mistake is MILLIMETRES
    np.testing.assert_allclose(found.finding.rig.poses[:, :3, 3] * factor, far.poses[:, :3, 3])
    assert f"put what they show {away}" in found.sentence
    assert MILLIMETRES in judged_on(far, Evidence(matches), "COLMAP", NAMES).undecided
    assert MILLIMETRES not in judged_on(rig, Evidence(matches), "transforms.json", NAMES, metric=True).undecided


def test_a_camera_that_only_turns_leaves_inverted_poses_wrong_and_scale_open():
    rig = walk(step=0.0)
    matches = seen(rig, depth=False)
    assert named(rig, matches) == "good"
    assert (
        named(PLANTED[0].make(rig, np.random.default_rng(0)), matches)
        == "poses inverted (world to camera for camera to world, or the reverse)"
    )


def test_a_camera_that_neither_moves_nor_turns_decides_nothing():
    rig = walk(step=0.0, turn=0.0)
    still = replace(rig, poses=np.tile(rig.poses[:1], (len(NAMES), 1, 1)))
    found = judge_cameras(PLANTED[0].make(still, np.random.default_rng(0)), seen(still))
    assert found.verdict == "good"
    assert len(found.undecided) >= 12


def test_without_matches_nothing_can_be_told():
    none = Matches(np.zeros((0, 2), int), np.zeros(0, int), np.zeros((0, 2, 2)), np.zeros((0, 2)), np.zeros((0, 2)))
    assert judge_cameras(walk(), none).verdict == "cannot tell"


def test_images_sorted_as_text_are_named():
    """Frames 8 to 13 as text: 10, 11, 12, 13, 8, 9."""
    rig = walk()
    wrong = replace(rig, poses=rig.poses[[2, 3, 4, 5, 0, 1]])
    assert named(wrong, seen(rig)) == "images sorted as text (10 before 9)"


def test_depth_of_another_place_is_named_if_the_images_alone_fit():
    rig = walk()
    matches = seen(rig)
    shuffled = np.random.default_rng(3).permuted(matches.depths, axis=0)
    assert named(rig, replace(matches, depths=shuffled)) == BAD_DEPTH.name


def test_a_distance_of_5_m_along_a_ray_of_slope_three_quarters_is_a_depth_of_4_m():
    """|(0.75, 0, 1)| = 1.25 and |(0.6, 0.8, 1)| = sqrt(2). In a unit of 2, depths are twice that."""
    rays = np.array([[0.75, 0.0], [0.6, 0.8]])
    rig = replace(walk(), along_ray=True)
    np.testing.assert_allclose(rig.z_depths(np.array([5.0, 3.0]), rays, 0), [4, 3 / 2**0.5])
    np.testing.assert_allclose(replace(rig, depth_unit=2.0).z_depths(np.array([5.0, np.nan]), rays, 0), [8, np.nan])


def test_distances_along_the_ray_are_named_and_nothing_else_is():
    rig = walk()
    matches = seen(rig)
    frames = matches.pairs[matches.pair]
    x, y = np.moveaxis((matches.points - rig.centre[frames]) / rig.focal[frames], -1, 0)
    found = judge_cameras(rig, replace(matches, depths=matches.depths * np.sqrt(x**2 + y**2 + 1)))
    assert [one.mistake for one in found.findings] == [ALONG_RAY]
    assert found.findings[0].error < 1e-6
    np.testing.assert_array_equal(found.findings[0].rig.focal, rig.focal)
    assert "divide each depth by |K^-1 (u, v, 1)|" in found.sentence


def test_disparity_becomes_depth_by_the_line_of_its_frame():
    """1 / z = 2 d + 0.1 in frame 0: 0.2 is 2 m. 1 / z = 4 d - 0.3 in frame 1: 0.2 is 2 m as well, and 0.05 is behind infinity. 0 is unknown."""
    rig = replace(walk(), disparity=np.array([[2, 0.1], *[[4, -0.3]] * 5]))
    depths = rig.z_depths(np.array([0.2, 0.2, 0.05, 0.0]), np.zeros((4, 2)), np.array([0, 1, 1, 1]))
    np.testing.assert_allclose(depths, [2, 2, 1e9, 0])


def test_inverse_depth_is_named_with_the_line_of_each_frame():
    """Numbers as of Depth Anything: each image has a scale and a shift of its own. A fifth of them is wrong."""
    rig, rng = walk(), np.random.default_rng(4)
    matches = seen(rig)
    lines = np.column_stack((rng.uniform(0.05, 0.1, 6), rng.uniform(-0.05, 0.05, 6)))
    scales, shifts = np.moveaxis(lines[matches.pairs[matches.pair]], -1, 0)
    disparity = (1 / matches.depths - shifts) / scales
    disparity[rng.random(disparity.shape) < 0.2] = 3.0
    found = judge_cameras(rig, replace(matches, depths=disparity))
    assert [one.mistake for one in found.findings] == [INVERSE_DEPTH]
    assert found.findings[0].rig.disparity is not None
    np.testing.assert_allclose(found.findings[0].rig.disparity, lines, atol=1e-6)
    assert "Likely mistake: depth maps that are inverse depth (disparity), 0.5 px when corrected. " in found.sentence
    assert found.sentence.endswith("or use semgs reconstruct --depth maps --depth-meaning inverse.")
    assert np.isnan(found.depth_ratio)
    assert "--depth" not in found.without_options
    rng.shuffle(disparity)
    assert fit_disparity(rig, replace(matches, depths=disparity)) is None
    assert fit_disparity(rig, matches) is None


@pytest.mark.parametrize("factor", [0.7, 1.3])
def test_depth_of_another_scale_is_not_blamed_on_a_focal_length_that_fits_the_images(factor: float):
    """Depth of 0.7 or 1.3 times what it is: no unit of depth explains it, and the cameras fit the images."""
    rig = walk()
    found = judge_cameras(rig, replace(seen(rig), depths=seen(rig).depths * factor))
    assert found.verdict == "suspicious"
    assert [one.mistake for one in found.findings] == [BAD_DEPTH]


def test_depth_that_is_slightly_wrong_is_not_blamed_on_the_cameras():
    rig = walk()
    found = judge_cameras(rig, replace(seen(rig), depths=seen(rig).depths * 1.03))
    assert found.verdict == "slightly wrong"
    assert "The cameras fit the images" in found.sentence
    assert "depth maps or the distances between cameras are slightly wrong" in found.sentence
    assert "corrects such cameras" not in found.sentence


def test_cameras_that_nothing_explains_are_suspicious():
    rig = walk()
    poses = rig.poses.copy()
    poses[:, :3, :3] = Rotation.random(len(NAMES), random_state=1).as_matrix()
    found = judge_cameras(replace(rig, poses=poses), seen(rig, count=20))
    assert (found.verdict, found.finding) == ("suspicious", None)
    assert "no usual mistake explains it" in found.sentence
    few = judge_cameras(replace(rig, poses=poses), seen(rig, count=19))
    assert few.verdict == "cannot tell"
    assert "the matches may be wrong" in few.sentence


def shaken(rig: Rig, degrees: float) -> Rig:
    """The rig with rotations that are off by about some degrees."""
    turns = Rotation.from_rotvec(np.radians(degrees) * np.random.default_rng(7).normal(size=(len(NAMES), 3)))
    poses = rig.poses.copy()
    poses[:, :3, :3] = turns.as_matrix() @ poses[:, :3, :3]
    return replace(rig, poses=poses)


@pytest.mark.parametrize(
    ("degrees", "low", "high", "verdict", "hint"),
    [(0.1, 0, 1, "good", False), (0.35, 1, 5, "slightly wrong", True), (2.0, 5, 20, "suspicious", False)],
)
def test_cameras_are_slightly_wrong_between_one_and_five_pixels(
    degrees: float, low: float, high: float, verdict: str, hint: bool
):
    rig = walk()
    found = judge_cameras(shaken(rig, degrees), seen(rig, depth=False, count=20))
    assert low < found.error <= high
    assert (found.verdict, found.finding) == (verdict, None)
    assert (
        ("slightly wrong" in found.sentence) == ("semgs reconstruct corrects such cameras." in found.sentence) == hint
    )
    assert ("The cameras fit" in found.sentence) == (verdict == "good")
    assert found.amount(found.error) in found.sentence


def test_matches_that_are_wrong_in_some_pairs_only_raise_no_alarm():
    """Of 15 pairs 4 fit the cameras: 11 of 15 is less than three quarters. If one more does not, the cameras are suspicious."""
    rig = walk()
    matches = seen(rig, depth=False, count=20)
    shuffled = np.random.default_rng(5).permuted(matches.points, axis=0)
    for right, verdict in ((4, "cannot tell"), (3, "suspicious")):
        points = np.where((matches.pair < right)[:, None, None], matches.points, shuffled)
        assert judge_cameras(rig, replace(matches, points=points)).verdict == verdict


def test_camera_to_world_poses_in_a_colmap_model_are_named():
    rig = walk()
    wrong = replace(rig, poses=inverse(rig.poses))  # COLMAP's reader has inverted what was camera to world
    found = judged_on(wrong, Evidence(seen(rig)), "COLMAP", NAMES)
    assert found.finding is not None
    assert found.finding.mistake.name.startswith("poses inverted (")
    np.testing.assert_allclose(found.finding.rig.poses, rig.poses, atol=1e-12)


@pytest.mark.parametrize("layout", ["transforms.json", "COLMAP", "ScanNet"])
def test_reading_is_the_inverse_of_writing(layout: str):
    poses = walk().poses
    convention = FileConvention.of(layout)
    np.testing.assert_allclose(convention.read(convention.written(poses)), poses, atol=1e-12)
    if layout == "COLMAP":
        np.testing.assert_allclose(convention.written(poses), inverse(poses))
    if layout == "transforms.json":
        np.testing.assert_allclose(convention.written(poses)[:, :, 2], -poses[:, :, 2])

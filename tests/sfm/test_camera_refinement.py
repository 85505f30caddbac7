"""Refining slightly wrong cameras."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
import torch
from posed import posed_cameras
from scipy.spatial.transform import Rotation

from semgs.data.demo_scene import demo_scene
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.geometry.cameras import Cameras, project
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.runtime.notes import for_page
from semgs.sfm import camera_refinement as module
from semgs.sfm.camera_refinement import MatchedRays, adjusted, epipolar_px, refine_cameras, sightings
from semgs.sfm.matches import Matches

SIZE = (480, 640)
FRAMES = (5, 1, 3)
"""Of the included room, not in the order of the file."""
SPACING = 0.4


def bundle(cameras: Cameras, points: int = 60, noise_px: float = 0.0, wrong: float = 0.0) -> MatchedRays:
    """Points 2 to 6 m before the cameras as every pair of them sees them, a share of them matched wrongly."""
    generator = np.random.default_rng(3)
    first = cameras.world_from_camera[0].numpy()
    inside = np.stack((*generator.uniform(-0.6, 0.6, (2, points)), np.ones(points)), axis=1)
    world = (inside * generator.uniform(2, 6, (points, 1))) @ first[:3, :3].T + first[:3, 3]
    pixels = project(torch.from_numpy(world).expand(*cameras.batch, -1, 3), cameras)[..., :2].numpy()
    pixels = pixels + noise_px * generator.normal(size=pixels.shape)
    k = cameras.intrinsics.numpy()
    rays = np.concatenate((pixels, np.ones((*pixels.shape[:2], 1))), axis=-1) @ np.linalg.inv(k).swapaxes(1, 2)
    pairs = np.array(list(combinations(range(len(k)), 2)))
    seen = rays[pairs].swapaxes(1, 2)  # pair, point, camera of the pair
    count = int(wrong * points)
    seen[:, :count, 1] = np.roll(seen[:, :count, 1], 1, axis=1)
    focal = np.repeat(k[pairs][:, :, (0, 1), (0, 1)], points, axis=0)
    return MatchedRays(np.repeat(pairs, points, axis=0).astype(np.int64), seen.reshape(-1, 2, 3), focal)


def relative_turns(poses: np.ndarray, true: np.ndarray) -> np.ndarray:
    """By how much the rotation between each pair of cameras is off [degrees]."""
    pairs = combinations(range(len(true)), 2)
    off = [poses[i, :3, :3].T @ poses[j, :3, :3] @ (true[i, :3, :3].T @ true[j, :3, :3]).T for i, j in pairs]
    return np.degrees(Rotation.from_matrix(off).magnitude())


def noisy(poses: np.ndarray, turn_deg: float, shift: float, generator: np.random.Generator) -> np.ndarray:
    """Cameras (world_from_camera, in the order of the path) that are off by an angle and a share of their mean distance."""
    axes, directions = generator.normal(size=(2, len(poses), 3))
    axes, directions = (one / np.linalg.norm(one, axis=1, keepdims=True) for one in (axes, directions))
    spacing = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1).mean()
    moved = poses.copy()
    moved[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_rotvec(np.radians(turn_deg) * axes).as_matrix()
    moved[:, :3, 3] += shift * spacing * directions
    return moved


def spoiled(scene: Scene, turn_deg: float, shift: float) -> Scene:
    """The scene with noise on the cameras of `FRAMES`."""
    order = sorted(FRAMES)
    poses = np.stack([scene.frames[index].world_from_camera for index in order])
    moved = noisy(poses, turn_deg, shift, np.random.default_rng(2))
    frames = list(scene.frames)
    for index, pose in zip(order, moved, strict=True):
        frames[index] = replace(frames[index], world_from_camera=pose)
    return replace(scene, frames=tuple(frames))


@pytest.fixture(scope="module")
def scene() -> Scene:
    """The included room."""
    return open_scene(demo_scene())


def test_a_match_3_px_below_its_epipolar_line_is_off_by_the_share_of_both_images():
    """Cameras side by side, the second ray 0.0125 lower: 0.0125 / sqrt(1 / 300^2 + 1 / 400^2) = 0.0125 * 240 = 3 px."""
    turn = matrix_from_quaternion(torch.tensor([0.8, 0.3, -0.5, 0.2], dtype=torch.float64)).numpy()
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :3, :3] = turn
    poses[:, :3, 3] = [[0.7, -1.1, 2.0], [0.7, -1.1, 2.0] + 0.3 * turn[:, 0]]
    rays = np.array([[[0.2, 0.1, 1.0], [0.05, 0.1125, 1.0]], [[0.2, -0.3, 1.0], [0.05, -0.3, 1.0]]])
    focal = np.tile([[250.0, 300.0], [270.0, 400.0]], (2, 1, 1))
    seen = MatchedRays(np.tile([[0, 1]], (2, 1)), rays, focal)
    np.testing.assert_allclose(np.abs(epipolar_px(poses, seen)), [3.0, 0.0], atol=1e-9)


def test_the_distance_is_that_by_which_the_pixels_have_to_move():
    """Along the gradient over all four coordinates, by the distance: nothing is left but the second order."""
    cameras = posed_cameras(2, SIZE)
    seen = bundle(cameras, noise_px=0.02)
    poses = cameras.world_from_camera.numpy()
    distance = epipolar_px(poses, seen)
    gradient = np.zeros((len(distance), 2, 2))
    for camera, axis in np.ndindex(2, 2):
        step = np.zeros_like(seen.rays)
        step[:, camera, axis] = 1e-6 / seen.focal[:, camera, axis]
        gradient[:, camera, axis] = (epipolar_px(poses, replace(seen, rays=seen.rays + step)) - distance) / 1e-6
    np.testing.assert_allclose((gradient**2).sum((1, 2)), 1, rtol=2e-3)
    rays = seen.rays.copy()
    rays[..., :2] -= distance[:, None, None] * gradient / seen.focal
    assert np.abs(epipolar_px(poses, replace(seen, rays=rays))).max() < 0.02 * np.abs(distance).max()


@pytest.mark.parametrize(("views", "left_deg"), [(2, 0.1), (4, 0.1)])
def test_1_degree_and_2_percent_of_noise_become_a_tenth_of_a_degree(views: int, left_deg: float):
    cameras = posed_cameras(views, SIZE)
    true = cameras.world_from_camera.numpy()
    given = noisy(true, 1.0, 0.02, np.random.default_rng(1))
    found = adjusted(given, bundle(cameras), SPACING)
    assert relative_turns(given, true).max() > 1
    assert relative_turns(found, true).max() < left_deg
    assert np.abs(epipolar_px(found, bundle(cameras))).max() < 0.2


def test_a_third_of_wrong_matches_does_little_harm():
    cameras = posed_cameras(3, SIZE)
    true = cameras.world_from_camera.numpy()
    given = noisy(true, 1.0, 0.02, np.random.default_rng(1))
    found = adjusted(given, bundle(cameras, wrong=0.33), SPACING)
    assert relative_turns(found, true).max() < 0.3 < 1 < relative_turns(given, true).max()


def test_the_mean_position_stays_and_no_camera_is_special():
    """Matches do not depend on where the world's origin is, so the shifts of the most probable cameras sum to zero."""
    cameras = posed_cameras(3, SIZE)
    true = cameras.world_from_camera.numpy()
    given = noisy(true, 1.0, 0.02, np.random.default_rng(1))
    seen = bundle(cameras)
    found = adjusted(given, seen, SPACING)
    turned = Rotation.from_matrix(found[:, :3, :3] @ given[:, :3, :3].mT).as_rotvec()
    moved = found[:, :3, 3] - given[:, :3, 3]
    assert np.linalg.norm(turned.mean(0)) < 0.4 * np.linalg.norm(turned, axis=1).mean()
    np.testing.assert_allclose(moved.mean(0), 0, atol=1e-6)
    assert np.linalg.norm(moved, axis=1).min() > 1e-3
    order = np.array([2, 0, 1])
    another = adjusted(given[order], replace(seen, cameras=np.argsort(order)[seen.cameras]), SPACING)
    np.testing.assert_allclose(another, found[order], atol=1e-4)


def test_a_match_and_a_usual_error_of_one_degree_weigh_the_same_if_a_degree_moves_it_by_a_pixel():
    """Cameras side by side see a point at infinity, straight ahead, at heights that differ by 0.1 sqrt(2) px: 0.1 px from the epipolar geometry.

    A degree is a pixel here. Pitching the cameras by s_1 and s_2 degrees leaves d = 0.1 - (s_1 - s_2) / sqrt(2), and d^2 + s_1^2 + s_2^2 is least
    where half of it is left: d = 0.05, s_1 = -s_2 = 0.05 / sqrt(2).
    """
    focal = 180 / np.pi
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[1, 0, 3] = SPACING
    rays = np.array([[[0, 0, 1.0], [0, 0.1 * np.sqrt(2) / focal, 1.0]]])
    seen = MatchedRays(np.array([[0, 1]]), rays, np.full((1, 2, 2), focal))
    found = adjusted(poses, seen, SPACING)
    np.testing.assert_allclose(np.abs([epipolar_px(one, seen)[0] for one in (poses, found)]), [0.1, 0.05], rtol=0.01)
    pitches = np.degrees(Rotation.from_matrix(found[:, :3, :3]).as_rotvec())
    np.testing.assert_allclose(np.abs(pitches), [[0.05 / np.sqrt(2), 0, 0]] * 2, atol=5e-4)
    assert pitches[0, 0] * pitches[1, 0] < 0


def test_matches_become_rays_of_the_frames_in_the_order_given(scene: Scene):
    """A point seen by frames 1 and 5 is on both their epipolar lines; the images were matched at half their size."""
    cameras = [scene.frames[index].camera for index in (1, 5)]
    point = torch.tensor([[0.1, -0.2, 2.0, 1.0]], dtype=torch.float64) @ cameras[0].world_from_camera.T
    pixels = np.stack([project(point[:, :3], camera)[0, :2].numpy() for camera in cameras])
    matches = Matches(np.array([[1, 5]]), np.array([0]), pixels[None], np.full((1, 2), np.nan), np.full((1, 2), 0.5))
    seen = sightings(scene, FRAMES, matches)
    assert seen.cameras.tolist() == [[1, 0]]
    np.testing.assert_allclose(seen.focal[0, 0], 0.5 * np.array(scene.frames[1].lens.focal))
    np.testing.assert_allclose(seen.rays[0, 0], [0.05, -0.1, 1.0], atol=1e-12)
    poses = np.stack([scene.frames[index].world_from_camera for index in FRAMES])
    assert abs(epipolar_px(poses, seen)[0]) < 1e-9


def test_good_cameras_stay_and_slightly_wrong_ones_are_corrected(scene: Scene):
    untouched = refine_cameras(scene, FRAMES)
    assert not untouched.accepted
    np.testing.assert_array_equal(untouched.poses, untouched.given)
    (sentence,) = untouched.notes()
    assert sentence.startswith("The cameras were left as they are:")
    true, wrong = untouched.given, spoiled(scene, 1.0, 0.02)
    found = refine_cameras(wrong, FRAMES)
    assert found.accepted
    assert found.after_px < 0.25 * found.before_px
    assert relative_turns(found.poses, true).mean() < 0.3 * relative_turns(found.given, true).mean()
    (sentence,) = found.notes()
    assert sentence.startswith(f"The cameras were refined on {found.matches} matches:")
    assert f"up to {max(found.turned_deg):.2f} degrees, and moved by up to {max(found.moved):.1%} of" in sentence
    assert for_page([sentence]) == [
        f"The cameras were slightly wrong and were corrected, by up to {max(found.turned_deg):.2f} degrees."
    ]
    applied = found.applied(wrong)
    np.testing.assert_array_equal(applied.frames[5].world_from_camera, found.poses[0])
    assert [applied.frames[index] is wrong.frames[index] for index in range(8)] == [
        index not in FRAMES for index in range(8)
    ]


def test_cameras_without_matches_or_baseline_are_left_alone(scene: Scene, monkeypatch: pytest.MonkeyPatch):
    here = scene.frames[1].world_from_camera[:3, 3]
    frames = list(scene.frames)
    for index in FRAMES:
        pose = frames[index].world_from_camera.copy()
        pose[:3, 3] = here
        frames[index] = replace(frames[index], world_from_camera=pose)
    fixed = replace(scene, frames=tuple(frames))
    assert refine_cameras(fixed, FRAMES).notes() == ["The cameras were not refined: they are all at the same place."]
    none = Matches(np.zeros((0, 2), int), np.zeros(0, int), np.zeros((0, 2, 2)), np.zeros((0, 2)), np.zeros((0, 2)))
    monkeypatch.setattr(module, "find_matches", lambda scene, frames: none)
    found = refine_cameras(scene, FRAMES)
    np.testing.assert_array_equal(found.poses, found.given)
    assert found.notes() == ["The cameras were not refined: too few matches were found between the images."]


def test_noise_is_of_the_size_that_was_wanted():
    true = posed_cameras(4, SIZE).world_from_camera.numpy()
    given = noisy(true, 2.0, 0.05, np.random.default_rng(7))
    turned = Rotation.from_matrix(true[:, :3, :3].mT @ given[:, :3, :3]).magnitude()
    np.testing.assert_allclose(np.degrees(turned), 2)
    spacing = np.mean([np.linalg.norm(true[i + 1, :3, 3] - true[i, :3, 3]) for i in range(3)])
    np.testing.assert_allclose(np.linalg.norm(given[:, :3, 3] - true[:, :3, 3], axis=1), 0.05 * spacing)

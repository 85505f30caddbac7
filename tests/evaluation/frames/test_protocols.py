from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from semgs.data.scene import Scene
from semgs.evaluation.frames.protocols import TargetSample, nearest_first, neighbours, pairs, peers
from semgs.files.errors import InputError
from semgs.geometry.rotations import matrix_from_quaternion

MakeScene = Callable[..., Scene]


def test_neighbours_are_taken_alternately_before_and_after(make_scene: MakeScene):
    samples = neighbours(make_scene(frames=7), 4)
    assert [sample.target for sample in samples] == [1, 2, 3, 4, 5]
    assert samples[2] == TargetSample((2, 4, 1, 5), 3)
    assert samples[1] == TargetSample((1, 3, 0, 4), 2)


def test_an_end_is_filled_from_the_other_side(make_scene: MakeScene):
    scene = make_scene(frames=6)
    assert neighbours(scene, 4)[0] == TargetSample((0, 2, 3, 4), 1)
    assert neighbours(scene, 4)[-1] == TargetSample((3, 5, 2, 1), 4)
    assert neighbours(scene, 3)[0] == TargetSample((0, 2, 3), 1)
    assert neighbours(scene, 2)[-1] == TargetSample((3, 5), 4)


def test_a_target_may_be_drawn_from_all_other_frames_and_from_no_more(make_scene: MakeScene):
    scene = make_scene(frames=4)
    assert {frozenset(sample.contexts) for sample in neighbours(scene, 3)} == {
        frozenset({0, 2, 3}),
        frozenset({0, 1, 3}),
    }
    with pytest.raises(
        InputError, match=r"expected at least 4 frames to render a target from, found 3 \(4 usable frames\)"
    ):
        neighbours(scene, 4)


def test_two_frames_have_no_inner_one(make_scene: MakeScene):
    with pytest.raises(InputError, match="at least 3 usable frames, found 2"):
        neighbours(make_scene(frames=2), 2)


def test_pairs_have_the_frames_beside_the_target_and_then_those_beyond(make_scene: MakeScene):
    samples = pairs(make_scene(frames=7), 2)
    assert [sample.target for sample in samples] == [1, 2, 3, 4, 5]
    assert samples[2] == TargetSample((2, 4), 3, (1, 5))
    assert samples[0] == TargetSample((0, 2), 1, (3, 4))
    assert samples[2].frames == (2, 4, 1, 5, 3)
    with pytest.raises(InputError, match="at least 5 usable frames, found 4"):
        pairs(make_scene("short", frames=4), 2)
    with pytest.raises(InputError, match="at least 3 frames to render a target from, found 2"):
        pairs(make_scene("longer", frames=6), 3)


def walk(frames: int, spin: float = 0.0) -> Scene:
    """A stand-in for a long scene: a camera that goes along x and turns by `spin` a frame, far from the origin."""
    poses = np.tile(np.eye(4), (frames, 1, 1))
    for index, pose in enumerate(poses):
        half = 0.5 * spin * index
        pose[:3, :3] = matrix_from_quaternion(torch.tensor([np.cos(half), 0, np.sin(half), 0])).numpy()
        pose[:3, 3] = [5 + 0.01 * index, -2.0, 30.0]
    scene = object.__new__(Scene)
    object.__setattr__(scene, "frames", tuple(SimpleNamespace(world_from_camera=pose) for pose in poses))
    object.__setattr__(scene, "path", "walk")
    return scene


def test_peers_targets_and_sources_are_those_of_their_code():
    samples = peers(walk(900), 4)
    assert [sample.target for sample in samples] == [2, 22, 42, 62, 82, 102, 122, 142, 162, 182]
    # Two before, three behind, seven before, eight behind: the nearest multiples of five.
    assert samples[1].contexts == (20, 25, 15, 30)
    assert samples[0].contexts == (0, 5, 10, 15)


def test_peers_never_look_behind_frame_700_and_take_what_a_short_scene_has():
    assert [sample.target for sample in peers(walk(45), 2)] == [2, 22, 42]
    assert peers(walk(45), 2)[2].contexts == (40, 35)
    wide = peers(walk(900), 140)[0].contexts
    assert (len(wide), max(wide)) == (140, 695)
    with pytest.raises(InputError, match="at least 141 frames"):
        peers(walk(900), 141)


def test_gsnerf_ranks_by_the_translation_of_the_world_to_camera_pose():
    scene = walk(300, spin=-0.004)
    target = 62
    translations = [-(frame.world_from_camera[:3, :3].T @ frame.world_from_camera[:3, 3]) for frame in scene.frames]
    distances = {
        source: float(np.linalg.norm(translations[source] - translations[target])) for source in range(0, 300, 5)
    }
    expected = sorted(distances, key=lambda source: distances[source])[:3]
    assert list(peers(scene, 3, "gsnerf")[3].contexts) == expected
    still = walk(300)
    assert peers(still, 3, "gsnerf") == peers(still, 3)


def test_gsnerfs_translation_is_minus_r_transposed_t():
    """Of the target -(1, 0, 0), of frame 5 -R^T (0, 1, 0) = -(1, 0, 0) too, where R (0, 1, 0) = -(1, 0, 0), of frame 0 -(0, 0, 1)."""
    scene = walk(6)
    for index, place in ((2, [1, 0, 0]), (5, [0, 1, 0]), (0, [0, 0, 1])):
        scene.frames[index].world_from_camera[:3, 3] = place
    scene.frames[5].world_from_camera[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    assert peers(scene, 2, "gsnerf") == [TargetSample((5, 0), 2)]


def test_gsnerfs_distance_may_choose_other_sources_than_camera_centres():
    scene = walk(300)
    turned = scene.frames[60].world_from_camera
    turned[:3, :3] = matrix_from_quaternion(torch.tensor([0.9, 0.1, -0.3, 0.2])).numpy()
    assert 60 in peers(scene, 2)[3].contexts
    assert 60 not in peers(scene, 2, "gsnerf")[3].contexts


def test_the_nearest_context_is_that_of_the_nearest_camera_centre_and_of_equal_ones_the_first(make_scene: MakeScene):
    scene = make_scene(frames=4, positions=[0.0, 0.3, 0.35, 0.6], change=lambda file: level(file))
    assert nearest_first(scene, TargetSample((0, 2), 1)) == (2, 0)
    assert nearest_first(scene, TargetSample((3, 0, 2), 1)) == (2, 3, 0)


def level(file: dict) -> None:
    """Put all cameras on one line, so that frames 0 and 3 are equally far from frame 1, to the bit."""
    for frame, along in zip(file["frames"], (0.0, 0.3, 0.35, 0.6), strict=True):
        for row, offset in enumerate((0.5, 0.25, along)):
            frame["transform_matrix"][row][3] = offset

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch

from semgs.data.choice import choose, given
from semgs.data.scene import Scene
from semgs.reconstruction.reconstruct import Network, reconstruct
from semgs.reconstruction.stages import Stages


def test_a_network_that_knows_the_depth_gives_the_wall_back(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    result = reconstruct(scene, given(scene, [0, 3]), oracle)
    assert result.target is not None
    assert result.context.positions == (0, 3)
    assert result.target.positions == (1, 2)
    for score in (*result.context.scores, *result.target.scores):
        assert score.psnr > 25
        assert score.coverage > 0.98
        assert score.depth_error is not None
        assert score.depth_error < 0.01
        assert score.accuracy is not None
        assert score.accuracy > 0.97
        assert score.miou is not None
        assert score.miou > 0.95


def test_the_views_keep_their_size_or_take_the_one_asked_for(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    choice = given(scene, [0, 2])
    small = reconstruct(scene, choice, oracle)
    assert small.native_size == (40, 56)
    assert small.size == (32, 48)  # multiples of 16
    assert reconstruct(scene, choice, oracle, (36, 60)).size == (36, 60)


def test_pictures_of_another_aspect_are_cropped_and_it_is_said(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    scene = wall_scene()
    result = reconstruct(scene, given(scene, [0, 3]), oracle, (32, 32))
    assert [note for note in result.notes if "aspect" in note] == [
        "4 of 4 pictures have another aspect than 32x32 (height x width) and are cropped about the middle, their cameras with them; "
        f"{scene.frames[0].name} from 40x56 to 40x40 before it is resized."
    ]
    (fx, fy), (old_fx, old_fy) = result.context.views.cameras.focal_px[0], scene.cameras[0].focal_px
    assert (fx / old_fx, fy / old_fy) == pytest.approx((0.8, 0.8))
    assert result.context.scores[0].depth_error is not None
    assert result.context.scores[0].depth_error < 0.01
    same = reconstruct(scene, given(scene, [0, 3]), oracle, (80, 112))
    assert not any("aspect" in note for note in same.notes)


def test_a_colour_only_network_is_scored_without_classes_and_says_so(
    wall_scene: Callable[..., Scene], colour_oracle: Network
) -> None:
    scene = wall_scene()
    result = reconstruct(scene, choose(scene, 2), colour_oracle)
    assert result.classes is None
    assert all(score.miou is None and score.accuracy is None for score in result.context.scores)
    assert result.context.scores[0].depth_error is not None
    assert any("colour only" in note for note in result.notes)


def test_a_camera_that_only_turns_or_stands_still_is_told_as_no_parallax(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    scene = wall_scene(shifts=(0.0, 0.0, 0.0))
    assert any("No parallax" in note for note in reconstruct(scene, given(scene, [0, 2]), oracle).notes)


def test_parallax_is_not_missed_where_it_is(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    assert not any("parallax" in note for note in reconstruct(scene, given(scene, [0, 3]), oracle).notes)


def test_a_scene_of_unknown_scale_never_speaks_of_metres(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene(metric=False)
    result = reconstruct(scene, given(scene, [0, 3]), oracle)
    assert not result.metric
    assert any("unknown" in note for note in result.notes)
    assert all(score.depth_error is None and score.miou is None for score in result.context.scores)


def test_two_frames_leave_none_to_hold_out(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene(shifts=(0.0, 0.1))
    result = reconstruct(scene, choose(scene, 2), oracle)
    assert result.target is None
    assert any("held out" in note for note in result.notes)


def test_stages_are_announced_and_timed_in_order(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    stages = Stages()
    reconstruct(scene, given(scene, [0, 3]), oracle, stages=stages)
    assert list(stages.seconds) == ["read", "encode", "render"]
    assert all(seconds > 0 for seconds in stages.seconds.values())


def test_nothing_of_the_result_has_a_gradient(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    result = reconstruct(scene, given(scene, [0, 3]), oracle)
    assert not result.encoding.gaussians.means.requires_grad
    assert result.encoding.gaussians.means.dtype == torch.float32


def test_one_view_is_refused(wall_scene: Callable[..., Scene]) -> None:
    with pytest.raises(ValueError, match="expected 2 to 4"):
        given(wall_scene(), [1])


def test_a_reconstruction_has_one_near_and_far(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene(metric=False)
    result = reconstruct(scene, given(scene, [0, 3]), oracle)
    assert result.target is not None
    near, far = result.depth_range.near, result.depth_range.far
    for bounds in (result.context.views, result.target.views, result.encoding):
        assert bounds.depth_range.tolist() == [[near, far]] * 2
    assert result.depth_range == scene.depth_range([0, 3])

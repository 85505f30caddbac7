from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from recorded_progress import RecordedProgress
from run.conftest import SIZE, TURN, WALL, Oracle
from safetensors import safe_open

from semgs import load
from semgs.data.choosing.choice import choose, choose_named
from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.files.images.pictures import read_rgb, write_png
from semgs.geometry.cameras import Cameras
from semgs.model.encode import Network
from semgs.objectives.metrics import psnr
from semgs.rendering.rendering import Rendering, confidence_maps, label_maps
from semgs.robotics.occupancy import rays_of
from semgs.run.output.report import Provenance, report_numbers
from semgs.run.output.report_page import report_page
from semgs.run.steps.finishing import scores
from semgs.run.steps.notes import strangers
from semgs.run.steps.pipeline import reconstruct
from semgs.runtime.stopwatch import COMPILE, Stages
from semgs.scene.encoding import Encoding
from semgs.scene.scene_file import load_scene, save_scene


def test_a_network_that_knows_the_depth_gives_the_wall_back(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle)
    assert result.target is not None
    assert result.context.positions == (0, 3)
    assert result.target.positions == (1, 2)
    for score in (*result.context.scores, *result.target.scores):
        assert score.psnr > 25
        assert score.coverage > 0.98
        assert score.depth_seen is not None
        assert score.depth_seen.abs_rel < 0.01
        assert score.accuracy is not None
        assert score.accuracy > 0.97
        assert score.miou is not None
        assert score.miou > 0.95


def test_views_are_rendered_one_at_a_time_as_if_together(
    wall_scene: Callable[..., Scene], oracle: Network, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_once: list[int] = []
    render = Encoding.render

    def counted(encoding: Encoding, cameras: Cameras, **options: Any) -> Rendering:
        at_once.append(cameras.batch[0])
        return render(encoding, cameras, **options)

    monkeypatch.setattr(Encoding, "render", counted)
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle, min_confidence=0.5)
    assert at_once == [1, 1, 1, 1]  # two input views, and frames 1 and 2 held out
    assert result.target is not None
    together = render(result.encoding, result.target.views.cameras)
    assert torch.equal(together.images, result.target.images)
    assert torch.equal(together.depths, result.target.depths)
    assert torch.equal(together.alphas, result.target.alphas)
    assert np.array_equal(label_maps(together, 0.5), result.target.labels)
    assert np.array_equal(confidence_maps(together), result.target.confidences)
    assert result.target.scores == scores(together, result.target.views)


def test_the_views_keep_their_size_or_take_the_one_asked_for(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    choice = choose_named(scene, [0, 2])
    small = reconstruct(scene, choice, oracle)
    assert small.native_size == (40, 56)
    assert small.size == (32, 48)  # multiples of 16
    assert reconstruct(scene, replace(choice, size=(36, 60)), oracle).size == (36, 60)


def test_pictures_of_another_aspect_are_cropped_and_it_is_said(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    scene = wall_scene()
    result = reconstruct(scene, replace(choose_named(scene, [0, 3]), size=(32, 32)), oracle)
    assert [note for note in result.notes if "aspect" in note] == [
        "4 of 4 images have another aspect ratio than 32x32 (height x width) and are centre-cropped with their cameras: "
        f"{scene.frames[0].name}, for example, from 40x56 to 40x40 before it is resized."
    ]
    (fx, fy), (old_fx, old_fy) = result.context.views.cameras.focal_px[0], scene.cameras[0].focal_px
    assert (fx / old_fx, fy / old_fy) == pytest.approx((0.8, 0.8))
    assert result.context.scores[0].depth_seen is not None
    assert result.context.scores[0].depth_seen.abs_rel < 0.01
    same = reconstruct(scene, replace(choose_named(scene, [0, 3]), size=(80, 112)), oracle)
    assert not any("aspect" in note for note in same.notes)


def test_a_colour_only_network_is_scored_without_classes_and_says_so(
    wall_scene: Callable[..., Scene], colour_oracle: Network
) -> None:
    scene = wall_scene()
    result = reconstruct(scene, choose(scene, 2), colour_oracle)
    assert result.classes is None
    assert all(score.miou is None and score.accuracy is None for score in result.context.scores)
    assert result.context.scores[0].depth_seen is not None
    assert any("colour only" in note for note in result.notes)


def test_a_camera_that_only_turns_or_stands_still_is_told_as_no_parallax(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    scene = wall_scene(shifts=(0.0, 0.0, 0.0))
    assert any("No parallax" in note for note in reconstruct(scene, choose_named(scene, [0, 2]), oracle).notes)


def test_parallax_is_not_missed_where_it_is(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    assert not any("parallax" in note for note in reconstruct(scene, choose_named(scene, [0, 3]), oracle).notes)


def test_a_scene_of_unknown_scale_never_speaks_of_metres(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene(metric=False)
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle)
    assert not result.metric
    assert any("unknown" in note for note in result.notes)
    assert all(score.depth_seen is None and score.miou is None for score in result.context.scores)


def test_two_frames_leave_none_to_hold_out(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene(shifts=(0.0, 0.1))
    result = reconstruct(scene, choose(scene, 2), oracle)
    assert result.target is None
    assert any("held out" in note for note in result.notes)


class PaleOracle(Oracle):
    """An oracle that makes colours grey: by a third nearer to the middle."""

    def forward(self, views: Views) -> Encoding:
        encoding = super().forward(views)
        gaussians = encoding.gaussians
        colour = replace(gaussians.colour, features=gaussians.colour.features * 2 / 3)
        return replace(encoding, gaussians=replace(gaussians, colour=colour))


def test_refined_gaussians_show_the_photos_better_and_the_first_held_out_frame_decides(
    wall_scene: Callable[..., Scene],
) -> None:
    """Frames 1 and 2 are held out; 1 decides in two of four passes, and teaches afterwards, because there are four photos. So 2 is the only target."""
    scene, oracle = wall_scene(), PaleOracle()
    choice, stages = choose_named(scene, [0, 3]), Stages()
    result = reconstruct(scene, choice, oracle, passes=4, stages=stages)
    assert [name for name in stages.seconds if name != COMPILE] == ["read", "encode", "expose", "sharpen", "render"]
    refinement = result.refinement
    assert refinement is not None
    assert (refinement.passes, refinement.check, len(refinement.curve)) == (4, scene.frames[1].name, 3)
    assert refinement.check_taught
    assert refinement.kept == 2 * max(range(3), key=refinement.curve.__getitem__)
    assert result.choice.targets == (2,)
    before, after = refinement.before[0], result.context
    assert [part.role for part in refinement.before] == ["context", "target"]
    assert all(new.psnr > old.psnr for old, new in zip(before.scores, after.scores, strict=True))
    assert before.scores == reconstruct(scene, choice, oracle).context.scores
    torch.testing.assert_close(before.images, reconstruct(scene, choice, oracle).context.images)
    assert refinement.kept > 0
    assert any(
        f"where {scene.frames[1].name} looks best. This photo was left out of a trial of half the passes" in note
        for note in result.notes
    )


def test_what_refining_makes_worse_stays_as_it_was(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    """The oracle's wall is already about as good as Gaussians of that size allow, 35.6 dB. A first pass costs about 1 dB, as processors round
    differently; more passes may win it back."""
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle, passes=1)
    assert result.refinement is not None
    assert result.refinement.kept == 0
    assert result.refinement.curve[1] < result.refinement.curve[0] - 0.5
    assert any(note.startswith(f"Refining made {scene.frames[1].name} worse") for note in result.notes)
    assert result.context.scores == result.refinement.before[0].scores


def test_without_a_frame_to_check_refining_runs_to_its_end_and_says_so(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    scene = wall_scene(shifts=(0.0, 0.1))
    result = reconstruct(scene, choose(scene, 2), oracle, passes=2)
    assert result.refinement is not None
    assert (result.refinement.kept, result.refinement.check, result.refinement.curve) == (2, None, ())
    assert any(
        note.startswith("No photo was left to check the refinement on, so it ran for all 2 passes.")
        for note in result.notes
    )


def test_of_many_photos_the_one_that_decides_is_held_out_to_the_end(wall_scene: Callable[..., Scene]) -> None:
    """Six photos 4 cm apart; inputs 0 and 3, and 1 decides in all of two passes."""
    scene = wall_scene(shifts=tuple(0.04 * number for number in range(6)))
    progress = RecordedProgress()
    choice = choose_named(scene, [0, 3])
    refinement = reconstruct(scene, choice, PaleOracle(), passes=2, stages=Stages(progress)).refinement
    assert refinement is not None
    assert (refinement.check, refinement.check_taught) == (scene.frames[1].name, False)
    assert len(refinement.curve) == 3
    assert (progress.counts, progress.done) == ([2 * 2], [1, 2, 3, 4])


def test_of_three_input_photos_the_middle_one_decides_and_then_takes_part(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    """No photo is held out. Half of 3 passes, rounded up, are tried without the second photo: 2 passes of 2 photos. Then all three are used."""
    scene = wall_scene(shifts=(0.0, 0.1, 0.2))
    progress = RecordedProgress()
    result = reconstruct(scene, choose_named(scene, [0, 1, 2]), oracle, passes=3, stages=Stages(progress))
    refinement = result.refinement
    assert refinement is not None
    assert (refinement.check, refinement.check_taught) == (scene.frames[1].name, True)
    assert len(refinement.curve) == 3, "before, and after each of two passes"
    tried = max(range(3), key=refinement.curve.__getitem__)
    assert refinement.kept == round(3 * tried / 2)
    assert len(result.context.positions) == 3
    assert any("left out of a trial" in note for note in result.notes)
    assert progress.counts == [2 * 2 + 3 * 3]
    assert progress.done == list(range(1, 4 + 3 * refinement.kept + 1))


def test_gaussians_at_a_sensors_depth_stay_there_when_refined(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    scene = wall_scene()
    choice = choose_named(scene, [0, 3])
    plain, refined = (reconstruct(scene, choice, oracle, depth="sensor", passes=passes) for passes in (0, 2))
    assert torch.equal(plain.encoding.gaussians.means, refined.encoding.gaussians.means)
    assert not torch.equal(plain.encoding.gaussians.colour.features, refined.encoding.gaussians.colour.features)


def test_stages_are_announced_and_timed_in_order(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    stages = Stages()
    reconstruct(scene, choose_named(scene, [0, 3]), oracle, stages=stages)
    assert [name for name in stages.seconds if name != COMPILE] == ["read", "encode", "expose", "render"]
    assert all(seconds > 0 for seconds in stages.seconds.values())


def test_nothing_of_the_result_has_a_gradient(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle)
    assert not result.encoding.gaussians.means.requires_grad
    assert result.encoding.gaussians.means.dtype == torch.float32


def test_one_view_is_refused(wall_scene: Callable[..., Scene]) -> None:
    with pytest.raises(ValueError, match="expected 2 to 4"):
        choose_named(wall_scene(), [1])


def test_a_reconstruction_has_one_near_and_far(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    scene = wall_scene(metric=False)
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle)
    assert result.target is not None
    near, far = result.depth_range.near, result.depth_range.far
    for bounds in (result.context.views, result.target.views, result.encoding):
        assert bounds.depth_range.tolist() == [[near, far]] * 2
    assert result.depth_range == scene.depth_range([0, 3])


MOVED = (5e6, -4e6, 3e5 + 0.3)
"""As far as a point on the ground is in ECEF [m]; a float32 has steps of half a metre there."""


def test_a_scene_far_from_its_origin_is_reconstructed_as_well_as_near_it(wall_scene: Callable[..., Scene]) -> None:
    """The middle camera is at (3.129, -0.997, 0.607) + MOVED, and that is rounded."""
    near, far = wall_scene(), wall_scene(moved=MOVED)
    assert near.origin.tolist() == [0, 0, 0]
    assert far.origin.tolist() == [5_000_003, -4_000_001, 300_001]
    network = load("small")
    before, after = (reconstruct(scene, choose_named(scene, [0, 3]), network) for scene in (near, far))
    for mine, theirs in ((after.context, before.context), (after.target, before.target)):
        flat = mine.views.images.mean((-2, -1), keepdim=True).expand_as(mine.views.images)
        for score, wanted, nothing in zip(mine.scores, theirs.scores, psnr(flat, mine.views.images), strict=True):
            assert score.psnr > nothing + 2, (
                "it shows more than the mean colour, at about 11 dB; positions in float32 gave 8.3"
            )
            assert score.psnr == pytest.approx(wanted.psnr, abs=0.01)
            assert score.depth_seen.abs_rel == pytest.approx(wanted.depth_seen.abs_rel, abs=1e-3)
    assert any("relative to (5000003, -4000001, 300001). Add this point" in note for note in after.notes)
    assert not any("relative to" in note for note in before.notes)


def test_a_pose_in_the_coordinates_of_a_far_scene_is_rendered_and_files_are_in_them_again(
    wall_scene: Callable[..., Scene], oracle: Network, tmp_path: Path
) -> None:
    scene = wall_scene(moved=MOVED)
    oracle.start += torch.tensor(MOVED, dtype=torch.float64) - torch.from_numpy(scene.origin)
    result = reconstruct(scene, replace(choose_named(scene, [0, 3]), size=SIZE), oracle)
    asked = scene.cameras[3].arranged(lambda array: array[None])
    assert asked.centres[0, 0] > 5e6
    mine = result.encoding.render(asked.relative_to(scene.origin))
    assert torch.equal(mine.images[0], result.context.images[1])
    save_scene(tmp_path / "a", result.saved)
    with safe_open(tmp_path / "a", "pt") as file:
        written = file.get_tensor("cameras.world_from_camera")
        assert json.loads(file.metadata()["semgs"])["origin"] == [5_000_003, -4_000_001, 300_001]
    exact = [
        frame["transform_matrix"] for frame in json.loads((scene.path.parent / "transforms.json").read_text())["frames"]
    ]
    assert written[:, :3, 3].tolist() == np.array(exact)[[0, 3], :3, 3].tolist()
    again = load_scene(tmp_path / "a")
    assert again.origin == (5_000_003, -4_000_001, 300_001)
    assert torch.equal(again.cameras.world_from_camera, result.context.views.cameras.world_from_camera)
    wall = (
        again.gaussians.means.double() + torch.tensor(again.origin) - torch.tensor(MOVED, dtype=torch.float64)
    ).numpy()
    np.testing.assert_allclose((wall - [3.0, -1.0, 0.5]) @ TURN[:, 2], WALL, atol=1e-5)
    report = report_numbers(result, Provenance("semgs", "none", 0, "cpu"), {})
    assert report["scene"]["origin"] == [5_000_003, -4_000_001, 300_001]


def test_up_to_a_kilometre_nothing_is_moved(wall_scene: Callable[..., Scene]) -> None:
    """The middle camera is at (3.129, -0.997, 0.607): 996 m more in x keep it below 1,000 and 997 m do not."""
    for moved, origin in ((996.0, [0, 0, 0]), (997.0, [1000, -1, 1])):
        scene = wall_scene(moved=(moved, 0, 0))
        assert scene.origin.tolist() == origin
        read = scene.read([0, 3]).cameras.world_from_camera
        files = torch.stack([camera.world_from_camera for camera in scene.cameras])[[0, 3]]
        assert torch.equal(read[:, :3, 3], files[:, :3, 3] - torch.tensor(origin))
        assert torch.equal(read[..., :3, :3], files[..., :3, :3])


def test_poses_from_arrays_that_are_far_out_are_warned_of() -> None:
    images, poses = np.zeros((2, 4, 6, 3), np.uint8), np.tile(np.eye(4), (2, 1, 1))
    intrinsics = np.array([[5.0, 0, 3], [0, 5, 2], [0, 0, 1]])
    poses[:, 0, 3] = [1000, 990]
    Views.from_arrays(images, poses, intrinsics, (0.5, 10))
    poses[1, 0, 3] = -1001
    with pytest.warns(UserWarning, match="cameras are 1001 from the origin"):
        Views.from_arrays(images, poses, intrinsics, (0.5, 10))


def test_views_that_cannot_overlap_are_told(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    """At 10 m, the far bound, a camera sees 29 / 52 * 10 = 5.6 m to its right and 5.2 m to its left: more than 8 m together, less than 12."""
    for shifts, told in (((0.0, 12.0), True), ((0.0, 8.0), False)):
        scene = wall_scene(shifts=shifts, moved=(shifts[1], 0, 0))
        notes = reconstruct(scene, choose_named(scene, [0, 1]), oracle).notes
        found = [note for note in notes if note.startswith("No overlap: images/00.png, images/01.png shows nothing")]
        assert bool(found) is told


def test_a_view_beside_two_that_overlap_is_the_stranger(wall_scene: Callable[..., Scene]) -> None:
    assert strangers(wall_scene(shifts=(0.0, 0.1, 15.0)).read([0, 2, 1])) == [1]


def test_many_views_pass_the_same_pipeline_and_have_the_same_notes(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    """Images of 40x56 are cropped, and the scale is unknown. A surface has the Gaussians of four of six views that see it, so fewer than those of six."""
    scene = wall_scene(metric=False, shifts=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5))
    few, many = (
        reconstruct(scene, replace(choose_named(scene, some), size=(32, 32)), oracle) for some in ([0, 5], range(6))
    )
    (note,) = [note for note in few.notes if note.startswith("The scale of this scene is unknown")]
    assert note in many.notes
    assert any(note.startswith("6 of 6 images have another aspect ratio") for note in many.notes)
    assert many.saved.frames == many.context.names
    assert many.classes == few.classes == oracle.classes
    assert 2 * 32 * 32 < len(many.encoding.gaussians) < 5 * 32 * 32
    assert all(score.psnr > 20 for score in many.context.scores)


def change_images(scene: Scene, change: Callable[[np.ndarray], np.ndarray], *frames: int) -> None:
    """Rewrite the images of some frames."""
    for number in frames:
        path = scene.path.parent / "images" / f"{number:02d}.png"
        write_png(path, change(read_rgb(path)).round().astype(np.uint8))


def black_edge(image: np.ndarray) -> np.ndarray:
    """The image with a black border of two pixels."""
    framed = np.zeros_like(image)
    framed[2:-2, 2:-2] = image[2:-2, 2:-2]
    return framed


def test_a_black_border_has_no_gaussians_and_no_scores_and_the_notes_say_so(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    """Two black pixels and the three behind them on each side: of 40x56 pixels, 30x46 are visible and 860 hidden."""
    scene = wall_scene()
    change_images(scene, black_edge, 0, 1, 2, 3)
    result = reconstruct(scene, replace(choose_named(scene, [0, 3]), size=(40, 56)), oracle)
    assert len(result.encoding.gaussians) == len(result.saved.gaussians) == 2 * 30 * 46
    rows, columns = (torch.div(result.saved.places % (40 * 56), 56, rounding_mode="floor"), result.saved.places % 56)
    assert (int(rows.min()), int(rows.max()), int(columns.min()), int(columns.max())) == (5, 34, 5, 50)
    assert all(score.psnr > 25 and score.coverage > 0.95 for score in result.context.scores)
    assert [note for note in result.notes if note.startswith("Hidden")] == [
        "Hidden: 1,720 of 4,480 pixels of the input views and 1,720 of 4,480 pixels of the held-out views are a black border or masked. "
        "They have no Gaussians and count in no score."
    ]


@pytest.mark.parametrize("views", [2, 5])
def test_a_black_border_frees_no_space(wall_scene: Callable[..., Scene], oracle: Network, views: int) -> None:
    """The oracle says how far the wall is behind the border, too. Nobody saw it there: the saved depth is 0, and no ray goes there."""
    scene = wall_scene(shifts=(0.0, 0.08, 0.16, 0.24, 0.32))
    change_images(scene, black_edge, *range(5))
    result = reconstruct(scene, replace(choose_named(scene, range(views)), size=(40, 56)), oracle)
    hidden, depths = result.context.views.hidden, result.saved.depths
    assert hidden is not None
    assert not depths[hidden].any()
    assert (depths[~hidden] > 1.5).all()
    rays = rays_of(result.saved.gaussians, result.saved.cameras, np.eye(3), depths, result.saved.depth_spread)
    assert len(rays.ends) == int((~hidden).sum()) == len(hidden) * 30 * 46


def test_many_photos_with_black_borders_have_no_gaussians_there(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    scene = wall_scene(shifts=(0.0, 0.3, 0.6, 0.9, 1.2))
    change_images(scene, black_edge, *range(5))
    result = reconstruct(scene, replace(choose_named(scene, range(5)), size=(40, 56)), oracle)
    hidden = result.context.views.hidden
    assert hidden is not None
    assert len(result.encoding.gaussians) > 30 * 46
    assert not hidden.flatten()[result.encoding.places].any()


def test_photos_of_different_exposure_come_to_a_common_one_unless_they_stay_as_taken(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    """Frame 3 is 0.6 times as bright: gains of sqrt(0.6) = 0.77 and 1.29 make both photos and their Gaussians equal again. Held-out photos, as bright as the other
    one, come to 0.77 times as much, too."""
    scene = wall_scene()
    change_images(scene, lambda image: 0.6 * image, 3)
    choice = choose_named(scene, [0, 3])
    taken = reconstruct(scene, choice, oracle, exposure="as-taken")
    even = reconstruct(scene, choice, oracle)
    for before, after in zip(taken.context.scores, even.context.scores, strict=True):
        assert after.psnr > before.psnr + 3
    assert any("multiplied by 0.77 to 1.29" in note for note in even.notes)
    assert not any("exposure" in note for note in taken.notes)
    assert even.target is not None
    assert taken.target is not None
    ratio = even.target.views.images.mean() / taken.target.views.images.mean()
    assert float(ratio) == pytest.approx(0.6**0.5, rel=0.03)
    assert min(score.psnr for score in even.target.scores) > 25


def test_photos_of_one_exposure_give_the_same_bits_whether_it_is_fitted_or_not(
    wall_scene: Callable[..., Scene], oracle: Network
) -> None:
    scene = wall_scene()
    choice = choose_named(scene, [0, 3])
    results = [reconstruct(scene, choice, oracle, exposure=exposure) for exposure in ("auto", "as-taken", "fitted")]
    auto, taken, fitted = (result.encoding.gaussians.colour.features for result in results)
    assert torch.equal(auto, taken)
    assert not torch.equal(fitted, taken)
    torch.testing.assert_close(fitted, taken, atol=0.05, rtol=0)


def test_the_report_says_how_many_photos_became_the_scene(wall_scene: Callable[..., Scene], oracle: Network) -> None:
    """Two of four photos, and the other two are held out."""
    scene = wall_scene()
    result = reconstruct(scene, choose_named(scene, [0, 3]), oracle)
    text = report_page(result, Provenance("semgs 9.9", "", 0, "cpu"), {"read": 1.0})
    assert "Reconstructed from 2 of 4 photos and compared with 2 that were held out." in text

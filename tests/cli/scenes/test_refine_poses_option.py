"""Slightly wrong cameras in `semgs reconstruct`: `--refine-poses`, `--keep-poses`, and neither."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import semgs
from semgs.cli.main import main
from semgs.data.demo_scene import demo_scene
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.sfm.camera_refinement import CameraRefinement


def test_the_refined_cameras_are_used_and_the_report_says_by_how_much_they_moved(
    room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cameras are 12.2 cm apart in a row; each is moved by 6.1 mm, 5 % of that."""
    spacing, moved = np.hypot(0.12, 0.02), []

    def refine(scene: Scene, frames: Sequence[int]) -> CameraRefinement:
        given = np.stack([scene.frames[index].world_from_camera for index in frames])
        poses = given.copy()
        poses[:, 2, 3] += 0.05 * spacing
        moved.extend(poses[:2])
        return CameraRefinement(tuple(frames), given, poses, 77, float(spacing), 2.5, 0.5, accepted=True)

    monkeypatch.setattr("semgs.sfm.camera_refinement.refine_cameras", refine)
    options = ["--weights", "random", "--context", "0", "3", "--refine-poses"]
    assert main(["reconstruct", str(room), "--out", str(tmp_path / "out"), *options]) == 0
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["notes"][0].startswith(
        "The cameras were refined on 77 matches: the median epipolar error fell from 2.50 to 0.50 px."
    )
    assert "rotated by up to 0.00 degrees, and moved by up to 5.0% of" in report["notes"][0]
    np.testing.assert_allclose(semgs.load_scene(tmp_path / "out").cameras.world_from_camera, moved, atol=1e-9)


def turned(folder: Path, degrees: float) -> Path:
    """The demo scene with each camera turned up by so many degrees more than the last."""
    shutil.copytree(demo_scene(), folder)
    scene = json.loads((folder / "transforms.json").read_text())
    for number, frame in enumerate(scene["frames"]):
        pose = np.array(frame["transform_matrix"])
        pose[:3, :3] = pose[:3, :3] @ Rotation.from_rotvec([degrees * number, 0, 0], degrees=True).as_matrix()
        frame["transform_matrix"] = pose.tolist()
    (folder / "transforms.json").write_text(json.dumps(scene))
    return folder


def reconstructed(scene: Path, out: Path, *options: str) -> tuple[list[str], float]:
    """The notes of the report, and by how many degrees the rotation between frames 1 and 2 differs from the demo's."""
    small = ["--weights", "random", "--context", "1", "2", "--size", "48x64", "--refine", "0"]
    assert main(["reconstruct", str(scene), "--out", str(out), *small, *options]) == 0
    notes = json.loads((out / "report.json").read_text())["notes"]
    found = semgs.load_scene(out).cameras.world_from_camera[:, :3, :3].double().numpy()
    true = np.stack([frame.world_from_camera[:3, :3] for frame in open_scene(demo_scene()).frames[1:3]])
    between = Rotation.from_matrix(found[0].T @ found[1]).inv() * Rotation.from_matrix(true[0].T @ true[1])
    return notes, float(np.degrees(between.magnitude()))


@pytest.mark.parametrize(
    ("degrees", "warning"),
    [
        (0.3, "The cameras are slightly wrong, as from odometry or a rough calibration: they miss matches by "),
        (1.0, "The cameras may be wrong. The cameras miss matches by "),
    ],
)
def test_cameras_that_miss_matches_are_corrected_unless_the_user_keeps_them(
    degrees: float, warning: str, tmp_path: Path
) -> None:
    """With a focal length of 245 px, matches of neighbours miss by 245 tan 0.3 = 1.3 px, or by 4.3 px."""
    scene = turned(tmp_path / "turned", degrees)
    notes, off = reconstructed(scene, tmp_path / "corrected")
    assert notes[0].startswith("The cameras were refined on ")
    assert off < 0.15
    notes, off = reconstructed(scene, tmp_path / "kept", "--keep-poses")
    assert notes[0].startswith(warning)
    assert off == pytest.approx(degrees, abs=1e-3)


def test_cameras_that_cannot_be_corrected_keep_the_warning(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("semgs.sfm.camera_refinement.FALLS_TO", 0.0)
    notes, off = reconstructed(turned(tmp_path / "turned", 0.3), tmp_path / "out")
    assert notes[0].startswith("The cameras are slightly wrong,")
    assert off == pytest.approx(0.3, abs=1e-3)


def test_nothing_is_said_of_cameras_that_fit(tmp_path: Path) -> None:
    notes, off = reconstructed(demo_scene(), tmp_path / "out")
    assert not [note for note in notes if "cameras" in note.lower()]
    assert off == pytest.approx(0, abs=1e-5)


def test_refined_and_kept_at_once_is_refused(room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reconstruct", str(room), "--out", str(tmp_path / "out"), "--refine-poses", "--keep-poses"]) == 2
    assert "--keep-poses cannot go with --refine-poses" in capsys.readouterr().err

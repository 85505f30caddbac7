"""`semgs reconstruct --refine-poses`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import semgs
from semgs.cli.main import main
from semgs.data.scene import Scene
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
    assert "images/000.png 0.00 degrees and 5.0%" in report["notes"][0]
    np.testing.assert_allclose(semgs.load_scene(tmp_path / "out").cameras.world_from_camera, moved, atol=1e-9)

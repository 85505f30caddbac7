"""`semgs reconstruct CLIP`: from a video to a report."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
import pytest
from clip_files import write_clip
from pycolmap_photos import FOCAL, PLANES, SIZE, picture

from semgs.cli.main import main
from semgs.data.scenes import open_scene

FRAMES, CHOSEN = 18, 6
"""Of the clip. The middle one of each three frames is sharp."""


@pytest.mark.long
@pytest.mark.parametrize("on_its_side", [False, True])
def test_a_clip_becomes_a_report_with_the_cameras_that_filmed_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], on_its_side: bool
) -> None:
    """The camera walks 1.2 m; motion blurs two of three frames. With the flag, frames are stored turned and come out upright."""
    poses = np.tile(np.eye(4), (FRAMES, 1, 1))
    poses[:, :3, :3] = cv2.Rodrigues(np.array([0.03, -0.05, 0.02]))[0]
    poses[:, :2, 3] = np.linspace((-0.6, 0.1), (0.6, -0.1), FRAMES)
    frames = [picture(pose, PLANES) for pose in poses]
    frames = [one if index % 3 == 1 else cv2.blur(one, (13, 3)) for index, one in enumerate(frames)]
    stored = [np.rot90(one) for one in frames] if on_its_side else frames
    clip = write_clip(tmp_path / "walk.mp4", stored, clockwise=on_its_side)
    options = ["--weights", "random", "--size", "48x64", "--focal", str(FOCAL), "--clip-frames", str(CHOSEN)]
    assert main(["reconstruct", str(clip), "--out", str(tmp_path / "out"), *options]) == 0
    told = capsys.readouterr().out
    assert told.startswith(f"Estimating the cameras of {CHOSEN} photos: about ")
    assert f"{CHOSEN} of {FRAMES} frames of the clip were chosen" in told
    assert json.loads((tmp_path / "out" / "report.json").read_text())["scene"]["name"] == "walk"
    scene = open_scene(tmp_path / "out" / "cameras")
    assert [Path(frame.name).name for frame in scene.frames] == [
        f"frame_{index:05d}.jpg" for index in range(1, FRAMES, 3)
    ]
    assert {frame.lens.size for frame in scene.frames} == {SIZE}
    true = poses[1::3]
    for i, j in combinations(range(CHOSEN), 2):
        ours = np.linalg.inv(scene.frames[i].world_from_camera) @ scene.frames[j].world_from_camera
        known = np.linalg.inv(true[i]) @ true[j]
        assert np.degrees(np.arccos(np.clip((np.trace(ours[:3, :3].T @ known[:3, :3]) - 1) / 2, -1, 1))) < 1
        there, here = (one[:3, 3] / np.linalg.norm(one[:3, 3]) for one in (ours, known))
        assert np.degrees(np.arccos(there @ here)) < 8

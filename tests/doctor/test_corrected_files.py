"""Corrected cameras as a file: what the scene has besides cameras is in it, too."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from semgs.data.scenes import open_scene
from semgs.doctor.fix import write_fixed
from semgs.doctor.rig import rig_of
from semgs.files.images.pictures import write_png

SIZE = (40, 60)


def test_masks_and_an_unknown_unit_are_kept(tmp_path: Path):
    """The left 15 of 60 columns are masked. Depth looks like a sensor's in a room, but the file says that lengths are not metres."""
    mask = np.full(SIZE, 255, np.uint8)
    mask[:, :15] = 0
    write_png(tmp_path / "mask.png", mask)
    write_png(tmp_path / "depth.png", np.full(SIZE, 2000, np.uint16))
    frames = []
    for index in range(2):
        write_png(
            tmp_path / f"{index}.png", np.random.default_rng(index).integers(60, 255, (*SIZE, 3)).astype(np.uint8)
        )
        matrix = np.eye(4)
        matrix[0, 3] = index
        frames.append(
            {"file_path": f"{index}.png", "transform_matrix": matrix.tolist(), "mask_path": "mask.png", "depth_file_path": "depth.png"}
        )  # fmt: skip
    content = {"fl_x": 50, "fl_y": 50, "metric": False, "frames": frames}
    (tmp_path / "transforms.json").write_text(json.dumps(content))
    scene = open_scene(tmp_path)
    assert scene.unit == "unknown"
    (tmp_path / "other").mkdir()
    write_fixed(tmp_path / "other" / "fixed.json", scene, rig_of(scene.frames))
    fixed = open_scene(tmp_path / "other" / "fixed.json")
    assert fixed.unit == "unknown"
    hidden = fixed.read([0, 1], "native").hidden
    assert hidden is not None
    assert hidden.sum((1, 2)).tolist() == [40 * 15, 40 * 15]
    assert hidden[:, :, :15].all()

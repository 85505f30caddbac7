"""Readers that the docs teach: the ten lines of docs/data.md and examples/new_reader.py read what was written."""

from __future__ import annotations

import importlib.util
import json
import re
from pathlib import Path

import cv2
import numpy as np
from miniatures import miniature, text, write_picture

from semgs.data.cameras.lens import Lens
from semgs.data.frames import Frame
from semgs.data.maps import DepthMap
from semgs.data.scene import Scene
from semgs.data.tables.classes import SCANNET20

ROOT = Path(__file__).resolve().parents[3]


def test_the_ten_lines_of_the_docs_read_a_folder(tmp_path: Path):
    page = (ROOT / "docs" / "data.md").read_text(encoding="utf-8")
    block = re.search(r"\n(def open_mine.*?)\n\n", page, re.DOTALL)[1]
    assert len(block.splitlines()) <= 10
    room = miniature().first(2)
    for number, pose in enumerate(room.poses):
        write_picture(tmp_path / f"rgb/{number}.png", cv2.resize(room.images[number], (640, 480)))
        write_picture(tmp_path / f"depth/{number}.png", room.depths[number])
        (tmp_path / "pose").mkdir(exist_ok=True)
        (tmp_path / f"pose/{number}.txt").write_text(text(pose))
    names = {"Path": Path, "Scene": Scene, "Lens": Lens, "Frame": Frame, "DepthMap": DepthMap, "np": np}
    exec(block, names)
    views = names["open_mine"](tmp_path).read([0, 1], "native")
    assert views.depths[1, 240, 325] == np.float32(room.depths[1][24, 32]) * np.float32(0.001)
    np.testing.assert_allclose(views.cameras.world_from_camera.numpy(), room.poses, atol=1e-9)


def test_the_worked_example_reads_depth_of_another_camera_labels_by_id_and_masks(tmp_path: Path):
    """The depth camera has half the pixels of the colour camera and the same view: each depth is seen by 2x2 pixels."""
    path = ROOT / "examples" / "new_reader.py"
    spec = importlib.util.spec_from_file_location("new_reader", path)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    room = miniature().first(2)
    lines = []
    for number, pose in enumerate(room.poses):
        name = f"f{number}"
        write_picture(tmp_path / f"rgb/{name}.png", room.images[number])
        write_picture(tmp_path / f"depth/{name}.png", np.full((24, 32), 5000 + number, np.uint16))
        write_picture(tmp_path / f"ids/{name}.png", np.full(room.size, 2 if number else 9, np.uint16))
        lines.append(f"{name} {text(pose.reshape(1, 16))}")
    mask = np.full(room.size, 255, np.uint8)
    mask[:10] = 0
    write_picture(tmp_path / "mask/f1.png", mask)
    cameras = {
        "colour": {"size": [48, 64], "focal": [60.0, 61.0], "centre": [31.5, 24.5]},
        "depth": {"size": [24, 32], "focal": [30.0, 30.5], "centre": [15.75, 12.25]},
    }
    (tmp_path / "cameras.json").write_text(json.dumps(cameras))
    (tmp_path / "poses.txt").write_text("".join(lines))
    views = example.open_mine(tmp_path).read([0, 1], "native")
    assert (views.labels[0] == 255).all()
    assert (views.labels[1, :10] == 255).all()
    assert (views.labels[1, 10:] == SCANNET20.index("table")).all()
    assert (views.depths[0] == np.float32(5000) * np.float32(0.0002)).all()
    assert (views.depths[1, :10] == 0).all()
    assert (views.depths[1, 10:] == np.float32(5001) * np.float32(0.0002)).all()

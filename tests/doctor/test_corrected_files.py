"""Corrected cameras as a file: what the scene has besides cameras is in it, too."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from semgs.data.cameras.lens import Lens
from semgs.data.maps import DepthMap, DepthThroughLens
from semgs.data.scenes import open_scene
from semgs.doctor.fix import note_on_depth, write_fixed
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


def write_scene(folder: Path) -> None:
    """Two frames with depth of 2 m."""
    folder.mkdir(parents=True)
    write_png(folder / "depth.png", np.full(SIZE, 2000, np.uint16))
    frames = []
    for index in range(2):
        pixels = np.random.default_rng(index).integers(60, 255, (*SIZE, 3)).astype(np.uint8)
        write_png(folder / f"{index}.png", pixels)
        frames.append(
            {"file_path": f"{index}.png", "transform_matrix": np.eye(4).tolist(), "depth_file_path": "depth.png"}
        )
    (folder / "transforms.json").write_text(json.dumps({"fl_x": 50, "fl_y": 50, "frames": frames}))


def test_a_file_in_a_folder_that_is_a_link_finds_the_images(tmp_path: Path):
    """Of scans/out, which links to disk/deep/out, the parent is disk/deep: ../office led nowhere. A photo that is a link keeps its name."""
    write_scene(tmp_path / "scans" / "office")
    (tmp_path / "disk" / "deep" / "out").mkdir(parents=True)
    (tmp_path / "scans" / "out").symlink_to(tmp_path / "disk" / "deep" / "out")
    (tmp_path / "scans" / "office" / "1.png").rename(tmp_path / "disk" / "blob")
    (tmp_path / "scans" / "office" / "1.png").symlink_to(tmp_path / "disk" / "blob")
    scene = open_scene(tmp_path / "scans" / "office")
    path = tmp_path / "scans" / "out" / "fixed.json"
    write_fixed(path, scene, rig_of(scene.frames))
    listed = [frame["file_path"] for frame in json.loads(path.read_text())["frames"]]
    assert listed == ["../../../scans/office/0.png", "../../../scans/office/1.png"]
    views = open_scene(path).read([0, 1], "native")
    assert views.depths is not None
    assert views.depths.unique().tolist() == [2.0]


def test_depth_along_the_ray_is_left_out_with_a_note_that_says_how_to_correct_it(tmp_path: Path):
    write_scene(tmp_path / "scene")
    scene = open_scene(tmp_path / "scene")
    rig = replace(rig_of(scene.frames), along_ray=True)
    assert "Divide each depth by |K^-1 (u, v, 1)| of its pixel" in note_on_depth(scene, rig)
    write_fixed(tmp_path / "fixed.json", scene, rig)
    assert all("depth_file_path" not in entry for entry in json.loads((tmp_path / "fixed.json").read_text())["frames"])


def test_inverse_depth_is_left_out_with_a_note(tmp_path: Path):
    write_scene(tmp_path / "scene")
    scene = open_scene(tmp_path / "scene")
    rig = replace(rig_of(scene.frames), disparity=np.ones((2, 2)))
    assert note_on_depth(scene, rig).endswith("it needs z-depth, and they are inverse depth.")
    write_fixed(tmp_path / "fixed.json", scene, rig)
    assert all("depth_file_path" not in entry for entry in json.loads((tmp_path / "fixed.json").read_text())["frames"])


def test_depth_that_a_transforms_json_cannot_describe_is_left_out_with_a_note(tmp_path: Path):
    write_scene(tmp_path / "scene")
    scene = open_scene(tmp_path / "scene")
    assert note_on_depth(scene, rig_of(scene.frames)) == ""
    first, second = scene.frames
    assert isinstance(first.depth, DepthMap)
    other_camera = DepthThroughLens(first.depth, Lens(SIZE, (40.0, 40.0), (30.0, 20.0)))
    unsure = replace(first.depth, confidence=tmp_path / "confidence.png")
    for depths, left_out in (((other_camera, second.depth), 1), ((other_camera, unsure), 2)):
        frames = tuple(replace(frame, depth=depth) for frame, depth in zip((first, second), depths, strict=True))
        changed = replace(scene, frames=frames)
        assert note_on_depth(changed, rig_of(frames)).startswith(
            f"The depth maps of {left_out} of 2 frames are not in the new file"
        )
        write_fixed(tmp_path / "fixed.json", changed, rig_of(frames))
        entries = json.loads((tmp_path / "fixed.json").read_text())["frames"]
        assert sum("depth_file_path" in entry for entry in entries) == 2 - left_out

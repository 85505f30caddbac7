"""COLMAP models of VGGT (demo_colmap.py) and Depth Anything 3 (export format colmap), packed as pycolmap writes them from their numbers."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import predicted_files as files
import pytest
import torch
from predicted_files import Made

from semgs.data.scenes import open_scene
from semgs.geometry.rotations import quaternion_from_matrix

WIDE = Made((100, 140), (518, 518), (3.7, 3.7), (0, 74), centre=(70.0, 50.0), focal=(70.0, 70.0))
"""VGGT's demo_colmap pads photos to a square of 518: 518 x 370 in it. Its principal points are in the middle."""


def write_model(folder: Path, made: Made, cameras: list[tuple[float, ...]], model: int) -> None:
    """cameras, images and points3D in binary: one camera for each image, numbered from 1, and points that one image each has seen."""
    folder.mkdir(parents=True, exist_ok=True)
    height, width = made.photo
    packed = struct.pack("<Q", len(cameras))
    for index, values in enumerate(cameras):
        packed += struct.pack("<IiQQ", index + 1, model, width, height) + struct.pack(f"<{len(values)}d", *values)
    (folder / "cameras.bin").write_bytes(packed)
    depth, _ = made.maps()
    packed, points = struct.pack("<Q", made.count), []
    for index, pose in enumerate(made.world_to_camera):
        turn = quaternion_from_matrix(torch.from_numpy(np.ascontiguousarray(pose[:3, :3]))).tolist()
        packed += struct.pack("<I7dI", index + 1, *turn, *pose[:3, 3], index + 1) + f"{index:03d}.png".encode() + b"\0"
        x, y = made.processed[1] / 2, made.processed[0] / 2
        z = depth[index, int(y), int(x)]
        inside = np.linalg.inv(made.processed_camera) @ [x, y, 1] * z
        points.append(made.poses[index][:3, :3] @ inside + made.poses[index][:3, 3])
        packed += struct.pack("<Qddq", 1, width / 2, height / 2, index + 1)
    (folder / "images.bin").write_bytes(packed)
    packed = struct.pack("<Q", len(points))
    for index, point in enumerate(points):
        packed += struct.pack("<Q3d3BdQII", index + 1, *point, 9, 8, 7, -1.0, 1, index + 1, 0)
    (folder / "points3D.bin").write_bytes(packed)
    (folder / "rigs.bin").write_bytes(b"not read")
    (folder / "frames.bin").write_bytes(b"not read")


@pytest.mark.parametrize("model", ["PINHOLE", "SIMPLE_PINHOLE"])
def test_vggts_folder_opens_with_cameras_at_the_size_of_the_photos(tmp_path: Path, model: str):
    """It multiplies 259 px of 518 by 140 / 518, which is 70 px, and puts the principal point at (70, 50). With --use_ba the model is SIMPLE_PINHOLE."""
    focal = WIDE.processed_camera[0, 0] * 140 / 518
    values = (focal, focal, 70.0, 50.0) if model == "PINHOLE" else (focal, 70.0, 50.0)
    write_model(tmp_path / "room/sparse", WIDE, [values] * 3, 1 if model == "PINHOLE" else 0)
    (tmp_path / "room/sparse/points.ply").write_text("a point cloud that nothing needs")
    WIDE.write_photos(tmp_path / "room/images")
    scene = open_scene(tmp_path / "room")
    assert (scene.name, scene.layout, scene.unit) == ("room", "COLMAP", "unknown")
    np.testing.assert_allclose([frame.lens.intrinsics for frame in scene.frames], [WIDE.camera] * 3, rtol=1e-12)
    np.testing.assert_allclose([frame.world_from_camera for frame in scene.frames], WIDE.poses, atol=1e-12)
    assert [frame.points.tolist() for frame in scene.frames] == [[0], [1], [2]]


def test_depth_anythings_model_opens_beside_the_frames_of_its_video(tmp_path: Path):
    """504x364 of 140x100: focal lengths are multiplied by 140 / 504 and 100 / 364. The model is in the output folder itself, in binary and in text."""
    made = Made((100, 140), (364, 504), (3.6, 3.64))
    camera = made.processed_camera * [[140 / 504], [100 / 364], [1]]
    values = (camera[0, 0], camera[1, 1], camera[0, 2], camera[1, 2])
    write_model(tmp_path / "out", made, [values] * 3, 1)
    for name in ("cameras.txt", "images.txt", "points3D.txt"):
        (tmp_path / "out" / name).write_text("the same in text")
    made.write_photos(tmp_path / "out/input_images")
    scene = open_scene(tmp_path / "out")
    assert (scene.name, len(scene)) == ("out", 3)
    np.testing.assert_allclose(scene.frames[2].lens.intrinsics, made.camera, rtol=1e-12)
    seen = files.view(made.camera, made.photo, made.poses[2])[1]
    np.testing.assert_array_equal(scene.frames[2].read_image(), seen)

from __future__ import annotations

import json
from math import atan
from pathlib import Path

import numpy as np
import pytest
import torch
from wall_and_chair import wall_and_chair

from semgs.files.images.pictures import write_png
from semgs.geometry.cameras import project
from semgs.viewer.viewer_cameras import camera_seen_from, input_views, photos_in, pixel_of


def test_an_input_view_is_where_its_camera_is():
    scene = wall_and_chair()
    first, second = input_views(scene, 5.0)
    assert (first.name, second.name) == ("a/left.jpg", "b.jpg")
    assert first.position == pytest.approx((5.0, 10.0, 7.5))
    assert first.fov == pytest.approx(2 * atan(20 / 45)), "40 rows, a focal length of 45"
    assert first.aspect == pytest.approx(1.25)
    # 10 units ahead, 12 degrees below the horizon: 10 sin(12 degrees) = 2.079 lower.
    assert first.look_at[2] == pytest.approx(7.5 - 2.0791, abs=1e-4)
    assert first.photo is None


def test_the_camera_of_a_viewer_sees_what_the_input_view_sees():
    scene = wall_and_chair()
    view = input_views(scene, 5.0)[1]
    camera = camera_seen_from(view.wxyz, np.array(view.position), view.fov, (80, 100), 5.0)
    assert torch.allclose(camera.world_from_camera, scene.cameras[1].world_from_camera, atol=1e-12)
    # Twice the size: focal lengths of 90, and the middle of the image on the optical axis.
    assert camera.intrinsics.tolist() == [[pytest.approx(90), 0, 50], [0, pytest.approx(90), 40], [0, 0, 1]]


def test_the_pixel_of_a_ray_is_where_its_points_are_seen():
    scene = wall_and_chair()
    point = torch.tensor([3.4, 2.9, 1.1], dtype=torch.float64)
    x, y, _ = project(point[None], scene.cameras[0])[0].tolist()
    assert pixel_of((point - scene.cameras[0].centres).numpy(), scene.cameras[0]) == pytest.approx((x, y))


def test_photos_are_those_that_the_report_lists_for_these_frames(tmp_path: Path):
    scene = wall_and_chair()
    (tmp_path / "renders").mkdir()
    listed = [("context", 7, "a/left.jpg"), ("context", 4, "b.jpg"), ("target", 5, "c.jpg")]
    report = {"views": [{"role": role, "position": at, "name": name} for role, at, name in listed]}
    for _, position, _ in listed:
        write_png(tmp_path / f"renders/context_{position:03d}_input.png", np.full((4, 5, 3), position, np.uint8))
    assert photos_in(tmp_path, scene) == [], "there is no report"
    (tmp_path / "report.json").write_text(json.dumps(report))
    assert [int(photo[0, 0, 0]) for photo in photos_in(tmp_path, scene)] == [7, 4]
    report["views"][0]["name"] = "other.jpg"
    (tmp_path / "report.json").write_text(json.dumps(report))
    assert photos_in(tmp_path, scene) == []
    (tmp_path / "report.json").write_text('{"views": [{}]}')
    assert photos_in(tmp_path, scene) == []

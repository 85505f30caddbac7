"""COLMAP models, read by pycolmap and by our own reader."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from known import SIZE, plane_scene

from semgs.data.scenes import open_scene
from semgs.export.colmap import image_names, save_model, tracks_of
from semgs.export.points import make_points
from semgs.files.images.pictures import write_png
from semgs.scene.scene_file import SavedScene


def write(folder: Path, scene: SavedScene) -> None:
    """The model of a scene, with grey photos."""
    tracks = tracks_of(scene)
    keep = tracks.matched
    (folder / "sparse" / "0").mkdir(parents=True)
    (folder / "images").mkdir()
    save_model(folder / "sparse" / "0", scene, make_points(scene).only(keep), tracks.only(keep))
    for name in image_names(scene.frames):
        write_png(folder / "images" / name, np.full((*SIZE, 3), 128, np.uint8))


def test_pycolmap_projects_every_point_onto_its_observations(tmp_path: Path) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    scene = plane_scene()
    write(tmp_path, scene)
    model = pycolmap.Reconstruction(str(tmp_path / "sparse" / "0"))
    assert len(model.points3D) > 800
    worst = 0.0
    for point in model.points3D.values():
        assert point.track.length() == 2
        for element in point.track.elements:
            image = model.images[element.image_id]
            seen = image.project_point(point.xyz)
            worst = max(worst, float(np.abs(seen - image.points2D[element.point2D_idx].xy).max()))
            assert image.points2D[element.point2D_idx].point3D_id in model.points3D
    assert worst < 0.5
    # The observation in a point's own view is the centre of its pixel: the poses and the half pixel are right, not only consistent.
    own = np.array([[x % 1, y % 1] for x, y in (one.xy for one in model.images[1].points2D[:200])])
    assert np.abs(own - 0.5).max() < 1e-3
    assert [model.images[number].name for number in (1, 2)] == ["000_b.png", "001_a.png"]
    camera = model.cameras[2]
    assert (camera.model.name, camera.width, camera.height) == ("PINHOLE", SIZE[1], SIZE[0])
    assert camera.params.tolist() == [26.0, 24.0, 13.2, 10.7]


def test_our_own_reader_gets_the_cameras_back(tmp_path: Path) -> None:
    scene = plane_scene()
    write(tmp_path, scene)
    read = open_scene(tmp_path)
    assert [frame.name for frame in read.frames] == ["000_b.png", "001_a.png"]
    poses = np.stack([frame.world_from_camera for frame in read.frames])
    assert np.allclose(poses, scene.cameras.world_from_camera.numpy(), atol=1e-9)


def test_points_that_another_view_sees_at_another_depth_have_no_track() -> None:
    scene = plane_scene()
    every = tracks_of(scene)
    count = SIZE[0] * SIZE[1]
    assert every.seen[0, :count].all()
    assert every.seen[1, count:].all()
    assert 0.5 < every.matched.double().mean() < 1
    nearer = torch.stack(
        (scene.depths[0], 0.9 * scene.depths[1])
    )  # something stands before the plane in the second view
    hidden = tracks_of(replace(scene, depths=nearer))
    assert not hidden.seen[1, :count].any()
    assert hidden.matched[:count].sum() == 0


def test_frames_with_one_name_get_different_files() -> None:
    assert image_names(["left/0.jpg", "right/0.jpg"]) == ["000_0.png", "001_0.png"]

"""Photos and a file of predicted cameras become a scene without COLMAP."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import predicted_files as files
import pytest
from PIL import Image
from predicted_files import Made, save

from semgs.cli.main import main
from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.sfm.scale import KnownDistance
from semgs.sfm.scene_folder import write_predicted_scene

MADE = Made((100, 140), (364, 518), (3.7, 3.64))


@pytest.fixture
def taken(tmp_path: Path) -> tuple[Path, Path]:
    """Photos in one folder and VGGT's file in another."""
    return MADE.write_photos(tmp_path / "photos"), save(tmp_path / "vggt/predictions.npz", files.vggt(MADE))


@pytest.fixture(autouse=True)
def no_colmap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pycolmap", None)


def test_the_command_writes_what_it_writes_with_colmap(tmp_path: Path, taken: tuple[Path, Path], capsys):
    photos, predictions = taken
    out = tmp_path / "out"
    assert main(["poses", str(photos), str(out), "--predictions", str(predictions)]) == 0
    told = capsys.readouterr().out
    assert "Cameras and depth were predicted by VGGT; no sensor measured them." in told
    assert "a scene of 3 frames" in told
    assert told.endswith("unit: unknown\n")
    assert sorted(path.name for path in out.iterdir() if path.name[0] != ".") == [
        "images", "sparse_pc.ply", "transforms.json",
    ]  # fmt: skip
    scene = open_scene(out)
    assert (scene.layout, scene.unit) == ("transforms.json", "unknown")
    np.testing.assert_allclose([frame.world_from_camera for frame in scene.frames], MADE.poses, atol=1e-6)
    np.testing.assert_allclose([frame.lens.intrinsics for frame in scene.frames], [MADE.camera] * 3, atol=1e-4)
    assert (out / "images/001.png").read_bytes() == (photos / "001.png").read_bytes()


def test_points_lie_on_the_walls_and_have_the_colours_of_the_photos(tmp_path: Path, taken: tuple[Path, Path]):
    photos, predictions = taken
    (tmp_path / "out").mkdir()
    solution = write_predicted_scene(photos, predictions, tmp_path / "out")
    to_wall = np.minimum(np.abs(solution.points - files.LOW), np.abs(solution.points - files.HIGH)).min(axis=1)
    assert len(solution.points) > 3000
    assert np.quantile(to_wall, 0.99) < 0.02
    x, y, z = solution.points.T
    expected = 255 * (0.5 + 0.4 * np.stack((np.sin(3 * x + z), np.cos(4 * y + 2 * z), np.sin(2 * x - 3 * y)), axis=-1))
    assert np.median(np.abs(solution.colours - expected)) < 3


def test_a_measured_distance_makes_the_cameras_metric(tmp_path: Path, taken: tuple[Path, Path]):
    """Neighbours are sqrt(0.4^2 + 0.1^2 + 0.1^2) = 0.424 apart; if that is 1.273 m, the unit is 3 m."""
    photos, predictions = taken
    (tmp_path / "out").mkdir()
    distance = KnownDistance("000", "001", 3 * np.sqrt(0.18))
    solution = write_predicted_scene(photos, predictions, tmp_path / "out", distance)
    assert solution.unit == "metric"
    np.testing.assert_allclose(solution.photos[2].world_from_camera[:3, 3], 3 * MADE.poses[2][:3, 3], atol=1e-5)
    assert open_scene(tmp_path / "out").unit == "metric"


def test_a_photo_with_a_rotation_is_copied_as_its_camera_sees_it(tmp_path: Path):
    """VGGT does not turn photos, and its camera is for 140x100. A copy without the tag is the same everywhere."""
    photos = MADE.write_photos(tmp_path / "photos")
    for photo in sorted(photos.iterdir()):
        tag = Image.Exif()
        tag[0x0112] = 8
        with Image.open(photo) as image:
            image.save(photo.with_suffix(".jpg"), quality=95, exif=tag)
        photo.unlink()
    predictions = save(tmp_path / "predictions.npz", files.vggt(MADE))
    (tmp_path / "out").mkdir()
    write_predicted_scene(photos, predictions, tmp_path / "out")
    with Image.open(tmp_path / "out/images/000.jpg") as copy:
        assert (copy.size, copy.getexif().get(0x0112)) == ((140, 100), None)
    assert open_scene(tmp_path / "out").frames[0].lens.size == (100, 140)


def test_photos_of_another_room_and_options_of_colmap_end_with_one_line(
    tmp_path: Path, taken: tuple[Path, Path], capsys
):
    photos, predictions = taken
    arguments = ["poses", str(photos), str(tmp_path / "out"), "--predictions", str(predictions)]
    assert main([*arguments, "--as", "colmap"]) == 2
    assert "--as colmap cannot go with --predictions" in capsys.readouterr().err
    assert main([*arguments, "--focal", "250"]) == 2
    assert "cannot go with --predictions" in capsys.readouterr().err
    replace(MADE, photo=(90, 160)).write_photos(photos)
    assert main(arguments) == 2
    assert "which becomes 518x294 (width x height)" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    (tmp_path / "empty").mkdir()
    with pytest.raises(
        InputError, match="expected a folder with the photos that the predictions are of, found no photos"
    ):
        write_predicted_scene(tmp_path / "empty", predictions, tmp_path / "empty")

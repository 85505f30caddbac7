"""Polycam's raw data: its axes and pixels, which of its cameras are read, and whose camera depth belongs to."""

from __future__ import annotations

import json
import pickle
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from miniatures import check_projection, check_read, miniature, write_picture
from phone_captures import TIMES, polycam_camera, write_polycam, zipped

from semgs.cli.main import main
from semgs.data.scenes import open_scene, open_scenes
from semgs.files.errors import InputError


def change(folder: Path, index: int, place: str = "cameras", **values: object) -> Path:
    """Change values of a camera file; None removes one."""
    file = folder / f"keyframes/{place}/{TIMES[index]}.json"
    changed = {**json.loads(file.read_text()), **values}
    file.write_text(json.dumps({key: value for key, value in changed.items() if value is not None}))
    return file


@pytest.mark.parametrize("kind", ["", "corrected_"])
def test_what_is_read_equals_what_was_written(tmp_path: Path, kind: str):
    room = write_polycam(tmp_path / "kitchen", miniature(), kind=kind)
    scene = open_scene(tmp_path / "kitchen")
    check_read(scene, room, depths=not kind)
    assert (scene.layout, scene.unit, scene.name) == ("Polycam", "metric", "kitchen")
    assert scene.frames[2].name == f"keyframes/{kind}images/{TIMES[2]}.jpg"
    assert bool(scene.notes) == (not kind)


@pytest.mark.parametrize("inside", ["", "my kitchen/"])
def test_the_exported_archive_is_the_same_scene(tmp_path: Path, inside: str):
    room = write_polycam(tmp_path / "folder", miniature())
    archive = zipped(tmp_path / "folder", tmp_path / "Export 3.zip", inside)
    scene = open_scene(archive)
    check_read(pickle.loads(pickle.dumps(scene)), room)
    assert scene.name == "Export 3"
    shutil.rmtree(tmp_path / "folder")
    assert [one.name for one in open_scenes(tmp_path)] == ["Export 3"]


def test_a_point_is_where_arkits_axes_and_pixels_put_it(tmp_path: Path):
    """A camera at (1, 2, 3) that looks along -x, its right along -z: 2 m ahead, 1 m up and half a metre to the right of it is (-1, 3, 2.5)."""
    write_polycam(tmp_path, miniature(), (40.0, 38.0, 33.0, 22.0))
    rows = ((0, 0, 1, 1), (0, 1, 0, 2), (-1, 0, 0, 3))
    change(tmp_path, 4, **{f"t_{i}{j}": rows[i][j] for i in range(3) for j in range(4)})
    # u = 33 + 40 * 0.5 / 2 = 43 and v = 22 - 38 * 1 / 2 = 3 from the corner of the first pixel
    check_projection(open_scene(tmp_path), 4, np.array((-1, 3, 2.5)), (2.5, 42.5), 2.0)


def test_each_image_has_its_own_intrinsics(tmp_path: Path):
    write_polycam(tmp_path, miniature())
    change(tmp_path, 3, fx=41.5, cy=23.25)
    lenses = [frame.lens for frame in open_scene(tmp_path).frames]
    assert (lenses[3].focal, lenses[3].centre) == ((41.5, 38.0), (33.0, 23.25))
    assert (lenses[2].focal, lenses[2].centre) == ((40.0, 38.0), (33.0, 22.0))
    assert lenses[1] is lenses[2]
    given = open_scene(tmp_path, intrinsics=(50.0, 51.0, 30.0, 20.0))
    assert {frame.lens.focal for frame in given.frames} == {(50, 51)}


def test_depth_of_a_smaller_map_is_that_of_the_nearest_pixel(tmp_path: Path):
    room = write_polycam(tmp_path, miniature())
    small = room.depths[:, 1::4, 2::4]
    for time, depths in zip(TIMES, small, strict=False):
        write_picture(tmp_path / f"keyframes/depth/{time}.png", depths)
    read = open_scene(tmp_path).read([5], "native").depths[0].numpy()
    np.testing.assert_allclose(read, small[5].repeat(4, 0).repeat(4, 1) / 1000, atol=1e-6)


def test_depth_of_low_confidence_is_unknown(tmp_path: Path):
    room = write_polycam(tmp_path, miniature())
    confidence = np.full(room.size, 127, np.uint8)
    confidence[20:30, 40:] = 0
    confidence[:, :10] = 255
    write_picture(tmp_path / f"keyframes/confidence/{TIMES[1]}.png", confidence)
    views = open_scene(tmp_path).read([0, 1], "native")
    expected = np.where(confidence == 0, 0, room.depths[1] / 1000)
    np.testing.assert_allclose(views.depths[1].numpy(), expected, atol=1e-6)
    np.testing.assert_allclose(views.depths[0].numpy(), room.depths[0] / 1000, atol=1e-6)
    write_picture(tmp_path / f"keyframes/confidence/{TIMES[1]}.png", confidence[:24])
    with pytest.raises(InputError, match=r"confidence/\d+\.png: expected a map of \(48, 64\)"):
        open_scene(tmp_path).read([1], "native")


def test_corrected_images_have_the_depth_of_the_uncorrected_camera_along_their_rays(tmp_path: Path):
    room = write_polycam(tmp_path, miniature(), (40.0, 38.0, 33.0, 22.0))
    write_polycam(tmp_path, miniature(), (80.0, 76.0, 31.0, 25.0), kind="corrected_")
    scene = open_scene(tmp_path)
    assert {frame.lens.focal for frame in scene.frames} == {(80.0, 76.0)}
    depths = scene.read([0, 2], "native").depths[1].numpy()
    # the centre of column 41 is (41.5 - 31) / 80 * 40 + 33 = 38.25, of row 10 (10.5 - 25) / 76 * 38 + 22 = 14.75
    assert depths[10, 41] == pytest.approx(room.depths[2, 14, 38] / 1000, abs=1e-6)
    np.testing.assert_allclose(depths[:, 41], room.depths[2, np.floor((np.arange(48) + 0.5 - 25) / 2 + 22).astype(int), 38] / 1000, atol=1e-6)  # fmt: skip


@pytest.mark.parametrize("without", [("corrected_cameras",), ("corrected_cameras", "cameras")])
def test_cameras_without_sizes_are_those_of_their_images(tmp_path: Path, without: tuple[str, ...]):
    room = write_polycam(tmp_path, miniature(), (40.0, 38.0, 33.0, 22.0))
    write_polycam(tmp_path, miniature(), (80.0, 76.0, 31.0, 25.0), kind="corrected_")
    for index in range(8):
        for place in without:
            change(tmp_path, index, place, width=None, height=None)
    scene = open_scene(tmp_path)
    assert {(frame.lens.size, frame.lens.focal, frame.lens.centre) for frame in scene.frames} == {
        ((48, 64), (80.0, 76.0), (31.0, 25.0))
    }
    np.testing.assert_allclose([frame.world_from_camera for frame in scene.frames], room.poses, atol=1e-9)
    # as below: row 10 and column 41 see what row 14 and column 38 of the depth camera do
    assert scene.read([2], "native").depths[0, 10, 41] == pytest.approx(room.depths[2, 14, 38] / 1000, abs=1e-6)


def test_depth_of_a_camera_without_size_and_image_is_left_out(tmp_path: Path):
    write_polycam(tmp_path, miniature())
    write_polycam(tmp_path, miniature(), kind="corrected_")
    for index in range(8):
        change(tmp_path, index, width=None)
    shutil.rmtree(tmp_path / "keyframes/images")
    scene = open_scene(tmp_path)
    assert len(scene) == 8
    assert {frame.depth for frame in scene.frames} == {None}


def test_blurred_frames_and_missing_files_are_left_out_and_counted(tmp_path: Path):
    room = write_polycam(tmp_path, miniature())
    for index, score in enumerate((24.9, 0, 25.0, None)):
        change(tmp_path, index, blur_score=score)
    (tmp_path / f"keyframes/images/{TIMES[5]}.jpg").unlink()
    (tmp_path / f"keyframes/depth/{TIMES[6]}.png").unlink()
    (tmp_path / f"keyframes/images/{TIMES[7]}(1).jpg").write_bytes(b"a second download")
    scene = open_scene(tmp_path)
    check_read(scene, room, [2, 3, 4, 6, 7], depths=False)
    assert [note.split(",")[0] for note in scene.notes[1:]] == [
        "2 of 8 frames have a blur_score below 25 and are left out",
        "1 of 6 frames have no image",
        "1 of 6 frames have no depth map",
    ]


def test_of_a_capture_that_is_blurred_all_over_the_sharper_half_is_read_with_a_note(tmp_path: Path):
    """The median of 3, 1, 4, 1, 5, 9, 2 and 30 is 3.5."""
    room = write_polycam(tmp_path, miniature())
    for index, score in enumerate((3, 1, 4, 1, 5, 9, 2, 30)):
        change(tmp_path, index, blur_score=score)
    scene = open_scene(tmp_path)
    check_read(scene, room, [2, 4, 5, 7])
    assert any(
        "Fewer than two frames have a blur_score of 25: the sharper half is used" in note for note in scene.notes
    )
    assert any("4 of 8 frames have a blur_score below 3.5 and are left out" in note for note in scene.notes)
    for index in range(8):
        change(tmp_path, index, blur_score=0)
    assert len(open_scene(tmp_path)) == 8


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"t_12": None}, "t_12: expected a number, found nothing"),
        ({"fx": "forty"}, "fx: expected a finite number"),
        ({"fx": -3}, "expected a possible camera"),
        ({"width": 0}, "width: expected a number above 0"),
        ({"width": 60}, r"expected intrinsics for 64x48 pixels .*, found some for 60x48"),
        ({"t_00": 5}, "is not a rotation"),
        ({"blur_score": []}, "blur_score: expected a finite number"),
    ],
)
def test_damaged_cameras_are_refused_with_their_file(tmp_path: Path, values: dict, message: str, capsys):
    write_polycam(tmp_path, miniature(frames=3))
    file = change(tmp_path, 1, **values)
    with pytest.raises(InputError, match=message) as caught:
        open_scene(tmp_path)
    assert str(file) in str(caught.value)
    assert main(["reconstruct", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_images_of_half_the_size_have_half_the_intrinsics(tmp_path: Path):
    write_polycam(tmp_path, miniature(frames=3))
    for time in TIMES[:3]:
        file = tmp_path / f"keyframes/images/{time}.jpg"
        file.write_bytes(cv2.imencode(".jpg", cv2.resize(cv2.imread(str(file)), (32, 24)))[1].tobytes())
    lens = open_scene(tmp_path).frames[1].lens
    assert (lens.size, lens.focal, lens.centre) == ((24, 32), (20.0, 19.0), (16.5, 11.0))


def test_other_folders_and_archives_are_not_taken_for_captures(tmp_path: Path):
    (tmp_path / "keyframes/cameras").mkdir(parents=True)
    (tmp_path / "keyframes/images").mkdir()
    (tmp_path / "keyframes/cameras/notes.txt").touch()
    with pytest.raises(InputError, match="no known layout"):
        open_scene(tmp_path)
    (tmp_path / "keyframes/cameras/1.json").write_text(polycam_camera(np.eye(4), (40, 38, 33, 22), (48, 64)))
    with pytest.raises(
        InputError, match=r"at least two usable frames, found 0; .* no image, the first is keyframes/images/1\.jpg"
    ):
        open_scene(zipped(tmp_path, tmp_path / "a.zip"))


def test_images_without_a_camera_are_left_out_and_counted(tmp_path: Path):
    write_polycam(tmp_path, miniature(), kind="corrected_")
    (tmp_path / f"keyframes/corrected_cameras/{TIMES[1]}.json").unlink()
    scene = open_scene(tmp_path)
    assert len(scene) == 7
    assert scene.notes == (f"1 of 8 images have no camera file and are left out, the first is {TIMES[1]}.jpg.",)


@pytest.mark.parametrize("raw", ["cameras", "images"])
def test_keyframes_without_a_corrected_camera_and_image_are_counted(tmp_path: Path, raw: str):
    """Two of eight have neither; the other folder of raw data may be missing."""
    write_polycam(tmp_path, miniature())
    write_polycam(tmp_path, miniature(), kind="corrected_")
    for index in (1, 4):
        (tmp_path / f"keyframes/corrected_cameras/{TIMES[index]}.json").unlink()
        (tmp_path / f"keyframes/corrected_images/{TIMES[index]}.jpg").unlink()
    shutil.rmtree(tmp_path / f"keyframes/{'images' if raw == 'cameras' else 'cameras'}")
    scene = open_scene(tmp_path)
    assert len(scene) == 6
    assert (
        f"2 of 8 keyframes have no corrected camera and image and are left out, the first is {TIMES[1]}." in scene.notes
    )

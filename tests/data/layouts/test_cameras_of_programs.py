"""Cameras of Metashape and LLFF: points are where their formats put them, and what is broken is named."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import torch
from landmarks import POINTS, found
from other_cameras import FISHEYE, FRAME, POSES, SIZE, write_llff, write_metashape
from PIL import Image

from semgs.data.layouts import metashape
from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.geometry.cameras import project


def offset(folder: Path) -> float:
    """The farthest that a landmark is from where the cameras put it, over all frames [px]."""
    views, worst = open_scene(folder).read([0, 1, 2], "native"), 0.0
    for index, image in enumerate(views.images):
        expected = project(torch.from_numpy(POINTS), views.cameras[index])[:, :2].numpy()
        inside = ((expected > 8) & (expected < np.array(SIZE[::-1]) - 8)).all(axis=1)
        assert inside.sum() >= 8
        worst = max(worst, float(np.abs(found(image, expected[inside], (8, 8)) - expected[inside]).max()))
    return worst


@pytest.mark.parametrize(("kind", "calibration"), [("frame", FRAME), ("fisheye", FISHEYE)])
def test_a_point_is_where_metashape_puts_it(tmp_path: Path, kind: str, calibration: dict):
    scene = open_scene(write_metashape(tmp_path / "room", kind, calibration))
    assert (scene.layout, scene.unit, scene.name) == ("Metashape", "unknown", "room")
    assert [frame.name for frame in scene.frames] == ["IMG_0.png", "IMG_1.png", "IMG_2.png"]
    assert "1 of 4 cameras have no pose and are left out, the first is IMG_9." in scene.notes
    assert offset(tmp_path / "room") < 0.1


def test_disabled_cameras_are_left_out_and_counted(tmp_path: Path):
    file = write_metashape(tmp_path) / "cameras.xml"
    text = file.read_text()
    assert text.count('label="IMG_0"') == 1
    file.write_text(
        text.replace('label="IMG_0"', 'label="IMG_0" enabled="false"').replace(
            'label="IMG_1.png"', 'label="IMG_1.png" enabled="true"'
        )
    )
    scene = open_scene(tmp_path)
    assert [frame.name for frame in scene.frames] == ["IMG_1.png", "IMG_2.png"]
    assert "1 of 4 cameras are disabled in Metashape and are left out, the first is IMG_0." in scene.notes
    assert "1 of 3 cameras have no pose and are left out, the first is IMG_9." in scene.notes


def test_slaves_of_a_rig_are_left_out_with_what_to_do(tmp_path: Path):
    file = write_metashape(tmp_path) / "cameras.xml"
    text = file.read_text()
    file.write_text(text.replace('label="IMG_9"', 'label="IMG_9" master_id="0"'))
    (note,) = (note for note in open_scene(tmp_path).notes if "IMG_9" in note)
    assert note.startswith(
        "1 of 4 cameras are left out, as they are slaves of a rig, of which the file has no poses (export cameras as COLMAP"
    )


def test_a_component_scales_turns_and_moves_its_cameras(tmp_path: Path):
    """Doubled, x to y to z to x, and 10 along x: a camera at (a, b, c) is at (10 + 2 c, 2 a, 2 b)."""
    text = (
        "<transform><rotation>0 0 1 1 0 0 0 1 0</rotation><translation>10 0 0</translation><scale>2</scale></transform>"
    )
    frame = open_scene(write_metashape(tmp_path, component=text)).frames[1]
    a, b, c = POSES[1, :3, 3]
    np.testing.assert_allclose(frame.world_from_camera[:3, 3], [10 + 2 * c, 2 * a, 2 * b], atol=1e-9)
    np.testing.assert_allclose(frame.world_from_camera[:3, :3], POSES[1, [2, 0, 1], :3], atol=1e-9)


@pytest.mark.parametrize("encoding", ["utf-16", "cp037"])
def test_definitions_in_another_encoding_are_refused_too(encoding: str, tmp_path: Path):
    """As bytes, they have no "<!". The parser believes the encoding that a file names."""
    text = "<!DOCTYPE a [<!ENTITY b 'c'>]><document version='1'><chunk>&b;</chunk></document>"
    (tmp_path / "a.xml").write_bytes(
        f'<?xml version="1.0" encoding="{encoding}"?>'.encode("ascii" if encoding == "cp037" else encoding)
        + text.encode(encoding)
    )
    with pytest.raises(InputError, match=r"damaged XML|definitions"):
        metashape._read(tmp_path / "a.xml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</chunk>", "", "damaged XML"),
        ("<document", "<!DOCTYPE a [<!ENTITY b 'c'>]><document", "found definitions"),
        ('type="frame">', 'type="spherical">', "sensor 0: expected a sensor of type frame or fisheye, found spherical"),
        ("<k1>0.1</k1>", "<k1>much</k1>", "sensor 0: k1: expected numbers"),
        ("<k1>0.1</k1>", "<k4>0.1</k4>", "k4 = 0.1.*undistort the photos first"),
        ("<f>150.0</f>", "<f>0</f>", "sensor 0: expected a possible camera"),
        ('sensor_id="0"', 'sensor_id="7"', "sensor 7: expected a sensor for each camera"),
        ('width="170"', 'width="wide"', "width of the images in pixels, found wide"),
        ("<transform>", "<transform>1 ", "the 16 numbers of a matrix, found 17"),
        ("<transform>", "<transform>inf ", "expected finite numbers"),
    ],
)
def test_what_cannot_be_in_metashapes_xml_is_refused(tmp_path: Path, old: str, new: str, message: str):
    file = write_metashape(tmp_path) / "cameras.xml"
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))
    with pytest.raises(InputError, match=message) as caught:
        open_scene(tmp_path)
    assert str(caught.value).startswith(str(file))


def test_cameras_with_the_same_label_are_refused_because_their_photos_cannot_be_told_apart(tmp_path: Path):
    """Drones number the photos of each folder from the start: 100MEDIA/DJI_1.png and 101MEDIA/DJI_1.png. Both cameras got the first photo."""
    file = write_metashape(tmp_path) / "cameras.xml"
    file.write_text(file.read_text().replace('label="IMG_2"', 'label="img_0"'))
    with pytest.raises(
        InputError, match=r"cameras\.xml: expected a label of its own for each camera, found 1 .* IMG_0"
    ):
        open_scene(tmp_path)


def test_a_folder_that_is_called_as_the_file_of_the_cameras_is_none(tmp_path: Path):
    write_metashape(tmp_path).joinpath("cameras.xml").rename(tmp_path / "room.xml")
    (tmp_path / "cameras.xml").mkdir()
    assert len(open_scene(tmp_path).frames) == len(POSES)


@pytest.mark.parametrize("ending", [".png", ".jpg"])
def test_masks_with_the_names_of_photos_are_not_taken_for_them(tmp_path: Path, ending: str):
    """Photos in photos/ and masks of the same names in masks/, which comes first: nothing says which is which, unless photos are in images/."""
    write_metashape(tmp_path)
    for folder in ("photos", "masks"):
        (tmp_path / folder).mkdir()
    for photo in sorted(tmp_path.glob("*.png")):
        Image.new("RGB", (170, 120)).save((tmp_path / "masks" / photo.name).with_suffix(ending))
        photo.rename(tmp_path / "photos" / photo.name)
    with pytest.raises(
        InputError, match=rf"one photo of camera IMG_0, found masks/IMG_0\{ending} and photos/IMG_0\.png"
    ):
        open_scene(tmp_path)
    (tmp_path / "photos").rename(tmp_path / "images")
    assert [frame.name for frame in open_scene(tmp_path).frames] == [f"images/IMG_{index}.png" for index in range(3)]
    assert offset(tmp_path) < 0.1


@pytest.mark.parametrize(("shrink", "name"), [(1, "images"), (4, "images_4")])
def test_a_point_is_where_llff_puts_it(tmp_path: Path, shrink: int, name: str):
    scene = open_scene(write_llff(tmp_path / "fern", shrink, name))
    assert (scene.layout, scene.unit, scene.name, len(scene)) == ("LLFF", "unknown", "fern", 3)
    assert offset(tmp_path / "fern") < 0.1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda rows: rows[:2], r"a pose for each of the 3 images in images/, found 2"),
        (lambda rows: rows[:, :15], r"expected an array \[n 17\] of numbers, found float64 \(3, 15\)"),
        (lambda rows: rows * np.nan, "a number that is not finite"),
        (lambda rows: rows * (1, 1, 1, 1, 0, *[1] * 12), "row 0: expected a camera for 170x120"),
        (lambda rows: rows * -1, "row 0: expected a"),
        (lambda rows: np.array([{"a": 1}], object), "an array of numbers"),
    ],
)
def test_what_cannot_be_in_llffs_poses_is_refused(tmp_path: Path, change, message: str):
    file = write_llff(tmp_path) / "poses_bounds.npy"
    np.save(file, change(np.load(file)), allow_pickle=True)
    with pytest.raises(InputError, match=message) as caught:
        open_scene(tmp_path)
    assert re.match(re.escape(str(tmp_path)), str(caught.value))

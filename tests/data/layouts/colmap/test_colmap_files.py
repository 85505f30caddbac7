"""The files of COLMAP models against pycolmap's own, and what makes them unreadable. Bytes are packed by the format's description."""

from __future__ import annotations

import struct
import time
from pathlib import Path

import numpy as np
import pytest

from semgs.data.layouts.colmap import colmap_files
from semgs.data.layouts.colmap.colmap_files import PARAMETERS, read_cameras, read_images, read_points
from semgs.files.errors import InputError

CAMERA = struct.pack("<QIiQQ4d", 1, 7, 1, 64, 48, 60.0, 59.0, 31.0, 25.0)
IMAGE = struct.pack("<QI7dI", 1, 3, 1, 0, 0, 0, 1, 2, 3, 7) + b"a.png\0" + struct.pack("<Qddq", 1, 8.5, 9.5, 0)
POINT = struct.pack("<QQ3d3BdQII", 1, 0, 1, 2, 3, 9, 8, 7, 0.5, 1, 3, 0)
TEXTS = {
    "cameras": "7 PINHOLE 64 48 60 59 31 25",
    "images": "3 1 0 0 0 1 2 3 7 a.png\n8.5 9.5 0",
    "points3D": "0 1 2 3 9 8 7 0.5 3 0",
}
BINARIES = {"cameras": CAMERA, "images": IMAGE, "points3D": POINT}


def read(folder: Path, ending: str):
    """All three files of a folder."""
    cameras = read_cameras(folder / f"cameras{ending}")
    images = read_images(folder / f"images{ending}", cameras)
    return cameras, images, read_points(folder / f"points3D{ending}", {image.number for image in images}, 50)


def write(folder: Path, **changed: bytes | str) -> Path:
    """The smallest model in both forms, with another content for some of its files ("images_bin")."""
    for name in BINARIES:
        (folder / f"{name}.bin").write_bytes(changed.get(f"{name}_bin", BINARIES[name]))
        (folder / f"{name}.txt").write_text(changed.get(f"{name}_txt", TEXTS[name]))
    return folder


@pytest.mark.parametrize("ending", [".bin", ".txt"])
def test_the_smallest_model_is_read_as_its_format_says(tmp_path: Path, ending: str):
    cameras, images, points = read(write(tmp_path), ending)
    assert (cameras[7].model, cameras[7].size) == ("PINHOLE", (48, 64))
    assert cameras[7].values == {"fx": 60, "fy": 59, "cx": 31, "cy": 25}
    assert (images[0].number, images[0].name, images[0].camera) == (3, "a.png", 7)
    np.testing.assert_array_equal(images[0].world_from_camera[:3, 3], [-1, -2, -3])
    np.testing.assert_array_equal(points.positions, [[1, 2, 3]])
    assert {number: seen.tolist() for number, seen in points.seen.items()} == {3: [0]}


@pytest.mark.parametrize("ending", [".bin", ".txt"])
@pytest.mark.parametrize("model", PARAMETERS)
def test_random_models_of_pycolmap_are_read_as_it_has_them(tmp_path: Path, model: str, ending: str):
    pycolmap = pytest.importorskip("pycolmap")
    pycolmap.set_random_seed(7)
    large = {"f": 800.5, "fx": 801.25, "fy": 799.0, "cx": 511.0, "cy": 390.5}
    small = np.random.default_rng(len(model)).uniform(-0.02, 0.02, 16)
    theirs = pycolmap.synthesize_dataset(
        pycolmap.SyntheticDatasetOptions(
            num_rigs=2, num_cameras_per_rig=2, num_frames_per_rig=3, num_points3D=60, track_length=5,
            camera_model_id=getattr(pycolmap.CameraModelId, model),
            camera_params=[large.get(name, small[index]) for index, name in enumerate(PARAMETERS[model])],
        )
    )  # fmt: skip
    (theirs.write_binary if ending == ".bin" else theirs.write_text)(str(tmp_path))
    cameras, images, points = read(tmp_path, ending)
    assert set(cameras) == set(theirs.cameras)
    for number, camera in theirs.cameras.items():
        assert (cameras[number].model, *cameras[number].size) == (camera.model.name, camera.height, camera.width)
        np.testing.assert_allclose(list(cameras[number].values.values()), camera.params)
    assert {image.number: (image.name, image.camera) for image in images} == {
        number: (image.name, image.camera_id) for number, image in theirs.images.items()
    }
    for image in images:
        pose = theirs.images[image.number].cam_from_world().inverse().matrix()
        np.testing.assert_allclose(image.world_from_camera[:3], pose, atol=1e-9)
    places = [tuple(position) for position in np.round(points.positions, 6)]
    tracks = {
        tuple(np.round(point.xyz, 6)): {element.image_id for element in point.track.elements}
        for point in theirs.points3D.values()
    }
    assert set(places) == set(tracks)
    for index, place in enumerate(places):  # at most 50 of 60 may be looked at: every second one
        seeing = {number for number, seen in points.seen.items() if index in seen}
        assert seeing == (tracks[place] if index % 2 == 0 else set())


@pytest.mark.parametrize(
    ("number", "name"),
    [
        (17, "EQUIRECTANGULAR; a panorama has no pinhole: cut it into perspective images"),
        (18, "number 18; undistort"),
        (-1, "number -1; undistort"),
    ],
)
def test_camera_models_that_are_not_read_are_refused_by_name(tmp_path: Path, number: int, name: str):
    write(tmp_path, cameras_bin=CAMERA[:12] + struct.pack("<i", number) + CAMERA[16:])
    with pytest.raises(InputError, match=rf"cameras\.bin: camera 7: expected a camera model of .*, found {name}"):
        read(tmp_path, ".bin")


@pytest.mark.parametrize("name", BINARIES)
@pytest.mark.parametrize("count", [2, 10**9, 2**64 - 1])
def test_counts_beyond_the_file_are_refused_before_anything_is_allocated(tmp_path: Path, name: str, count: int):
    write(tmp_path, **{f"{name}_bin": struct.pack("<Q", count) + BINARIES[name][8:]})
    with pytest.raises(
        InputError, match=rf"{name}\.bin: expected a complete list of COLMAP {name}, found a truncated one"
    ):
        read(tmp_path, ".bin")


@pytest.mark.parametrize("length", [3, 10**12, 2**64 - 1])
def test_lists_in_an_entry_that_reach_beyond_the_file_are_refused(tmp_path: Path, length: int):
    write(tmp_path, points3D_bin=POINT[:-16] + struct.pack("<Q", length) + POINT[-8:])
    with pytest.raises(InputError, match=r"points3D\.bin: .* found a truncated one"):
        read(tmp_path, ".bin")
    two = struct.pack("<Q", 2) + IMAGE[8:-32] + struct.pack("<Q", length) + IMAGE[-24:] + bytes(99)
    write(tmp_path, images_bin=two)
    with pytest.raises(InputError, match=r"images\.bin: .* found a truncated one"):
        read(tmp_path, ".bin")


@pytest.mark.parametrize(
    ("file", "content", "message"),
    [
        ("cameras_txt", "7 PINHOLE 64 48 60 59 31", "line 1: expected 4 parameters of PINHOLE, found 3"),
        ("cameras_txt", "7 PINHOLE 64 48 60 inf 31 25", r"line 1: expected finite parameters of PINHOLE, found \[60.0, inf"),
        ("cameras_txt", "7 PINHOLE 64 99999999999 60 59 31 25", "line 1: expected a whole number, found 99999999999"),
        ("cameras_txt", TEXTS["cameras"] + "\n" + TEXTS["cameras"], "each camera once, found camera 7 twice"),
        ("cameras_bin", CAMERA[:40] + struct.pack("<d", np.nan) + CAMERA[48:], "camera 7: expected finite parameters"),
        ("cameras_txt", "# none\n", "expected the cameras of the images, found none; export the model again"),
        ("cameras_bin", struct.pack("<Q", 0), "expected the cameras of the images, found none; export the model again"),
        ("cameras_bin", CAMERA + b"\0", "found 1 bytes after its end"),
        ("images_txt", "3 1 0 0 0 1 2 3 8 a.png\n", r"line 1: expected a camera that cameras\.txt has, found 8"),
        ("images_txt", "3 1 0 0 0 1 2 nan 7 a.png\n", "line 1: expected a unit quaternion and a translation"),
        ("images_txt", "3 9 0 0 0 1 2 3 7 a.png\n", "line 1: expected a unit quaternion and a translation"),
        ("images_txt", TEXTS["images"] + "\n" + TEXTS["images"], "line 3: expected each image once, found image 3 again"),
        ("images_txt", "3 1 0 0 0 1 2 3 7 a.png\n1.5 2.5 0x5", "line 2: expected the points of an image"),
        ("images_txt", "3 1 0 0 0 1 2 3 7 a.png\n1.5 2.5 -1\n1.5 2.5 -1", "line 3: expected IMAGE_ID QW"),
        ("images_txt", "1.5 2.5 -1\n3 1 0 0 0 1 2 3 7 a.png", "line 1: expected IMAGE_ID QW"),
        ("images_bin", struct.pack("<Q", 1) + IMAGE[8:72] + b"7" * 30, "found a truncated one"),
        ("points3D_txt", "0 1 2 3 9 8 7 0.5 4 0", "points that images of this model see, found some seen by image 4"),
        ("points3D_txt", f"0 1 2 3 9 8 7 0.5 {2**64:030} 0", "line 1: expected a whole number, found 0000000000184467440737095516"),
        ("points3D_txt", "0 1 2 inf 9 8 7 0.5 3 0", r"expected finite positions, found \[1.0, 2.0, inf\]"),
        ("points3D_txt", "0 1 2 3 9 8 7 0.5 3", "line 1: expected POINT3D_ID X Y Z"),
        ("points3D_bin", POINT[:-8] + struct.pack("<II", 4, 0), "found some seen by image 4"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_with_its_place(tmp_path: Path, file: str, content: bytes | str, message: str):
    write(tmp_path, **{file: content})
    name, ending = file.split("_")
    with pytest.raises(InputError, match=rf"{name}\.{ending}: .*{message}"):
        read(tmp_path, f".{ending}")


@pytest.mark.parametrize(
    "second",
    ["", "\n", "\n# points", "1.5 2.5 -1\n", "1.5 2.5 18446744073709551615 .5 1e-3 7\n", "\n\n"],
    ids=["left out", "empty", "comment", "one point", "two points", "two empty ones"],
)
@pytest.mark.parametrize("name", ["a.png", "my room (1).png", "12 1_2 3", "1 2", "1 2 nan.png", "a b c d e.png"])
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_every_image_is_listed_whatever_its_name_and_with_or_without_its_second_line(
    tmp_path: Path, second: str, name: str, ends: str
):
    lines = [f"{number} 1 0 0 0 {number} 2 3 7 {name}\n{second}\n" for number in (3, 4, 5)]
    text = "".join(lines).replace("\n\n", "\n" if not second else "\n\n")
    (tmp_path / "images.txt").write_bytes(text.replace("\n", ends).encode())
    images = read_images(tmp_path / "images.txt", {7})
    assert [(image.number, image.name) for image in images] == [(number, name) for number in (3, 4, 5)]
    assert [image.world_from_camera[:3, 3].tolist() for image in images] == [[-n, -2, -3] for n in (3, 4, 5)]


def test_a_point_that_no_image_sees_belongs_to_none(tmp_path: Path):
    (tmp_path / "points3D.txt").write_text("7 1.5 -2.0 3.0 255 0 0 0.5\n")
    found = read_points(tmp_path / "points3D.txt", {1, 2}, 100)
    assert found.positions.tolist() == [[1.5, -2.0, 3.0]]
    assert found.seen == {}


def test_a_model_without_points_has_none_for_any_image(tmp_path: Path):
    (tmp_path / "points3D.txt").write_text("# none\n")
    found = read_points(tmp_path / "points3D.txt", {1, 2}, 100)
    assert found.positions.shape == (0, 3)
    assert found.seen == {}


@pytest.mark.parametrize(
    "line", [b"11 11 1 " * 40 + b"x", b"1" * 40_000 + b" 2", b"1.1e1 " * 5000 + b"x", b"1 2 " + b"3" * 40_000 + b"x"]
)
def test_lines_that_look_like_points_are_judged_at_once(line: bytes):
    """A number that could be read in two ways doubled the time with each of them."""
    start = time.process_time()
    assert colmap_files._IMAGE_POINTS.fullmatch(line) is None
    assert time.process_time() - start < 1
    assert colmap_files._IMAGE_POINTS.fullmatch(b"1.5 -2 -1 3e2 .5 7")
    assert colmap_files._IMAGE_POINTS.fullmatch(b"1. nan 12")

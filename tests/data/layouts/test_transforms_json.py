"""transforms.json: every dialect gives the same cameras, and what is broken is named by its key."""

from __future__ import annotations

import json
import math
import re
import shutil
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from landmarks import POINTS, drawn, found, looking
from PIL import Image

from semgs.data.scenes import open_scene, open_scenes
from semgs.files.errors import InputError
from semgs.files.images.pictures import jpeg_bytes, png_bytes
from semgs.geometry.cameras import project

SIZE = (120, 170)
FX, FY, CX, CY = 150.0, 143.0, 91.3, 55.2
PINHOLE = {"fl_x": FX, "fl_y": FY, "cx": CX, "cy": CY, "w": SIZE[1], "h": SIZE[0]}
DISTORTION = {"k1": 0.11, "k2": -0.06, "p1": 0.003, "p2": -0.004, "k3": 0.01}
FAR = [[1, 0, 0, 5], [0, 1, 0, -3e12], [0, 0, 1, 2], [0, 0, 0, 1]]
EYES = [(0.5, -0.3, -3.2), (-0.4, 0.2, -2.9), (0.1, 0.4, -3.4)]


def opengl(eye: tuple[float, float, float]) -> np.ndarray:
    """World from camera with OpenGL axes: right, up, backward."""
    pose = looking(eye, (0, 0, 0))
    return np.stack((pose[:, 0], -pose[:, 1], -pose[:, 2], pose[:, 3]), axis=1)


def pixels(matrix: np.ndarray, fx=FX, fy=FY, cx=CX, cy=CY, k1=0.0, k2=0.0, p1=0.0, p2=0.0, k3=0.0) -> np.ndarray:
    """Where the landmarks are seen, by the format's own words: y up, looking along -z, OpenCV's distortion."""
    inside = np.linalg.inv(matrix) @ np.c_[POINTS, np.ones(len(POINTS))].T
    x, y = inside[0] / -inside[2], -inside[1] / -inside[2]
    r2 = x * x + y * y
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack((fx * u + cx, fy * v + cy), axis=1)


def write(
    folder: Path, shared: dict[str, Any], frames: list[dict[str, Any]] | None = None, **intrinsics: float
) -> Path:
    """A scene of three pictures of the landmarks; `intrinsics` are those they are drawn with."""
    (folder / "images").mkdir(parents=True, exist_ok=True)
    listed = []
    for index, eye in enumerate(EYES):
        picture = drawn(SIZE, pixels(opengl(eye), **intrinsics))
        Image.fromarray(picture).save(folder / "images" / f"{index:03d}.png")
        listed.append({"file_path": f"images/{index:03d}.png", "transform_matrix": opengl(eye).tolist()})
        listed[-1].update({} if frames is None else frames[index])
    (folder / "transforms.json").write_text(json.dumps({**shared, "frames": listed}))
    return folder


def offsets(folder: Path) -> float:
    """The farthest that a landmark is from where the cameras put it, over all frames [px]."""
    views = open_scene(folder).read([0, 1, 2], "native")
    worst = 0.0
    for index, image in enumerate(views.images):
        expected = project(torch.from_numpy(POINTS), views.cameras[index])[:, :2].numpy()
        inside = ((expected > 8) & (expected < np.array(SIZE[::-1]) - 8)).all(axis=1)
        assert inside.sum() >= 8
        worst = max(worst, float(np.abs(found(image, expected[inside], (8, 8)) - expected[inside]).max()))
    return worst


ANGLE_X = 2 * math.atan(SIZE[1] / (2 * FX))
ANGLE_Y = 2 * math.atan(SIZE[0] / (2 * FY))
CENTRAL = {"fx": FX, "fy": FX, "cx": SIZE[1] / 2, "cy": SIZE[0] / 2}


@pytest.mark.parametrize(
    ("shared", "drawn_with"),
    [
        ({"camera_model": "PINHOLE", **PINHOLE}, {}),
        ({"camera_model": "OPENCV", **PINHOLE, **DISTORTION}, DISTORTION),
        ({**PINHOLE, **DISTORTION, "k4": 0.0, "aabb_scale": 4, "camera_angle_x": 9.0}, DISTORTION),
        ({**PINHOLE, "k1": 0.11, "k2": -0.06}, {"k1": 0.11, "k2": -0.06}),
        ({"camera_angle_x": ANGLE_X}, CENTRAL),
        ({"camera_angle_x": ANGLE_X, "w": float(SIZE[1]), "h": float(SIZE[0]), "fl_y": None}, CENTRAL),
        ({"camera_angle_x": ANGLE_X, "camera_angle_y": ANGLE_Y}, {**CENTRAL, "fy": FY}),
        ({"fl_x": FX, "cx": CX, "cy": CY}, {"fy": FX}),
    ],
    ids=[
        "nerfstudio",
        "distorted",
        "instant-ngp",
        "k1 k2 alone",
        "angle",
        "angle and size",
        "two angles",
        "one focal length",
    ],
)
def test_a_point_is_seen_on_its_feature_in_every_dialect(tmp_path, shared, drawn_with):
    assert offsets(write(tmp_path, shared, **drawn_with)) < 0.1


def test_intrinsics_may_be_given_per_frame_or_partly_so(tmp_path):
    per_frame = [
        {"fl_x": 120.0 + 9 * n, "fl_y": 125.0 + 5 * n, "cx": 80.0 + n, "cy": 61.0, "w": 170, "h": 120} for n in range(3)
    ]
    write(tmp_path, {}, per_frame)
    partly = [{"fl_x": frame["fl_x"]} for frame in per_frame]
    write(tmp_path / "partly", PINHOLE, partly)
    for index in range(3):
        camera = open_scene(tmp_path).cameras[index]
        assert camera.intrinsics.tolist() == [
            [120.0 + 9 * index, 0, 80.0 + index],
            [0, 125.0 + 5 * index, 61],
            [0, 0, 1],
        ]
        assert open_scene(tmp_path / "partly").cameras[index].intrinsics[0].tolist() == [120.0 + 9 * index, 0, CX]
        assert open_scene(tmp_path / "partly").cameras[index].intrinsics[1].tolist() == [0, FY, CY]


def test_opengl_axes_become_opencvs(tmp_path):
    cameras = open_scene(write(tmp_path, PINHOLE)).cameras
    for eye, camera in zip(EYES, cameras, strict=True):
        np.testing.assert_allclose(camera.world_from_camera.numpy(), looking(eye, (0, 0, 0)), atol=1e-12)


@pytest.mark.parametrize(
    "spelling",
    ["./images/{:03d}.png", "images\\{:03d}.png", ".\\images\\{:03d}.png", "images/{:03d}", "{}/images/{:03d}.png"],
)
def test_paths_are_found_however_they_are_spelt(tmp_path, spelling):
    arguments = (str(tmp_path),) if spelling.startswith("{}") else ()
    frames = [{"file_path": spelling.format(*arguments, index)} for index in range(3)]
    scene = open_scene(write(tmp_path, PINHOLE, frames))
    assert len(scene) == 3
    assert scene.frames[1].picture.samefile(tmp_path / "images" / "001.png")


@pytest.mark.parametrize(("said", "there"), [("NFC", "NFD"), ("NFD", "NFC")])
def test_names_in_another_form_of_unicode_are_found_and_counted(tmp_path, said, there):
    names = [f"Büro/Küche {index}.png" for index in range(3)]
    folder = write(tmp_path / "room", PINHOLE, [{"file_path": unicodedata.normalize(said, name)} for name in names])
    (folder / "images").rename(folder / unicodedata.normalize(there, "Büro"))
    held = [folder / unicodedata.normalize(there, name) for name in names]
    for index, file in enumerate(held):
        (file.parent / f"{index:03d}.png").rename(file)
    scene = open_scene(folder)
    assert [frame.picture for frame in scene.frames] == held
    shutil.make_archive(str(tmp_path / "zipped"), "zip", folder)
    zipped = open_scene(tmp_path / "zipped.zip")
    assert [frame.picture.name for frame in zipped.frames] == [file.name for file in held]
    assert zipped.notes == scene.notes
    assert any(
        note.startswith("3 of 3 listed images have names with another form of letters such as é")
        for note in scene.notes
    )


def test_the_synthetic_nerf_dialect_is_read(tmp_path):
    write(
        tmp_path, {"camera_angle_x": ANGLE_X}, [{"file_path": f"./images/{n:03d}", "rotation": 0.01} for n in range(3)]
    )
    for path in sorted((tmp_path / "images").iterdir()):
        rgba = np.dstack((np.array(Image.open(path)), np.full(SIZE, 255, np.uint8)))
        rgba[0, 0, 3] = 0
        Image.fromarray(rgba).save(path)
    (tmp_path / "transforms.json").rename(tmp_path / "transforms_train.json")
    scene = open_scene(tmp_path)
    assert scene.read([0], "native").images[0, :, 0, 0].tolist() == [1, 1, 1]
    assert (
        "3 images have an alpha channel; transparent areas become white. To hide them, write a mask of each image (black = hidden): mask_path of its frame."
        in scene.notes
    )


def test_a_transforms_file_may_be_named_itself(tmp_path):
    write(tmp_path, PINHOLE)
    (tmp_path / "transforms.json").rename(tmp_path / "mine.json")
    assert len(open_scene(tmp_path / "mine.json")) == 3


def test_absent_pictures_are_counted_and_said_and_positions_count_the_others(tmp_path):
    write(tmp_path, PINHOLE)
    (tmp_path / "images" / "001.png").unlink()
    scene = open_scene(tmp_path)
    assert [frame.name for frame in scene.frames] == ["images/000.png", "images/002.png"]
    assert scene.absent == ("images/001.png",)
    assert scene.notes == ("1 of 3 listed images are missing, the first is images/001.png.",)
    torch.testing.assert_close(scene.read([1], "native").cameras.centres[0], torch.tensor(EYES[2], dtype=torch.float64))


@pytest.mark.parametrize("folder", ["/home/alice/room/", "C:\\Users\\alice\\room\\", "gone/"])
def test_paths_of_another_computer_are_said_to_have_to_be_relative(tmp_path, folder):
    write(tmp_path, PINHOLE)
    content = json.loads((tmp_path / "transforms.json").read_text())
    for frame in content["frames"]:
        frame["file_path"] = folder + frame["file_path"]
    (tmp_path / "transforms.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"found 0 .* the first missing one is") as caught:
        open_scene(tmp_path)
    assert ("make them relative to the file that lists them" in str(caught.value)) == (folder != "gone/")


@pytest.mark.parametrize(
    ("listed", "advice"),
    [
        (
            "images/frame_0361.png{}.png",
            "the first missing one is images/frame_0361.png0.png. Its folder has 3 other images, from 000.png to 002.png: correct the names in the file",
        ),
        ("gone/{}.png", "the first missing one is gone/0.png"),
        ("empty/{}.png", "the first missing one is empty/0.png"),
    ],
)
def test_of_missing_images_the_ones_that_are_there_are_named(tmp_path, listed, advice):
    """As Blender's file output may add a number behind a name that ends in .png."""
    (tmp_path / "empty").mkdir()
    folder = write(tmp_path, PINHOLE, [{"file_path": listed.format(index)} for index in range(3)])
    with pytest.raises(InputError) as caught:
        open_scene(folder)
    said = str(caught.value).partition("without their image); ")[2]
    assert said.startswith(advice)
    assert ("correct the names" in said) == ("images/" in listed)


def test_one_picture_is_not_a_scene(tmp_path):
    write(tmp_path, PINHOLE)
    for name in ("000", "002"):
        (tmp_path / "images" / f"{name}.png").unlink()
    with pytest.raises(InputError, match=r"at least two usable frames, found 1 \(3 listed, 2 without"):
        open_scene(tmp_path)


def edited(folder: Path, edit: Callable[[dict[str, Any]], object]) -> Path:
    """The scene with its transforms file changed."""
    write(folder, PINHOLE)
    content = json.loads((folder / "transforms.json").read_text())
    edit(content)
    (folder / "transforms.json").write_text(json.dumps(content))
    return folder


def matrix(frame: int, change: Callable[[np.ndarray], object]) -> Callable[[dict[str, Any]], object]:
    """An edit of one pose."""

    def edit(content: dict[str, Any]) -> None:
        pose = np.array(content["frames"][frame]["transform_matrix"])
        change(pose)
        content["frames"][frame]["transform_matrix"] = pose.tolist()

    return edit


def assigned(key: str, value: object, frame: int | None = None) -> Callable[[dict[str, Any]], object]:
    """An edit of one key, of a frame or shared."""
    return lambda content: (content if frame is None else content["frames"][frame]).update({key: value})


@pytest.mark.parametrize(
    ("edit", "key", "found_text"),
    [
        (matrix(1, lambda m: m.__setitem__((slice(0, 3), 1), 0)), "frames[1].transform_matrix", "it is singular"),
        (matrix(0, lambda m: m.__setitem__(slice(0, 3), 2 * m[:3])), "frames[0].transform_matrix", "determinant 8 that is not a rotation (it scales by 2)"),
        (matrix(0, lambda m: m.__setitem__(slice(0, 3), m[:3] @ np.diag((1, 1.1, 1.2, 1)))), "frames[0].transform_matrix", "(its columns are 1, 1.1 and 1.2 long)"),
        (matrix(0, lambda m: m.__setitem__((slice(0, 3), 0), m[:3, 0] + m[:3, 1])), "frames[0].transform_matrix", "(it scales or shears)"),
        (matrix(0, lambda m: m.__setitem__((slice(0, 3), 1), -m[:3, 1])), "frames[0].transform_matrix", "mirrors"),
        (matrix(2, lambda m: m.__setitem__((3, 0), 1)), "frames[2].transform_matrix", "a last row of"),
        (assigned("transform_matrix", [[1, 0, 0, 0]] * 3, 1), "frames[1].transform_matrix", "shape (3, 4)"),
        (assigned("transform_matrix", [[1, 0], [1]], 1), "frames[1].transform_matrix", "not a matrix of numbers"),
        (assigned("transform_matrix", "identity", 1), "frames[1].transform_matrix", "not a matrix of numbers"),
        (assigned("transform_matrix", None, 1), "frames[1].transform_matrix", "nothing"),
        (assigned("fl_x", 0), "fl_x", "0"),
        (assigned("fl_y", -3.0, 1), "frames[1].fl_y", "-3"),
        (assigned("fl_x", "500 px"), "fl_x", "'500 px'"),
        (assigned("fl_x", 10**400), "fl_x", "1000"),
        (assigned("cx", math.nan), "cx", "nan"),
        (assigned("w", 170.5), "w", "170.5"),
        (assigned("h", 0), "h", "0"),
        (assigned("k1", True), "k1", "True"),
        (assigned("k1", -1e6), "k1", "cannot be undone"),
        (assigned("fl_x", 1e9), "fl_x", "0.01 to 100 times the longer side of 170 px"),
        (assigned("fl_x", 1e-9), "fl_x", "0.01 to 100 times the longer side of 170 px"),
        (assigned("cx", 1e300), "fl_x", "principal point (1e+300, 55.2)"),
        (assigned("transform_matrix", FAR, 1), "frames[1].transform_matrix", "a position 3e+12 from the origin; at most 1e+12 is allowed"),
        (assigned("k4", 0.1), "k4", "0.1"),
        (assigned("camera_model", "OPENCV_FISHEYE"), "camera_model", "OPENCV_FISHEYE"),
        (assigned("is_fisheye", True), "is_fisheye", "True"),
        (lambda content: [content.pop(key) for key in ("fl_x", "fl_y")], "frames[0].fl_x", "neither"),
        (lambda content: content.update(fl_x=None, fl_y=None, camera_angle_x=4.0), "camera_angle_x", "4.0"),
        (assigned("frames", []), "frames", "[]"),
        (assigned("frames", {"a": 1}), "frames", "{'a': 1}"),
        (assigned("frames", [1, 2]), "frames[0]", "1"),
        (lambda content: content.pop("frames"), "frames", "nothing"),
        (assigned("file_path", None, 1), "frames[1].file_path", "nothing"),
        (assigned("file_path", 7, 1), "frames[1].file_path", "7"),
        (assigned("file_path", "./images/000.png", 1), "frames[1].file_path", "as in frames[0].file_path"),
        (assigned("metric", "yes"), "metric", "'yes'"),
        (assigned("applied_transform", [[1, 2], [3, 4]]), "applied_transform", "[[1, 2], [3, 4]]"),
        (assigned("depth_unit_scale_factor", -1), "depth_unit_scale_factor", "-1"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_named_by_its_key(tmp_path, edit, key, found_text):
    with pytest.raises(InputError) as caught:
        open_scene(edited(tmp_path, edit))
    assert caught.value.key == key
    assert found_text in caught.value.found
    assert caught.value.path == tmp_path / "transforms.json"
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"{", b"[1, 2]", b"\xff\xfe\x00", b'{"frames": [}', b"[" * 100_000])
def test_what_is_no_json_object_is_refused(tmp_path, content):
    (tmp_path / "transforms.json").write_bytes(content)
    with pytest.raises(InputError, match=r"transforms\.json: expected"):
        open_scene(tmp_path)


def test_pictures_of_another_size_than_their_cameras_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"expected 340x240 pixels .* as its camera says, found 170x120"):
        open_scene(write(tmp_path, {**PINHOLE, "w": 340, "h": 240}))
    with pytest.raises(InputError, match="w: expected"):
        open_scene(write(tmp_path, {**PINHOLE, "w": 340, "h": None}))


def test_a_rotated_photo_is_read_as_its_camera_was_made(tmp_path):
    write(tmp_path, PINHOLE)
    path = tmp_path / "images" / "000.png"
    upright = np.array(Image.open(path))
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(np.ascontiguousarray(np.rot90(upright))).save(path, exif=exif)  # stored lying, to be turned
    np.testing.assert_allclose(
        open_scene(tmp_path).read([0], "native").images[0].permute(1, 2, 0) * 255, upright, atol=1e-3
    )
    Image.fromarray(upright).save(path, exif=exif)  # stored as the camera says; the turn is not wanted
    np.testing.assert_allclose(
        open_scene(tmp_path).read([0], "native").images[0].permute(1, 2, 0) * 255, upright, atol=1e-3
    )
    edited_size = json.loads((tmp_path / "transforms.json").read_text())
    del edited_size["w"], edited_size["h"]
    (tmp_path / "transforms.json").write_text(json.dumps(edited_size))
    with pytest.raises(InputError, match="EXIF orientation 6 and an unknown camera size"):
        open_scene(tmp_path)


def test_a_truncated_picture_is_told_when_it_is_read(tmp_path):
    write(tmp_path, PINHOLE)
    path = tmp_path / "images" / "001.png"
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    scene = open_scene(tmp_path)
    with pytest.raises(InputError, match=r"001\.png: expected a complete image"):
        scene.read([0, 1], "native")


def with_maps(folder: Path, shared: dict[str, Any], depths: np.ndarray, labels: np.ndarray, frames=(0, 1, 2)) -> Path:
    """The scene with the same depth and label map for some of its frames."""
    extra = [{"depth_file_path": f"d{n}.png", "label_file_path": f"l{n}.png"} if n in frames else {} for n in range(3)]
    write(folder, {**PINHOLE, "label_set": "scannet20", **shared}, extra)
    for index in frames:
        cv2.imwrite(str(folder / f"d{index}.png"), depths)
        cv2.imwrite(str(folder / f"l{index}.png"), labels)
    return folder


def test_maps_that_are_jpeg_are_left_out_with_the_reason(tmp_path: Path):
    folder = write(tmp_path, PINHOLE, [{"label_file_path": name} for name in ("a.jpg", "b.JPEG", "c.tif")])
    for name in ("a.jpg", "b.JPEG", "c.tif"):
        Image.fromarray(np.zeros(SIZE, np.uint8)).save(folder / name)
    notes = open_scene(folder).notes
    said = "2 of 3 listed depth, label and mask files are left out, as JPEG changes numbers (make them again, as PNG), the first is a.jpg."
    assert said in notes
    assert "1 of 3 listed depth, label and mask files have an unsupported format, the first is c.tif." in notes


DEPTHS = np.random.default_rng(0).integers(0, 9000, SIZE, dtype=np.uint16)
LABELS = np.random.default_rng(1).choice(np.array([0, 4, 19, 255], np.uint8), SIZE)


def test_depths_are_metres_and_labels_are_indices(tmp_path):
    views = open_scene(with_maps(tmp_path, {}, DEPTHS, LABELS)).read([0, 2], "native")
    np.testing.assert_allclose(views.depths[1], DEPTHS / 1000, rtol=1e-6)
    np.testing.assert_array_equal(views.labels[0], LABELS)
    assert open_scene(tmp_path).unit == "metric"
    assert open_scene(tmp_path).classes.name == "scannet20"
    scaled = open_scene(with_maps(tmp_path / "b", {"depth_unit_scale_factor": 0.00025}, DEPTHS, LABELS)).read(
        [0], "native"
    )
    np.testing.assert_allclose(scaled.depths[0], DEPTHS / 4000, rtol=1e-6)


def test_depths_may_be_arrays_with_holes(tmp_path):
    write(tmp_path, PINHOLE, [{"depth_file_path": f"{index}.npy"} for index in range(3)])
    depths = DEPTHS.astype(np.float64)
    depths[0, :3] = math.nan, math.inf, -1
    for index in range(3):
        np.save(tmp_path / f"{index}.npy", depths)
    read = open_scene(tmp_path).read([1], "native").depths[0]
    assert read[0, :3].tolist() == [0, 0, 0]
    np.testing.assert_allclose(read[1:], DEPTHS[1:] / 1000, rtol=1e-6)
    np.save(tmp_path / "1.npy", np.array([{"a": 1}]), allow_pickle=True)
    with pytest.raises(InputError, match=r"1\.npy: expected an array"):
        open_scene(tmp_path).read([1], "native")


def test_labels_and_depths_are_given_only_where_all_frames_have_them(tmp_path):
    scene = open_scene(with_maps(tmp_path, {}, DEPTHS, LABELS, frames=(0, 1)))
    assert scene.read([0, 1], "native").labels is not None
    assert scene.read([1, 2], "native").labels is None
    assert scene.read([1, 2], "native").depths is None


def test_smaller_depth_maps_of_the_same_aspect_are_enlarged_by_nearest_centres(tmp_path):
    small = DEPTHS[:40, :57]
    views = open_scene(with_maps(tmp_path, {}, small, LABELS)).read([0], "native")
    rows = ((np.arange(120) + 0.5) * 40 / 120).astype(int)
    columns = ((np.arange(170) + 0.5) * 57 / 170).astype(int)
    np.testing.assert_allclose(views.depths[0], small[rows][:, columns] / 1000, rtol=1e-6)
    with pytest.raises(InputError, match=r"d0\.png: expected 170x120 pixels"):
        open_scene(with_maps(tmp_path / "b", {}, DEPTHS[:, :100], LABELS)).read([0], "native")


def test_labels_outside_the_table_are_refused_with_file_and_frame(tmp_path):
    with pytest.raises(InputError, match=r"l1\.png: frame images/001\.png: expected labels 0\.\.19 .* found 20 at"):
        open_scene(with_maps(tmp_path, {}, DEPTHS, np.where(LABELS == 19, np.uint8(20), LABELS))).read([1])


@pytest.mark.parametrize(
    ("shared", "key"),
    [({"label_set": "ade20k"}, "label_set"), ({"label_set": None}, "label_set"), ({"label_ignore": 0}, "label_ignore")],
)
def test_labels_need_a_known_table(tmp_path, shared, key):
    with pytest.raises(InputError) as caught:
        open_scene(with_maps(tmp_path, shared, DEPTHS, LABELS))
    assert caught.value.key == key


def test_labels_of_an_unknown_table_are_left_out_and_told_where_nobody_needs_them(tmp_path):
    folder = with_maps(tmp_path / "a", {"label_set": "scannet200"}, DEPTHS, LABELS)
    for needed in (open_scene, lambda path: open_scenes(path.parent)):
        with pytest.raises(InputError, match="label_set: expected the class table"):
            needed(folder)
    scene = open_scene(folder, needs_labels=False)
    assert scene.classes is None
    assert scene.read([0, 1]).labels is None
    assert scene.read([0, 1]).depths is not None
    assert [note.split(":")[0] for note in scene.notes[:-1]] == ["Assumed"]
    assert re.fullmatch(
        r"The labels are left out: .*label_set: .* unknown class table 'scannet200'; known: scannet20, lsm8\.",
        scene.notes[-1],
    )


def test_maps_of_distorted_frames_move_with_their_picture_and_are_never_mixed(tmp_path):
    labels = np.where(np.add.outer(np.arange(SIZE[0]) // 12, np.arange(SIZE[1]) // 12) % 2, np.uint8(3), np.uint8(17))
    scene = open_scene(with_maps(tmp_path, DISTORTION, np.where(labels == 3, 1000, 5000).astype(np.uint16), labels))
    for index in range(3):
        Image.fromarray(np.repeat((labels * 10)[..., None], 3, -1)).save(tmp_path / "images" / f"{index:03d}.png")
    views = scene.read([0], "native")
    assert set(views.labels.unique().tolist()) == {3, 17}
    assert (views.depths[views.labels == 3] == 1).all()
    assert (views.depths[views.labels == 17] == 5).all()
    flat = torch.where(views.labels[0] == 3, 30 / 255, 170 / 255)
    assert (((views.images[0, 0] - flat).abs() < 0.01).float().mean()) > 0.8  # but for the edges of the squares


NGP = [{"depth_path": f"d{n}.png"} for n in range(3)]


def test_depth_of_instant_ngp_is_read_with_its_scale(tmp_path):
    folder = write(tmp_path, {**PINHOLE, "integer_depth_scale": 10 / 65535, "enable_depth_loading": True}, NGP)
    for number in range(3):
        cv2.imwrite(str(folder / f"d{number}.png"), DEPTHS)
    views = open_scene(folder).read([0, 2], "native")
    np.testing.assert_allclose(views.depths[1], DEPTHS * (10 / 65535), rtol=1e-6)


@pytest.mark.parametrize(
    ("shared", "reason"),
    [
        ({}, "integer_depth_scale is missing or 0"),
        ({"integer_depth_scale": -1}, "integer_depth_scale is missing or 0"),
        ({"integer_depth_scale": 0.001, "enable_depth_loading": False}, "enable_depth_loading is false"),
        ({"integer_depth_scale": 0.001, "enable_depth_loading": 0}, "enable_depth_loading is false"),
    ],
)
def test_depth_that_instant_ngp_would_not_read_is_left_out_with_a_note(tmp_path, shared, reason):
    folder = write(tmp_path, {**PINHOLE, **shared}, NGP)
    for number in range(3):
        cv2.imwrite(str(folder / f"d{number}.png"), DEPTHS)
    scene = open_scene(folder)
    assert scene.read([0], "native").depths is None
    assert f"3 of 3 files in depth_path are left out, as {reason}, the first is d0.png." in scene.notes


@pytest.mark.parametrize(
    ("content", "kind"),
    [
        (png_bytes(np.zeros(SIZE, np.uint8)), "PNG of 8 bits"),
        (png_bytes(np.zeros((*SIZE, 3), np.uint8)), "PNG of 8 bits in colour"),
        (jpeg_bytes(np.zeros((*SIZE, 3), np.uint8), 90), "JPEG"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:4d\nsize 9\n", "Git LFS pointers (run git lfs pull)"),
    ],
)
@pytest.mark.parametrize("zipped", [False, True])
def test_depth_of_other_kinds_is_left_out_with_a_note(tmp_path, content, kind, zipped):
    folder = write(tmp_path / "room", PINHOLE, [{"depth_file_path": f"d{n}.png"} for n in range(3)])
    for number in range(3):
        (folder / f"d{number}.png").write_bytes(content)
    path = Path(shutil.make_archive(str(tmp_path / "a"), "zip", folder)) if zipped else folder
    scene = open_scene(path)
    assert scene.read([0, 1], "native").depths is None
    said = f"3 of 3 depth maps are left out, as they are {kind}, not 16 bits of one channel, the first is d0.png."
    assert said in scene.notes


def test_numbers_may_be_written_as_text(tmp_path):
    words = {key: str(value) for key, value in {**PINHOLE, **DISTORTION, "k4": "0", "k5": "0.0"}.items()}
    scene = open_scene(write(tmp_path / "a", {**words, "is_fisheye": "false"}))
    same = open_scene(write(tmp_path / "b", {**PINHOLE, **DISTORTION}))
    for frame, other in zip(scene.frames, same.frames, strict=True):
        assert frame.lens == other.lens
        np.testing.assert_array_equal(frame.world_from_camera, other.world_from_camera)
    matrices = [{"transform_matrix": [[str(x) for x in row] for row in opengl(eye).tolist()]} for eye in EYES]
    read = open_scene(write(tmp_path / "c", words, matrices)).frames[2].world_from_camera
    np.testing.assert_array_equal(read, same.frames[2].world_from_camera)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("fl_x", "wide"),
        ("fl_x", "1_50"),
        ("fl_x", "150,0"),
        ("k4", "0.1"),
        ("is_fisheye", "true"),
        ("k1", "nan"),
        ("w", ""),
    ],
)
def test_text_that_is_no_number_is_refused_with_its_key(tmp_path, key, value):
    with pytest.raises(InputError) as caught:
        open_scene(write(tmp_path, {**PINHOLE, key: value}))
    assert caught.value.key == key


def test_sparse_points_that_cannot_be_read_are_left_out_with_a_note(tmp_path):
    folder = write(tmp_path, {**PINHOLE, "ply_file_path": "points.ply"})
    assert open_scene(folder).notes == ("The sparse points are left out: points.ply is missing.",)
    (folder / "points.ply").write_text("ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\nend_header\n")
    scene = open_scene(folder)
    assert scene.points is None
    assert "The sparse points are left out: " in scene.notes[0]
    assert "points.ply: expected 9 lines after the header, as it says, found 0." in scene.notes[0]


def test_a_scene_has_the_name_of_its_folder_however_it_is_typed(tmp_path, monkeypatch):
    write(tmp_path / "kitchen", PINHOLE)
    monkeypatch.chdir(tmp_path / "kitchen/images")
    typed = ("..", "../../kitchen", "../images/..", "../transforms.json")
    assert [open_scene(one).name for one in typed] == ["kitchen"] * 4
    assert [scene.name for scene in open_scenes("..")] == ["kitchen"]


def test_absent_maps_are_said(tmp_path):
    write(tmp_path, PINHOLE, [{"depth_file_path": f"{n}.png", "mask_path": "m.png"} for n in range(3)])
    scene = open_scene(tmp_path)
    assert scene.read([0], "native").depths is None
    assert any("6 of 6 listed depth, label and mask files are missing" in note for note in scene.notes)


def test_masks_hide_pixels_and_their_depth(tmp_path):
    """White is visible and black hidden, as in nerfstudio; the first 20 rows are hidden in frame 0, all but one pixel visible in frame 1."""
    folder = write(tmp_path, PINHOLE, [{"depth_file_path": "d.png", "mask_path": f"m{n}.png"} for n in range(2)] + [{}])
    Image.fromarray(np.full(SIZE, 2000, np.uint16)).save(folder / "d.png")
    masks = np.full((2, *SIZE), 255, np.uint8)
    masks[0, :20], masks[1, 3, 4] = 0, 0
    for number, mask in enumerate(masks):
        Image.fromarray(mask).save(folder / f"m{number}.png")
    views = open_scene(folder).read([0, 1], "native")
    assert (views.hidden.numpy() == (masks == 0)).all()
    assert ((views.depths.numpy() == 0) == (masks == 0)).all()
    assert open_scene(folder).read([2], "native").hidden is None
    small = open_scene(folder).read([0, 1], (60, 85))
    assert small.hidden.sum((1, 2)).tolist() == [10 * 85, 1]


def test_a_mask_that_hides_everything_is_refused(tmp_path):
    folder = write(tmp_path, PINHOLE, [{"mask_path": "m.png"}, {}, {}])
    Image.fromarray(np.zeros(SIZE, np.uint8)).save(folder / "m.png")
    with pytest.raises(
        InputError, match=r"000\.png: expected an image of which some pixels are visible, found all are masked or black"
    ):
        open_scene(folder).read([0, 1])


def test_the_black_border_of_a_photo_is_hidden(tmp_path):
    """Three black rows and columns on each side, and the three pixels behind them: at half the size, three."""
    folder = write(tmp_path, PINHOLE)
    path = folder / "images" / "001.png"
    image = np.maximum(np.asarray(Image.open(path)), 60)
    image[:3] = image[-3:] = image[:, :3] = image[:, -3:] = 0
    Image.fromarray(image).save(path)
    views = open_scene(folder).read([1], (60, 85))
    expected = np.ones((60, 85), np.bool_)
    expected[3:-3, 3:-3] = False
    assert (views.hidden[0].numpy() == expected).all()


@pytest.mark.parametrize(
    ("shared", "depth", "unit"),
    [
        ({}, False, "unknown"),
        ({"metric": True}, False, "metric"),
        ({}, True, "metric"),
        ({"metric": False}, True, "unknown"),
        ({"metric": "true"}, False, "metric"),
        ({"metric": "False"}, True, "unknown"),
    ],
)
def test_a_scene_is_metric_if_it_says_so_or_has_depths_of_a_room(tmp_path, shared, depth, unit):
    frames = [{"depth_file_path": f"{n}.png"} if depth else {} for n in range(3)]
    folder = write(tmp_path, {**PINHOLE, **shared}, frames)
    for number in range(3):
        cv2.imwrite(str(folder / f"{number}.png"), DEPTHS)
    assert open_scene(folder).unit == unit


def test_nerfstudios_transform_of_the_world_is_kept_beside_the_poses(tmp_path):
    applied = [[0, 1, 0, 0.5], [1, 0, 0, -2], [0, 0, -1, 0]]
    scene = open_scene(write(tmp_path, {**PINHOLE, "applied_transform": applied, "applied_scale": 0.4}))
    np.testing.assert_array_equal(scene.applied_transform, applied)
    assert scene.applied_scale == 0.4
    np.testing.assert_allclose(scene.cameras[0].centres, EYES[0])


@pytest.mark.parametrize(("others", "said"), [(["val"], "transforms_val.json"), (["test", "val"], "transforms_test.json, transforms_val.json"), ([], None)])  # fmt: skip
def test_other_splits_beside_the_training_split_are_named(tmp_path: Path, others: list[str], said: str | None):
    folder = write(tmp_path, {**PINHOLE})
    (folder / "transforms.json").rename(folder / "transforms_train.json")
    for name in others:
        shutil.copy(folder / "transforms_train.json", folder / f"transforms_{name}.json")
    notes = [note for note in open_scene(folder).notes if "are read, not those of" in note]
    assert notes == (
        [f"Only the frames of transforms_train.json are read, not those of {said}; give a file's own path to read it."] if said else []
    )  # fmt: skip
    assert all(
        "not those of" not in note for other in others for note in open_scene(folder / f"transforms_{other}.json").notes
    )


@pytest.mark.parametrize(
    ("place", "value"), [((0, 2), math.nan), ((1, 3), math.inf), ((slice(0, 4), slice(0, 4)), math.nan)]
)
def test_frames_without_a_finite_pose_are_left_out_and_counted(tmp_path: Path, place: tuple, value: float):
    folder = write(tmp_path, {**PINHOLE})
    content = json.loads((folder / "transforms.json").read_text())
    matrix(1, lambda pose: pose.__setitem__(place, value))(content)
    (folder / "transforms.json").write_text(json.dumps(content))
    scene = open_scene(folder)
    assert [frame.name for frame in scene.frames] == ["images/000.png", "images/002.png"]
    assert "1 of 3 frames have no finite pose and are left out, the first is images/001.png." in scene.notes
    np.testing.assert_allclose(scene.frames[1].world_from_camera, opengl(EYES[2]) @ np.diag([1, -1, -1, 1]), atol=1e-9)
    for frame in (0, 2):
        matrix(frame, lambda pose: pose.__setitem__(place, value))(content)
    (folder / "transforms.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match=r"frames\[0\].transform_matrix: .* not finite"):
        open_scene(folder)


def test_maps_by_a_key_that_is_not_read_are_noted_with_the_key_that_is(tmp_path):
    frames: list[dict[str, Any]] = [{"mask_filename": f"masks/{n}.png", "depth_unit": "metres"} for n in range(3)]
    frames[2] |= {"semantics_path": "s/2.png", "depth_filename": "d.npy", "mask_path": None, "colour_path": "a.png"}
    assert open_scene(write(tmp_path, {**PINHOLE, "mask_file": "all.png"}, frames)).notes == (
        "3 of 3 frames list mask_filename, which is not read (the key is mask_path), the first is images/000.png.",
        "1 of 3 frames list semantics_path, which is not read (the key is label_file_path), the first is images/002.png.",
        "1 of 3 frames list depth_filename, which is not read (the key is depth_file_path), the first is images/002.png.",
    )


@pytest.mark.parametrize(
    ("dtype", "count", "shared", "metres"),
    [
        (np.float32, 1.5, {}, 1.5),
        (np.float32, 1.5, {"depth_unit_scale_factor": 0.5}, 0.75),
        (np.uint16, 1500, {}, 1.5),
        (np.uint16, 1500, {"depth_unit_scale_factor": 0.01}, 15),
    ],
)
@pytest.mark.parametrize("ending", ["tif", "TIFF"])
def test_depth_in_tiff_is_in_the_unit_of_the_poses_or_in_counts(tmp_path, dtype, count, shared, metres, ending):
    depths = np.full(SIZE, count, dtype)
    depths[0, 0] = np.nan if dtype is np.float32 else 0
    Image.fromarray(depths).save(tmp_path / f"0.{ending}", "TIFF")
    scene = open_scene(write(tmp_path, {**PINHOLE, **shared}, [{"depth_file_path": f"0.{ending}"}] * 3))
    assert not any("unsupported" in note for note in scene.notes)
    found = scene.read([1], "native").depths[0]
    assert found[0, 0] == 0
    assert found[0, 1:].unique().tolist() == [pytest.approx(metres)]

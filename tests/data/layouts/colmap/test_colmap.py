"""COLMAP models, packed here by the format's description and not by pycolmap."""

from __future__ import annotations

import os
import re
import struct
import sys
import unicodedata
from pathlib import Path

import numpy as np
import pytest
import torch
from landmarks import POINTS, drawn, found, looking
from PIL import Image

from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.geometry.cameras import project
from semgs.geometry.rotations import quaternion_from_matrix

SIZE = (130, 180)
EYES = [(0.5, -0.3, -3.2), (-0.4, 0.2, -2.9), (0.1, 0.4, -3.4)]
NAMES = ["c.png", "a.png", "b.png"]  # their order in the model is not that of their names
MODELS = {
    "SIMPLE_PINHOLE": (0, (150.0, 93.1, 61.7)),
    "PINHOLE": (1, (150.0, 144.0, 93.1, 61.7)),
    "SIMPLE_RADIAL": (2, (150.0, 93.1, 61.7, -0.08)),
    "RADIAL": (3, (150.0, 93.1, 61.7, -0.1, 0.05)),
    "OPENCV": (4, (150.0, 144.0, 93.1, 61.7, 0.1, -0.05, 0.003, -0.004)),
    "OPENCV_FISHEYE": (5, (150.0, 144.0, 93.1, 61.7, -0.1, 0.05, 0.01, 0.02)),
    "FULL_OPENCV": (6, (150.0, 144.0, 93.1, 61.7, 0.1, -0.05, 0.003, -0.004, 0.02, 0.03, -0.01, 0.005)),
    "FOV": (7, (150.0, 144.0, 93.1, 61.7, 0.7)),
    "SIMPLE_RADIAL_FISHEYE": (8, (150.0, 93.1, 61.7, -0.08)),
    "RADIAL_FISHEYE": (9, (150.0, 93.1, 61.7, -0.06, 0.03)),
    "THIN_PRISM_FISHEYE": (10, (150.0, 144.0, 93.1, 61.7, 0.02, -0.01, 0.002, -0.003, 0.004, 0.001, 0.02, -0.01)),
    "RAD_TAN_THIN_PRISM_FISHEYE": (
        11, (150.0, 144.0, 93.1, 61.7, 0.02, -0.01, 0.004, 0.003, -0.002, 0.001, 0.002, -0.001, 0.03, 0.01, -0.02, 0.015),
    ),
    "SIMPLE_DIVISION": (12, (150.0, 93.1, 61.7, -0.1)),
    "DIVISION": (13, (150.0, 144.0, 93.1, 61.7, -0.1)),
    "SIMPLE_FISHEYE": (14, (150.0, 93.1, 61.7)),
    "FISHEYE": (15, (150.0, 144.0, 93.1, 61.7)),
    "EUCM": (16, (150.0, 144.0, 93.1, 61.7, 0.6, 1.1)),
}  # fmt: skip


def pose(eye: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Camera from world: rotation and translation."""
    world = looking(eye, (0, 0, 0))
    return world[:3, :3].T, -world[:3, :3].T @ world[:3, 3]


def pixels(eye: tuple[float, float, float], model: str) -> np.ndarray:
    """Where the landmarks are seen: by the formulas of COLMAP's camera models, those with more than OPENCV by pycolmap."""
    rotation, translation = pose(eye)
    inside = POINTS @ rotation.T + translation
    if MODELS[model][0] > 4:
        pycolmap = pytest.importorskip("pycolmap")
        return pycolmap.Camera(model=model, width=SIZE[1], height=SIZE[0], params=MODELS[model][1]).img_from_cam(inside)
    x, y = inside[:, 0] / inside[:, 2], inside[:, 1] / inside[:, 2]
    values = MODELS[model][1]
    k1, k2, p1, p2 = 0.0, 0.0, 0.0, 0.0
    if model in ("PINHOLE", "OPENCV"):
        fx, fy, cx, cy, *rest = values
        k1, k2, p1, p2 = rest or (0.0,) * 4
    else:
        fx, cx, cy, *rest = values
        fy = fx
        k1, k2 = (*rest, 0.0, 0.0)[:2]
    r2 = x * x + y * y
    radial = k1 * r2 + k2 * r2 * r2
    u = x + x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y + y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)
    return np.stack((fx * u + cx, fy * v + cy), axis=1)


def quaternion(rotation: np.ndarray) -> list[float]:
    return quaternion_from_matrix(torch.from_numpy(np.ascontiguousarray(rotation))).tolist()


def write_pictures(folder: Path, model: str) -> None:
    folder.mkdir(parents=True)
    for eye, name in zip(EYES, NAMES, strict=True):
        Image.fromarray(drawn(SIZE, pixels(eye, model))).save(folder / name)


def write_text(folder: Path, model: str) -> None:
    """cameras.txt, images.txt, points3D.txt."""
    folder.mkdir(parents=True)
    values = " ".join(map(repr, MODELS[model][1]))
    (folder / "cameras.txt").write_text(f"# cameras\n7 {model} {SIZE[1]} {SIZE[0]} {values}\n")
    lines = ["# images"]
    for index, (eye, name) in enumerate(zip(EYES, NAMES, strict=True)):
        rotation, translation = pose(eye)
        lines.append(" ".join(map(repr, [index + 1, *quaternion(rotation), *translation.tolist(), 7])) + f" {name}")
        lines.append(" ".join(f"{u!r} {v!r} {n + 1}" for n, (u, v) in enumerate(pixels(eye, model).tolist())))
    (folder / "images.txt").write_text("\n".join(lines) + "\n")
    lines = ["# points"]
    for n, point in enumerate(POINTS.tolist()):
        lines.append(" ".join(map(repr, [n + 1, *point, 9, 8, 7, 0.5])) + "".join(f" {i + 1} {n}" for i in range(3)))
    (folder / "points3D.txt").write_text("\n".join(lines) + "\n")


def write_binary(folder: Path, model: str) -> None:
    """cameras.bin, images.bin, points3D.bin."""
    folder.mkdir(parents=True)
    number, values = MODELS[model]
    camera = struct.pack("<QIiQQ", 1, 7, number, SIZE[1], SIZE[0]) + struct.pack(f"<{len(values)}d", *values)
    (folder / "cameras.bin").write_bytes(camera)
    images = struct.pack("<Q", 3)
    for index, (eye, name) in enumerate(zip(EYES, NAMES, strict=True)):
        rotation, translation = pose(eye)
        images += struct.pack("<I7dI", index + 1, *quaternion(rotation), *translation, 7) + name.encode() + b"\0"
        images += struct.pack("<Q", len(POINTS))
        images += b"".join(struct.pack("<ddq", u, v, n + 1) for n, (u, v) in enumerate(pixels(eye, model)))
    (folder / "images.bin").write_bytes(images)
    points = struct.pack("<Q", len(POINTS))
    for n, point in enumerate(POINTS):
        points += struct.pack("<Q3d3BdQ", n + 1, *point, 9, 8, 7, 0.5, 3)
        points += b"".join(struct.pack("<II", i + 1, n) for i in range(3))
    (folder / "points3D.bin").write_bytes(points)


WRITERS = {"text": write_text, "binary": write_binary}


def test_the_note_on_other_models_says_how_many_images_each_has_and_which_has_most(tmp_path):
    write_pictures(tmp_path / "images", "PINHOLE")
    for number in range(3):
        write_text(tmp_path / f"sparse/{number}", "PINHOLE")
    first = tmp_path / "sparse/0/images.txt"
    first.write_text("".join(first.read_text().splitlines(keepends=True)[:5]))  # a comment, and two images of two lines
    (tmp_path / "sparse/2/images.txt").write_text("nonsense\n")
    scene = open_scene(tmp_path)
    expected = f"COLMAP made several models; only 0 (2 images) is read, not 1 (3), 2 (0). 1 has more: name {tmp_path / 'sparse/1'} to read it."
    assert expected in scene.notes
    assert len(open_scene(tmp_path / "sparse/1")) == 3


def test_masks_as_colmap_takes_them_hide_pixels(tmp_path):
    """a.png has a mask whose left 45 of 180 columns are black; masks of other names are not COLMAP's."""
    write_pictures(tmp_path / "images", "PINHOLE")
    write_text(tmp_path / "sparse/0", "PINHOLE")
    (tmp_path / "masks").mkdir()
    mask = np.full(SIZE, 255, np.uint8)
    mask[:, :45] = 0
    Image.fromarray(mask).save(tmp_path / "masks/a.png.png")
    Image.fromarray(np.zeros_like(mask)).save(tmp_path / "masks/b.png")
    views = open_scene(tmp_path).read([0, 1, 2], "native")  # a, b, c
    assert views.hidden is not None
    assert [float(one.float().mean()) for one in views.hidden] == [0.25, 0.0, 0.0]
    assert bool(views.hidden[0, :, :45].all())


def test_images_with_transparent_areas_are_noted_with_the_place_of_masks(tmp_path):
    write_pictures(tmp_path / "images", "PINHOLE")
    write_text(tmp_path / "sparse/0", "PINHOLE")
    Image.open(tmp_path / "images/b.png").convert("RGBA").save(tmp_path / "images/b.png")
    assert (
        "1 image has an alpha channel; transparent areas become white. To hide them, write a mask of each image (black = hidden): "
        "masks/a.png.png beside images/ for images/a.png." in open_scene(tmp_path).notes
    )


@pytest.mark.parametrize("form", WRITERS)
@pytest.mark.parametrize("model", MODELS)
def test_a_point_is_seen_on_its_feature(tmp_path, form, model):
    write_pictures(tmp_path / "images", model)
    WRITERS[form](tmp_path / "sparse" / "0", model)
    scene = open_scene(tmp_path)
    assert scene.layout == "COLMAP"
    assert scene.unit == "unknown"
    assert [frame.name for frame in scene.frames] == ["a.png", "b.png", "c.png"]
    np.testing.assert_allclose(scene.cameras[2].world_from_camera.numpy(), looking(EYES[0], (0, 0, 0)), atol=1e-9)
    views = scene.read([0, 1, 2])
    for index, image in enumerate(views.images):
        expected = project(torch.from_numpy(POINTS), views.cameras[index])[:, :2].numpy()
        inside = ((expected > 8) & (expected < np.array(SIZE[::-1]) - 8)).all(axis=1)
        assert inside.sum() >= 8
        assert np.abs(found(image, expected[inside], (8, 8)) - expected[inside]).max() < 0.1


@pytest.mark.parametrize("ending", [".bin", ".txt"])
def test_a_rig_has_the_poses_that_it_has_without_its_files(tmp_path, ending):
    pycolmap = pytest.importorskip("pycolmap")
    pycolmap.set_random_seed(3)
    options = pycolmap.SyntheticDatasetOptions(
        num_rigs=1, num_cameras_per_rig=3, num_frames_per_rig=2, num_points3D=20, track_length=3, camera_width=64,
        camera_height=48, camera_params=[60.0, 32.0, 24.0, 0.0],
    )  # fmt: skip
    theirs = pycolmap.synthesize_dataset(options)
    assert {len(frame.data_ids) for frame in theirs.frames.values()} == {3}
    model = tmp_path / "sparse" / "0"
    model.mkdir(parents=True)
    (theirs.write_binary if ending == ".bin" else theirs.write_text)(str(model))
    for image in theirs.images.values():
        path = tmp_path / "images" / image.name
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.new("RGB", (64, 48)).save(path)
    with_rig = open_scene(tmp_path)
    (model / f"rigs{ending}").unlink()
    (model / f"frames{ending}").unlink()
    without = open_scene(tmp_path)
    poses = {image.name: image.cam_from_world().inverse().matrix() for image in theirs.images.values()}
    assert len(with_rig) == len(without) == 6
    for one, same in zip(with_rig.frames, without.frames, strict=True):
        np.testing.assert_array_equal(one.world_from_camera, same.world_from_camera)
        np.testing.assert_allclose(one.world_from_camera[:3], poses[one.name], atol=1e-9)


@pytest.mark.parametrize("focal", [63, 50])  # 90 / 63 is 82 degrees to each side, 90 / 50 more than a right angle
def test_a_lens_that_no_pinhole_shows_is_refused_with_what_to_do(tmp_path, focal):
    write_pictures(tmp_path / "images", "FISHEYE")
    write_text(tmp_path / "sparse" / "0", "FISHEYE")
    cameras = tmp_path / "sparse" / "0" / "cameras.txt"
    cameras.write_text(f"7 FISHEYE 180 180 {focal} {focal} 90 90\n")
    with pytest.raises(InputError, match="cannot be undone over the whole picture; undistort with `colmap image_und"):
        open_scene(tmp_path)


@pytest.mark.parametrize("place", ["sparse/0", "sparse", "colmap/sparse/0", ""])
def test_the_model_is_found_where_programs_put_it(tmp_path, place):
    write_pictures(tmp_path / "scene" / "images", "PINHOLE")
    write_text(tmp_path / "model", "PINHOLE")
    (tmp_path / "scene" / place).mkdir(parents=True, exist_ok=True)
    for file in (tmp_path / "model").iterdir():
        file.rename(tmp_path / "scene" / place / file.name)
    for path in (tmp_path / "scene", tmp_path / "scene" / place):
        scene = open_scene(path)
        assert (len(scene), scene.name) == (3, "scene")


def test_near_and_far_come_from_the_points_that_the_frames_see(tmp_path):
    write_pictures(tmp_path / "images", "PINHOLE")
    write_binary(tmp_path / "sparse" / "0", "PINHOLE")
    scene = open_scene(tmp_path)
    np.testing.assert_allclose(np.sort(scene.points, axis=0), np.sort(POINTS, axis=0))
    assert all(len(frame.points) == len(POINTS) for frame in scene.frames)
    bounds = scene.depth_range([0, 2])
    depths = np.concatenate([(POINTS - eye) @ looking(eye, (0, 0, 0))[:3, 2] for eye in (EYES[1], EYES[0])])
    assert 0 < bounds.near < depths.min()
    assert depths.max() < bounds.far
    assert abs(bounds.middle / np.median(depths) - 1) < 0.05
    assert "sparse points" in bounds.reason


def test_absent_pictures_are_counted(tmp_path):
    write_pictures(tmp_path / "images", "PINHOLE")
    write_text(tmp_path / "sparse", "PINHOLE")
    (tmp_path / "images" / "b.png").unlink()
    scene = open_scene(tmp_path)
    assert scene.absent == ("b.png",)
    assert any("1 of 3 images of the model are missing" in note for note in scene.notes)


@pytest.mark.parametrize(("form", "place"), [("text", r"cameras\.txt: line 2"), ("binary", r"cameras\.bin: camera 7")])
def test_other_camera_models_are_refused_by_name(tmp_path, form, place):
    write_pictures(tmp_path / "images", "PINHOLE")
    WRITERS[form](tmp_path / "sparse", "OPENCV")
    for file in (tmp_path / "sparse").glob("cameras.*"):
        numbers = struct.pack("<Ii", 7, 4), struct.pack("<Ii", 7, 17)
        file.write_bytes(file.read_bytes().replace(*(numbers if form == "binary" else (b"OPENCV", b"EQUIRECTANGULAR"))))
    with pytest.raises(
        InputError, match=place + r": expected a camera model of SIMPLE_PINHOLE, .* found EQUIRECTANGULAR; a panorama"
    ):
        open_scene(tmp_path)


@pytest.mark.parametrize("name", ["cameras", "images"])
@pytest.mark.parametrize("part", [0.0, 0.1, 0.5, 0.99])
def test_binaries_cut_short_are_refused_by_name(tmp_path, name, part):
    write_pictures(tmp_path / "images", "PINHOLE")
    write_binary(tmp_path / "sparse" / "0", "PINHOLE")
    path = tmp_path / "sparse" / "0" / f"{name}.bin"
    path.write_bytes(path.read_bytes()[: int(part * path.stat().st_size)])
    with pytest.raises(InputError, match=rf"{name}\.bin: expected a complete list"):
        open_scene(tmp_path)


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("cameras.txt", "PINHOLE", "NOT_A_MODEL"),
        ("cameras.txt", "150.0", "nan"),
        ("cameras.txt", "150.0", "0.0"),
        ("cameras.txt", "7 ", "8 "),
        ("images.txt", " 7 c.png", " x c.png"),
    ],
)
def test_damaged_models_are_refused(tmp_path, name, old, new):
    write_pictures(tmp_path / "images", "PINHOLE")
    write_text(tmp_path / "sparse" / "0", "PINHOLE")
    path = tmp_path / "sparse" / "0" / name
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(InputError, match="sparse/0"):
        open_scene(tmp_path)


@pytest.mark.parametrize(
    ("model", "images"),
    [
        ("outputs/sfm", "dataset"),  # hloc
        ("distorted/sparse/0", "input"),  # 3D Gaussian splatting, before its images are undistorted
        ("sparse/0", "input"),
        ("outputs/sfm/models/0", "images"),
    ],
)
def test_images_are_found_where_programs_put_them(tmp_path, model, images):
    write_pictures(tmp_path / "room" / images, "PINHOLE")
    write_text(tmp_path / "room" / model, "PINHOLE")
    scene = open_scene(tmp_path / "room" / model)
    assert len(scene) == 3
    assert scene.name == "room"


def test_the_images_of_a_distorted_model_are_the_photos_and_not_the_undistorted_ones(tmp_path):
    write_pictures(tmp_path / "input", "RADIAL")
    write_pictures(tmp_path / "images", "PINHOLE")
    write_text(tmp_path / "distorted/sparse/0", "RADIAL")
    scene = open_scene(tmp_path)
    assert scene.frames[0].picture == tmp_path / "input/a.png"


def test_the_folder_of_the_images_may_be_named(tmp_path, capsys):
    write_pictures(tmp_path / "photos of May", "PINHOLE")
    write_text(tmp_path / "room/sparse/0", "PINHOLE")
    (tmp_path / "room/images").mkdir()
    with pytest.raises(InputError) as caught:
        open_scene(tmp_path / "room")
    said = str(caught.value)
    assert f"the first missing one is a.png, looked for in {tmp_path}/room/images" in said
    assert said.endswith("name the folder of the images with --images")
    assert len(open_scene(tmp_path / "room", images=tmp_path / "photos of May")) == 3
    with pytest.raises(InputError, match="nothing there"):
        open_scene(tmp_path / "room", images=tmp_path / "none")


@pytest.mark.parametrize("form", WRITERS)
def test_names_may_have_backslashes(tmp_path, form):
    write_pictures(tmp_path / "images/left", "PINHOLE")
    WRITERS[form](tmp_path / "sparse", "PINHOLE")
    file = next((tmp_path / "sparse").glob("images.*"))
    for name in (b"a.png", b"b.png", b"c.png"):
        file.write_bytes(file.read_bytes().replace(name, b"left\\" + name))
    scene = open_scene(tmp_path)
    assert [frame.name for frame in scene.frames] == ["left/a.png", "left/b.png", "left/c.png"]
    assert scene.index("left\\b.png") == 1


@pytest.mark.parametrize("form", WRITERS)
def test_damaged_points_are_left_out_and_the_scene_opens(tmp_path, form):
    write_pictures(tmp_path / "images", "PINHOLE")
    WRITERS[form](tmp_path / "sparse", "PINHOLE")
    path = next((tmp_path / "sparse").glob("points3D.*"))
    path.write_bytes(path.read_bytes()[:-1] + (b" x" if form == "text" else b""))
    scene = open_scene(tmp_path)
    assert len(scene) == 3
    assert scene.points is None
    assert re.search(rf"sparse points are left out: .*points3D\{path.suffix}: .*expected", scene.notes[-1])


@pytest.mark.parametrize("form", WRITERS)
@pytest.mark.parametrize("on_disk", [b"caf\xe9.png", "caf\u00e9.png".encode()], ids=["Latin-1", "UTF-8"])
def test_a_latin_1_name_is_found_by_its_letters_or_its_bytes(tmp_path, form, on_disk):
    write_pictures(tmp_path / "images", "PINHOLE")
    WRITERS[form](tmp_path / "sparse", "PINHOLE")
    (tmp_path / "images" / "a.png").rename(tmp_path / "images" / os.fsdecode(on_disk))
    file = next((tmp_path / "sparse").glob("images.*"))
    file.write_bytes(file.read_bytes().replace(b"a.png", b"caf\xe9.png"))
    scene = open_scene(tmp_path)
    assert [frame.name for frame in scene.frames] == ["b.png", "c.png", "caf\u00e9.png"]
    assert scene.read([1, 2], "native").size == SIZE


def test_a_model_is_read_without_pycolmap_and_without_points(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pycolmap", None)
    write_pictures(tmp_path / "images", "PINHOLE")
    write_binary(tmp_path / "sparse", "PINHOLE")
    (tmp_path / "sparse" / "points3D.bin").unlink()
    scene = open_scene(tmp_path)
    assert len(scene) == 3
    assert scene.points is None


def test_pictures_of_another_size_than_the_camera_are_refused(tmp_path):
    write_pictures(tmp_path / "images", "PINHOLE")
    write_text(tmp_path / "sparse" / "0", "PINHOLE")
    Image.new("RGB", (90, 65)).save(tmp_path / "images" / "a.png")
    with pytest.raises(InputError, match=r"a\.png: expected 180x130"):
        open_scene(tmp_path)


@pytest.mark.parametrize("model", ["PINHOLE", "OPENCV", "THIN_PRISM_FISHEYE", "EUCM"])
def test_reduced_images_have_a_reduced_lens_of_any_kind(tmp_path, model):
    """Images of 180x130 halved are 90x65: the directions of positions, and with them the undistorted view, stay."""
    write_pictures(tmp_path / "images", model)
    write_text(tmp_path / "sparse" / "0", model)
    whole = open_scene(tmp_path).frames[0].lens
    (tmp_path / "images").rename(tmp_path / "images_2")
    for name in NAMES:
        Image.new("RGB", (90, 65)).save(tmp_path / "images_2" / name)
    scene = open_scene(tmp_path)
    lens = scene.frames[0].lens
    assert (scene.name, lens.size) == (tmp_path.name, (65, 90))
    assert lens.focal == tuple(side / 2 for side in whole.focal)
    places = np.array([[10.0, 20.0], [90.0, 65.0], [150.0, 100.0]])
    np.testing.assert_allclose(lens.directions(places / 2), whole.directions(places), atol=1e-9)
    Image.new("RGB", (180, 130)).save(tmp_path / "images_2" / "a.png")  # full size in the folder of reduced ones
    assert open_scene(tmp_path).frames[0].lens == whole
    Image.new("RGB", (80, 65)).save(tmp_path / "images_2" / "a.png")
    with pytest.raises(InputError, match="expected 180x130"):
        open_scene(tmp_path)


def test_full_images_go_before_reduced_ones(tmp_path):
    for folder in ("images", "images_2"):
        write_pictures(tmp_path / folder, "PINHOLE")
    write_text(tmp_path / "sparse" / "0", "PINHOLE")
    assert open_scene(tmp_path).frames[0].picture.parent.name == "images"


def test_images_with_another_ending_or_other_capitals_are_found_and_counted(tmp_path):
    write_pictures(tmp_path / "images", "PINHOLE")
    write_text(tmp_path / "sparse" / "0", "PINHOLE")
    for old, new in (("c.png", "C.PNG"), ("b.png", "b.JPG")):
        (tmp_path / "images" / old).rename(tmp_path / "images" / new)
    scene = open_scene(tmp_path)
    assert len(scene) == 3
    assert scene.notes[-1].startswith("2 of 3 images have another ending, other capitals or another form of letters")


@pytest.mark.parametrize(("said", "there"), [("NFC", "NFD"), ("NFD", "NFC")])
@pytest.mark.parametrize("ending", [".png", ".JPG"])
def test_names_in_another_form_of_unicode_are_found_and_counted(tmp_path, said, there, ending):
    write_pictures(tmp_path / "images", "PINHOLE")
    write_text(tmp_path / "sparse" / "0", "PINHOLE")
    name = "Büro é.png"
    file = tmp_path / "sparse" / "0" / "images.txt"
    text = file.read_text()
    assert text.count(f" {NAMES[0]}\n") == 1
    file.write_text(text.replace(f" {NAMES[0]}\n", f" {unicodedata.normalize(said, name)}\n"))
    held = unicodedata.normalize(there, name)
    (tmp_path / "images" / NAMES[0]).rename((tmp_path / "images" / held).with_suffix(ending))
    scene = open_scene(tmp_path)
    assert len(scene) == 3
    assert held.replace(".png", ending) in {frame.picture.name for frame in scene.frames}
    assert scene.notes[-1].startswith("1 of 3 images have another ending, other capitals or another form of letters")


def test_two_images_that_may_be_meant_are_none(tmp_path):
    write_pictures(tmp_path / "images", "PINHOLE")
    write_text(tmp_path / "sparse" / "0", "PINHOLE")
    file = tmp_path / "images" / NAMES[0]
    for ending in (".jpg", ".jpeg"):
        Image.new("RGB", (180, 130)).save(file.with_suffix(ending))
    file.unlink()
    scene = open_scene(tmp_path)
    assert scene.absent == (NAMES[0],)
    assert len(scene) == 2

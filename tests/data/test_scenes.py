"""Scenes: recognised, counted, read."""

from __future__ import annotations

import json
import pickle
import shutil
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import torch
from landmarks import looking
from PIL import Image

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.demo_scene import demo_scene
from semgs.data.resampling import reframed
from semgs.data.scene_details import USED_BY, SceneDetails
from semgs.data.scenes import open_scene, open_scenes
from semgs.files.errors import InputError
from semgs.files.images.pictures import write_png

SIZES = [(90, 130), (90, 130), (60, 100), (90, 130)]
NAMES = ["left/0001.png", "left/0002.png", "right/0002.png", "right/0003.png"]


@pytest.fixture
def folder(tmp_path) -> Path:
    """A metric scene of four frames in two folders, one of another size."""
    frames = []
    for index, (name, size) in enumerate(zip(NAMES, SIZES, strict=True)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        pixels = np.random.default_rng(index).integers(0, 256, (*size, 3), dtype=np.uint8)
        Image.fromarray(pixels).save(tmp_path / name)
        pose = looking((0.2 * index, 0.1, -3), (0.1, 0, 0)) * (1, -1, -1, 1)
        frames.append({"file_path": name, "transform_matrix": pose.tolist(), "w": size[1], "h": size[0]})
    (tmp_path / "transforms.json").write_text(
        json.dumps({"fl_x": 110.0, "fl_y": 104.0, "metric": True, "frames": frames})
    )
    return tmp_path


def test_frames_are_read_in_the_order_asked_for(folder):
    scene = open_scene(folder)
    views = scene.read([3, 0], "native")
    assert views.images.shape == (2, 3, 90, 130)
    for image, index in zip(views.images, (3, 0), strict=True):
        stored = torch.from_numpy(np.array(Image.open(folder / NAMES[index]))).permute(2, 0, 1)
        torch.testing.assert_close(image, stored.float() / 255)
    torch.testing.assert_close(views.cameras[0].world_from_camera, scene.cameras[3].world_from_camera)
    assert views.depth_range.tolist() == [[0.5, 10.0]] * 2
    closer = replace(scene, stated_range=DepthRange(0.25, 5.0, "metric", "you say so"))
    assert closer.read([3, 0]).depth_range.tolist() == [[0.25, 5.0]] * 2
    assert views.labels is None
    assert views.depths is None


def test_iphone_photos_in_heic_are_read_like_others(folder):
    pillow_heif = pytest.importorskip("pillow_heif")
    blurred = Image.open(folder / NAMES[0]).resize((13, 9)).resize((130, 90), Image.Resampling.BILINEAR)
    for name in NAMES[:2]:
        pillow_heif.from_pillow(blurred).save(folder / f"{name[:-4]}.heic", quality=95, chroma="444")
    text = (folder / "transforms.json").read_text()
    (folder / "transforms.json").write_text(
        text.replace("0001.png", "0001.heic").replace("left/0002.png", "left/0002.heic")
    )
    images = open_scene(folder).read([0, 1], "native").images
    expected = torch.from_numpy(np.array(blurred)).permute(2, 0, 1) / 255
    assert (images - expected).abs().mean() < 0.01


def test_reading_at_a_size_is_reading_and_cropping_to_its_aspect_and_resizing(folder):
    scene = open_scene(folder)
    whole, small = reframed(scene.read([0, 1], "native"), (48, 80)), scene.read([0, 1], size=(48, 80))
    assert torch.equal(whole.images, small.images)
    assert torch.equal(whole.cameras.intrinsics, small.cameras.intrinsics)


def test_by_default_pictures_are_read_at_the_size_that_the_command_takes(folder):
    """90x130 has sides of at most 80 and 128 in multiples of 16: 11,700 pixels need no other reduction."""
    scene = open_scene(folder)
    views = scene.read([0, 2])
    assert views.size == (80, 128)
    for found, expected in zip(views.cameras.intrinsics, scene.read([0, 2], (80, 128)).cameras.intrinsics, strict=True):
        assert torch.equal(found, expected)


def test_a_large_photo_is_read_at_no_more_than_76_800_pixels(tmp_path):
    """968x1296 reduced to that: 0.2474 of each side is 239.5 x 320.7, and 240 x 320 in multiples of 16."""
    frames = []
    for index in range(2):
        Image.new("RGB", (1296, 968), (40 * index, 90, 160)).save(tmp_path / f"{index}.png")
        pose = looking((0.2 * index, 0.1, -3), (0.1, 0, 0)) * (1, -1, -1, 1)
        frames.append({"file_path": f"{index}.png", "transform_matrix": pose.tolist(), "w": 1296, "h": 968})
    (tmp_path / "transforms.json").write_text(
        json.dumps({"fl_x": 1158.3, "fl_y": 1153.5, "metric": True, "frames": frames})
    )
    scene = open_scene(tmp_path)
    views = scene.read([0, 1])
    assert views.size == (240, 320)
    assert views.cameras.intrinsics[0, 0, 0].item() == pytest.approx(1158.3 * 320 / 1296)
    assert scene.read([0], "native").size == (968, 1296)


def test_frames_of_different_sizes_need_a_size(folder):
    scene = open_scene(folder)
    with pytest.raises(ValueError, match=r"left/0001\.png is \(90, 130\) .* right/0002\.png \(60, 100\); give a size"):
        scene.read([0, 2], "native")
    assert scene.read([0, 2], size=(48, 64)).size == (48, 64)


@pytest.mark.parametrize(
    ("name", "position"),
    [("left/0001.png", 0), ("./right/0003.png", 3), ("0003.png", 3), ("0001", 0), ("left\\0002.png", 1)],
)
def test_names_work_as_positions_do(folder, name, position):
    assert open_scene(folder).index(name) == position


@pytest.mark.parametrize(
    ("frames", "message"),
    [
        ([4], "no frame 4; expected a position from 0 to 3"),
        ([-1], "no frame -1"),
        (["0002.png"], r"may be left/0002\.png or right/0002\.png"),
        (["other.png"], r"no usable frame 'other\.png'"),
        ([], "the list of frames is empty"),
    ],
)
def test_frames_that_are_not_there_are_refused(folder, frames, message):
    with pytest.raises(ValueError, match=message):
        open_scene(folder).read(frames, "native")


@pytest.mark.parametrize(
    ("files", "remedy"),
    [
        ([], "the folder is empty"),
        (
            ["photo.jpg", "clip.mov"],
            "images alone have no poses; semgs poses FOLDER --out OUT estimates them, and OUT is a scene",
        ),
        (
            ["photos/IMG_1.HEIC"],
            "images alone have no poses; semgs poses FOLDER --out OUT estimates them, and OUT is a scene",
        ),
        (["clip.MP4"], "a video has no poses; semgs poses CLIP --out OUT estimates them, and OUT is a scene"),
        (
            ["scene.safetensors"],
            "this is a result of semgs reconstruct; semgs view, render, query and export open it",
        ),
        (["notes.txt"], "docs/data.md lists the known ones"),
        (
            ["depth.npy", "poses.npz"],
            "depth.npy, poses.npz are arrays, which are not read; load them and give them to semgs.Views.from_arrays (docs/examples/arrays_in.md)",
        ),
        (
            ["disps.npy", "images.npy", "intrinsics.npy", "poses.npy", "tstamps.npy"],
            "disps.npy, images.npy, intrinsics.npy, poses.npy, tstamps.npy are arrays of DROID-SLAM, which are not read; load them and give them to "
            "semgs.Views.from_arrays (docs/examples/arrays_in.md): its poses are world to camera (t, then x, y, z, w), its intrinsics for images of 1/8 of the size, "
            "and its images BGR",
        ),
    ],
)
def test_an_unknown_layout_gets_the_likeliest_remedy_on_one_line(tmp_path, files, remedy):
    for name in files:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    with pytest.raises(InputError) as caught:
        open_scene(tmp_path)
    assert str(caught.value) == f"{tmp_path}: expected a scene, found no known layout; {remedy}"
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)


@pytest.mark.parametrize(("kind", "named"), [("PinholeCameraTrajectory", True), ("PinholeCameraIntrinsic", False)])
def test_cameras_of_open3d_are_named_with_the_form_that_is_read(tmp_path, kind, named):
    for name in ("color/0.jpg", "depth/0.png"):
        (tmp_path / name).parent.mkdir()
        (tmp_path / name).touch()
    (tmp_path / "camera_trajectory.json").write_text(json.dumps({"class_name": kind, "parameters": []}))
    with pytest.raises(InputError) as caught:
        open_scene(tmp_path)
    said = "camera_trajectory.json has cameras of Open3D, which are not read: write them as trajectory.log "
    assert (said in str(caught.value)) == named


def test_a_file_without_a_known_layout_is_refused(tmp_path):
    (tmp_path / "notes.txt").touch()
    with pytest.raises(InputError, match="name the scene's folder"):
        open_scene(tmp_path / "notes.txt")
    (tmp_path / "clip.mp4").touch()
    with pytest.raises(InputError, match="a video has no poses"):
        open_scenes(tmp_path / "clip.mp4")


@pytest.mark.parametrize("inside", ["inside", "outputs/room/sfm/model"])
def test_the_nearest_scene_below_is_pointed_to(folder, inside):
    (folder / inside).mkdir(parents=True)
    for file in [*folder.glob("*t"), folder / "transforms.json"]:
        file.rename(folder / inside / file.name)
    with pytest.raises(InputError, match=f"there is one in {folder / inside}"):
        open_scene(folder)


def test_a_missing_folder_is_told(tmp_path):
    with pytest.raises(InputError, match="nothing there"):
        open_scene(tmp_path / "absent")


def test_scenes_are_those_right_inside_a_folder_by_name(folder, tmp_path_factory):
    data = tmp_path_factory.mktemp("data")
    for name in ("b", "a", ".hidden", "c/deeper"):
        shutil.copytree(folder, data / name)
    (data / "empty").mkdir()
    assert [scene.name for scene in open_scenes(data)] == ["a", "b"]
    assert [scene.name for scene in open_scenes(data / "b")] == ["b"]
    assert [scene.name for scene in open_scenes(data / "b" / "transforms.json")] == ["b"]


def test_a_folder_without_any_scene_is_refused_and_a_broken_scene_is_not_passed_over(folder, tmp_path_factory):
    data = tmp_path_factory.mktemp("data")
    (data / "empty").mkdir()
    with pytest.raises(InputError, match="expected a scene or a folder of scenes, found no known layout"):
        open_scenes(data)
    shutil.copytree(folder, data / "a")
    (data / "a" / "transforms.json").write_text("{")
    with pytest.raises(InputError, match=r"a/transforms\.json"):
        open_scenes(data)


def test_the_fox_has_twelve_of_its_sixty_seven_pictures(shared):
    fox = open_scene(shared / "data" / "fox")
    assert (len(fox), len(fox.absent), fox.unit, fox.name) == (12, 55, "unknown", "fox")
    assert fox.notes == ("55 of 67 listed images are missing, the first is images/0005.jpg.",)
    views = fox.read(["0004.jpg", 4], size=(320, 180))
    assert views.images.shape == (2, 3, 320, 180)
    assert views.depths is None


def test_the_office_is_metric_and_has_sparse_depths(shared):
    office = open_scene(shared / "data" / "hololens_office")
    assert (len(office), office.unit, office.classes) == (20, "metric", None)
    views = office.read([3, 4], "native")
    assert views.size == (360, 540)
    assert views.labels is None
    known = views.depths[views.depths > 0]
    assert 0.3 < known.min() < known.max() < 20


def test_the_small_house_has_exact_depths_and_labels(shared):
    living = open_scene(shared / "data" / "small_house" / "living")
    views = living.read([3, 4], size=(240, 320))
    assert living.classes.name == "scannet20"
    assert views.labels.shape == views.depths.shape == (2, 240, 320)
    named = {living.classes.names[label] for label in views.labels.unique().tolist() if label != 255}
    assert {"wall", "floor", "sofa"} <= named


def test_reading_twice_gives_the_same_bits(shared):
    path = shared / "data" / "fox"
    first, second = (open_scene(path).read([3, 4], size=(320, 240)) for _ in range(2))
    assert torch.equal(first.images, second.images)
    assert torch.equal(first.depth_range, second.depth_range)


def test_what_uses_a_detail_is_named_where_it_is_refused(folder):
    assert set(USED_BY) == {one.name for one in fields(SceneDetails)} - {"unit"}
    with pytest.raises(
        InputError, match=r"images: expected a COLMAP model, found layout transforms\.json; leave it out"
    ):
        open_scene(folder, images=folder)


def test_a_mask_of_frames_is_not_taken_for_positions():
    scene = open_scene(demo_scene())
    for mask in ([False, True, True, False], np.array([False, True]), [np.bool_(True)]):
        with pytest.raises(
            TypeError, match=r"frames are true and false; expected positions or names, such as np.flatnonzero"
        ):
            scene.read(mask)


@pytest.mark.parametrize("frames", [[1, 1], [0, 2, 0], [2, "view_2"]])
def test_a_frame_that_is_there_twice_is_refused(frames: list[int | str]):
    scene = open_scene(demo_scene())
    frames = [scene.frames[2].name if isinstance(one, str) else one for one in frames]
    with pytest.raises(ValueError, match=r"frame \d \(.*\) is there twice; expected each frame once"):
        scene.read(frames)


@pytest.mark.parametrize("frames", [(index for index in (1, 2)), range(1, 3), np.array([1, 2])])
def test_frames_may_be_any_iterable(frames):
    """A generator can be gone through once only."""
    scene = open_scene(demo_scene())
    assert torch.equal(scene.read(frames).images, scene.read([1, 2]).images)


@pytest.mark.parametrize("broken", ["sixteen bits", "colours", "outside the table", "damaged"])
def test_labels_that_cannot_be_read_are_left_out_with_a_note_if_they_are_not_needed(tmp_path: Path, broken: str):
    folder = shutil.copytree(demo_scene(), tmp_path / "scene")
    for label in sorted((folder / "labels").glob("*.png"))[-1:]:
        kind = {
            "sixteen bits": np.full((240, 320), 1200, np.uint16),
            "outside the table": np.full((240, 320), 77, np.uint8),
        }
        write_png(label, kind.get(broken, np.random.default_rng(0).integers(0, 256, (240, 320, 3), dtype=np.uint8)))
        if broken == "damaged":
            label.write_bytes(label.read_bytes()[:200])
    scene = open_scene(folder, needs_labels=False)
    assert scene.classes is None
    assert scene.notes[-1].startswith(f"The labels are left out: {label}")
    assert scene.read([0, len(scene) - 1]).labels is None
    with pytest.raises(InputError, match=label.name):
        open_scene(folder).read([0, len(scene) - 1])


@pytest.mark.parametrize(
    ("files", "program"),
    [
        ({"camera_poses.txt": "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "intrinsic.txt": "100 100 40 30"}, "VGGT-Long"),
        ({"cams/00000000_cam.txt": "extrinsic\n1 0 0 0"}, "MVSNet"),
        ({"calib.txt": "P0: 700 0 600 0", "times.txt": "0.0"}, "KITTI"),
        ({"lowres_wide.traj": "1 0 0 0 0 0 0"}, "ARKitScenes"),
    ],
)
def test_cameras_of_other_programs_beside_images_are_named(tmp_path: Path, files: dict[str, str], program: str):
    shutil.copytree(demo_scene() / "images", tmp_path / "images")
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content)
    for place in (tmp_path, tmp_path / "images"):
        with pytest.raises(
            InputError, match=f"{next(iter(files))} has cameras of {program}, which are not read: write them as"
        ):
            open_scene(place)

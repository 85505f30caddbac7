"""Scenes from predicted cameras and depth, written here in the layout of each tool from a room whose depth is known."""

from __future__ import annotations

import pickle
import shutil
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import predicted_files as files
import pytest
from predicted_files import SMALL, Made, save

from semgs.data.scenes import open_predictions, open_scene, open_scenes
from semgs.files.errors import InputError

WIDE = (100, 140)
ALIKE = replace(SMALL, focal=(36.0, 36.0))
"""DUSt3R has one focal length for both axes."""

TOOLS: dict[str, tuple[Callable[[Made], dict], Made]] = {
    "mini_npz": (lambda made: {**files.depth_anything(made), "image": made.maps()[1]}, SMALL),
    "npz": (lambda made: files.depth_anything(made, mini=False), SMALL),
    "vggt": (files.vggt, SMALL),
    "map_anything_app": (files.map_anything_app, SMALL),
    "map_anything": (files.map_anything, SMALL),
    "dust3r": (files.dust3r, ALIKE),
}
WITH_PHOTOS: dict[str, tuple[Callable[[Made], dict], Made]] = {
    "depth_anything": (files.depth_anything, Made(WIDE, (364, 504), (3.6, 3.64))),
    "depth_anything_crop": (files.depth_anything, Made(WIDE, (350, 504), (3.6, 3.6), (0, -5))),
    "vggt": (files.vggt, Made(WIDE, (364, 518), (3.7, 3.64))),
    "vggt_upright": (files.vggt, Made((140, 100), (518, 518), (5.18, 5.2), (0, -105))),
    "map_anything": (files.map_anything, Made(WIDE, (392, 518), (548 / 140, 3.92), (-15, 0))),
    "dust3r": (files.dust3r, Made(WIDE, (352, 512), (512 / 140, 3.66), (0, -7), focal=(70.0, 70.0 * 512 / 140 / 3.66))),
}


def refused(path: Path) -> str:
    """The one line of the error."""
    with pytest.raises(InputError) as caught:
        open_scene(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", TOOLS)
def test_poses_intrinsics_depth_and_images_are_read_as_each_tool_writes_them(tmp_path: Path, name: str):
    write, made = TOOLS[name]
    save(tmp_path / "kitchen/predictions.npz", write(made))
    scene = open_scene(tmp_path / "kitchen")
    assert scene.name == "kitchen"
    views = scene.read(range(3), "native")
    depth, images = made.maps()
    np.testing.assert_allclose(views.cameras.world_from_camera, made.poses, atol=1e-6)
    np.testing.assert_allclose(views.cameras.intrinsics, made.intrinsics, atol=1e-5)
    np.testing.assert_array_equal(np.rint(255 * views.images.permute(0, 2, 3, 1).numpy()), images)
    depth[:, 0] = 0  # in the first row confidence is low, or the mask is False
    np.testing.assert_allclose(views.depths, depth, atol=1e-6)


@pytest.mark.parametrize("name", WITH_PHOTOS)
def test_photos_beside_the_file_are_the_frames_and_crop_and_resize_are_undone(tmp_path: Path, name: str):
    write, made = WITH_PHOTOS[name]
    save(tmp_path / "predictions.npz", write(made))
    made.write_photos(tmp_path / "images")
    scene = open_scene(tmp_path)
    assert [frame.name for frame in scene.frames] == ["images/000.png", "images/001.png", "images/002.png"]
    views = scene.read(range(3), "native")
    assert views.images.shape[-2:] == made.photo
    np.testing.assert_allclose(views.cameras.intrinsics, np.tile(made.camera, (3, 1, 1)), atol=1e-4)
    true = np.stack([files.view(made.camera, made.photo, pose)[0] for pose in made.poses])
    depths = views.depths.numpy()
    first_row = int(np.ceil((1 - made.shift[1]) / made.scale[1] - 0.5))  # row 0 of the processed image is unsure
    last_row = int((made.processed[0] - made.shift[1]) / made.scale[1] - 0.5)
    left = int(np.ceil(-made.shift[0] / made.scale[0] - 0.5))
    assert (depths[:, :first_row] == 0).all()
    assert (depths[:, last_row + 1 :] == 0).all()
    assert (depths[:, :, :left] == 0).all()
    seen = np.s_[:, first_row : last_row + 1, left : made.photo[1] - left]
    np.testing.assert_allclose(depths[seen], true[seen], rtol=0.02)


def test_photos_that_were_padded_are_told_by_the_white_beside_them(tmp_path: Path):
    """A square of 518 may be an upright photo that was cropped or one that was padded: 364 columns, 77 white ones on each side."""
    made = Made((140, 100), (518, 518), (3.64, 3.7), (77, 0))
    fields = files.vggt(made)
    fields["images"][..., :77], fields["images"][..., -77:] = 1, 1
    save(tmp_path / "predictions.npz", fields)
    made.write_photos(tmp_path / "images")
    np.testing.assert_allclose(open_scene(tmp_path).frames[1].lens.intrinsics, made.camera, atol=1e-4)


def test_only_map_anything_is_metric_and_notes_say_what_was_predicted(tmp_path: Path):
    units = {}
    for name, (write, made) in TOOLS.items():
        scene = open_scene(save(tmp_path / f"{name}.npz", write(made)))
        units[name] = scene.unit
        assert scene.name == name
        assert scene.notes[0].startswith("Cameras and depth were predicted by ")
    assert {name for name, unit in units.items() if unit == "metric"} == {"map_anything_app", "map_anything"}
    scene = open_scene(tmp_path / "vggt.npz")
    assert scene.notes == (
        "Cameras and depth were predicted by VGGT; no sensor measured them.",
        "VGGT's unit of length is arbitrary, so depths are not in metres.",
        "Depth with a confidence below 1.5 counts as unknown: 4% of the pixels.",  # one row of 28
        "The frames are the images in the file, 42x28, as no photos are beside it.",
    )


def test_depth_anything_is_metric_if_the_file_says_so(tmp_path: Path):
    fields = {**files.depth_anything(SMALL, mini=False), "is_metric": np.array(1)}
    assert open_scene(save(tmp_path / "a.npz", fields)).unit == "metric"
    assert open_scene(save(tmp_path / "b.npz", {**fields, "is_metric": np.array(0)})).unit == "unknown"


def test_depth_anything_writes_two_folders_below_its_output_and_takes_frames_of_a_video_beside_them(tmp_path: Path):
    made = WITH_PHOTOS["depth_anything"][1]
    save(tmp_path / "hall/exports/mini_npz/results.npz", files.depth_anything(made), compressed=True)
    made.write_photos(tmp_path / "hall/input_images")
    scene = open_scene(tmp_path / "hall")
    assert scene.name == "hall"
    assert scene.frames[0].name == "input_images/000.png"
    assert [one.path for one in open_scenes(tmp_path)] == [scene.path]


def test_results_of_something_else_are_no_scene(tmp_path: Path):
    save(tmp_path / "results.npz", {"accuracy": np.ones(3)})
    with pytest.raises(InputError, match="no known layout"):
        open_scene(tmp_path)


def test_photos_may_lie_anywhere_if_the_user_names_their_folder(tmp_path: Path):
    write, made = WITH_PHOTOS["vggt"]
    path = save(tmp_path / "out/predictions.npz", write(made))
    made.write_photos(tmp_path / "holiday")
    assert open_predictions(path, tmp_path / "holiday").frames[2].name == "holiday/002.png"


def test_names_in_the_file_say_which_photo_is_which(tmp_path: Path):
    made = WITH_PHOTOS["depth_anything"][1]
    photos = made.write_photos(tmp_path / "images")
    for old, new in (("000", "z"), ("001", "m"), ("002", "a")):
        (photos / f"{old}.png").rename(photos / f"{new}.png")
    shutil.copy(photos / "a.png", photos / "b.png")  # one more than the file has
    fields = {**files.depth_anything(made), "image_paths": np.array(["/data/z.png", "/data/m.png", "C:\\data\\a.png"])}
    scene = open_scene(save(tmp_path / "predictions.npz", fields))
    assert [frame.name for frame in scene.frames] == ["images/z.png", "images/m.png", "images/a.png"]


@pytest.mark.parametrize("name", ["npz", "vggt", "map_anything_app", "map_anything", "dust3r"])
@pytest.mark.parametrize("change", ["inverse", "opengl", "millimetres"])
def test_poses_and_depth_that_contradict_each_other_are_refused_with_the_reason(tmp_path: Path, name: str, change: str):
    write, made = TOOLS[name]
    fields = write(made)
    to_world = name not in ("npz", "vggt")
    key = next(one for one in ("extrinsics", "extrinsic", "camera_poses", "im_poses") if one in fields)
    stored = made.poses if to_world else made.world_to_camera
    flip = np.diag([1.0, -1.0, -1.0, 1.0])
    if change == "millimetres":
        depth = next(one for one in ("depth", "depth_z", "depthmaps") if one in fields)
        fields[depth] = 1000 * fields[depth]
    else:
        fields[key] = np.linalg.inv(stored) if change == "inverse" else stored @ flip if to_world else flip @ stored
    looks = {
        "inverse": "world to camera" if to_world else "camera to world",
        "opengl": "axes of OpenGL (y up, z backward)",
        "millimetres": "depth in millimetres of poses in metres",
    }[change]
    message = refused(save(tmp_path / "predictions.npz", fields))
    assert f"predictions.npz: {key}: expected " in message
    assert f"found what looks like {looks}: the depth of neighbouring photos then differs by 0." in message


def test_nothing_is_unpickled(tmp_path: Path):
    """VGGT's file has a field that numpy would unpickle; it is not read. A depth that is one is refused."""

    class Evil:
        def __reduce__(self):
            return (tmp_path / "ran").touch, ()

    fields = {**files.vggt(SMALL), "pose_enc_list": np.array(Evil(), dtype=object)}
    assert len(open_scene(save(tmp_path / "predictions.npz", fields))) == 3
    message = refused(save(tmp_path / "predictions.npz", {**fields, "depth": np.array(Evil(), dtype=object)}))
    assert "expected an array of numbers" in message
    assert "Python objects are not read: stack the arrays, np.stack(list(array)), and save again" in message
    (tmp_path / "predictions.pt").write_bytes(pickle.dumps([1]))
    assert refused(tmp_path / "predictions.pt").endswith(
        "predictions.pt: expected arrays saved with numpy.savez (.npz), found a pickle, which could run any code; "
        "save it as predictions.npz with numpy.savez, one array for each field"
    )
    assert not (tmp_path / "ran").exists()


def test_an_array_that_inflates_to_more_than_the_limit_is_refused_before_it_is_read(tmp_path: Path):
    path = save(tmp_path / "predictions.npz", files.vggt(SMALL))
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            with archive.open(name, "w") as file:
                file.write(content)
                for _ in range(300 if name == "depth.npy" else 0):
                    file.write(bytes(1 << 20))
    assert path.stat().st_size < 1 << 20
    assert refused(path).endswith(
        "predictions.npz: depth: expected an array of at most 256 MiB, found one of 300 MiB; save fewer photos in one file"
    )


def changed(**fields: object) -> Callable[[dict], dict]:
    """Fields with some replaced."""
    return lambda old: {**old, **{key: value(old[key]) for key, value in fields.items()}}


def without(key: str) -> Callable[[dict], dict]:
    """Fields without one."""
    return lambda old: {name: value for name, value in old.items() if name != key}


def with_value(array: np.ndarray, place: tuple, value: float) -> np.ndarray:
    """An array with one other number."""
    array = array.copy()
    array[place] = value
    return array


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without("extrinsic"), "expected the fields extrinsic, intrinsic, depth, depth_conf (VGGT); or extrinsic, intrinsic, depth, final_mask (MapAnything); "
         "or camera_poses, intrinsics, depth_z (MapAnything); or extrinsics, intrinsics, depth (Depth Anything 3); or im_poses, intrinsics, depthmaps (DUSt3R), "
         "found depth, depth_conf, images, intrinsic, pose_enc, pose_enc_list, world_points_conf"),
        (changed(depth=lambda old: old[..., 0, 0]), "depth: expected depth maps [n h w] of two or more photos, found an array of shape (3, 28)"),
        (changed(depth=lambda old: old[:1]), "depth: expected depth maps [n h w] of two or more photos, found an array of shape (1, 28, 42, 1)"),
        (changed(depth=lambda old: with_value(old, (1, 3, 4, 0), -0.25)), "depth[1]: expected z-depths that are positive, or 0 where unknown, found -0.25"),
        (changed(depth=lambda old: old * [[[[1]]], [[[1]]], [[[0]]]]), "depth[2]: expected a map with some known depth, found 0 everywhere"),
        (changed(depth_conf=lambda old: old[:, 1:]), "depth_conf: expected maps of shape (3, 28, 42), as the depth, found an array of shape (3, 27, 42)"),
        (changed(images=lambda old: old[..., 1:]), "images: expected images of shape (3, 28, 42, 3), as the depth, found an array of shape (3, 3, 28, 41)"),
        (changed(images=lambda old: 255 * old), "images[0]: expected images of 8 bits, or of floats from 0 to 1, found float32 from 26 to 229"),
        (changed(extrinsic=lambda old: old[:2]), "extrinsic: expected 3 poses [n 3 4] or [n 4 4], as many as depth maps, found an array of shape (2, 3, 4)"),
        (changed(extrinsic=lambda old: with_value(old, (1, 0, 3), np.nan)),
         "extrinsic[1]: expected a world-to-camera matrix [R t; 0 0 0 1] of finite numbers, R a rotation, found a number that is not finite"),
        (changed(extrinsic=lambda old: old * [[[1]], [[1]], [[2]]]),
         "extrinsic[2]: expected a world-to-camera matrix [R t; 0 0 0 1] of finite numbers, R a rotation, "
         "found a 3x3 part with determinant 8 that is not a rotation (it scales by 2); divide each of its three columns by its length"),
        (changed(intrinsic=lambda old: old * [[4], [4], [1]]),
         "intrinsic[0]: expected a camera of images of 42x28 (width x height), found a principal point at (80.64, 59.36); "
         "if they are the intrinsics of the full-size photos, save those of the processed images"),
        (changed(intrinsic=lambda old: with_value(old, (1, 0, 0), 2.0)), "intrinsic[1]: expected a camera of images of 42x28 (width x height), "
         "found focal lengths of 2 and 36 pixels; if they are the intrinsics of the full-size photos, save those of the processed images"),
        (without("images"), "expected images in the file, or its 3 photos in the folder images beside it, found neither; "
         "images of more than 256 MiB in all are not read from the file"),
    ],
)  # fmt: skip
def test_a_file_that_cannot_be_right_is_refused_in_one_line(tmp_path: Path, change: Callable, message: str):
    path = save(tmp_path / "predictions.npz", change(files.vggt(SMALL)))
    assert refused(path) == f"{path}: {message}"


def test_photos_of_another_number_size_or_content_are_refused(tmp_path: Path):
    write, made = WITH_PHOTOS["vggt"]
    path = save(tmp_path / "predictions.npz", write(made))
    photos = made.write_photos(tmp_path / "images")
    shutil.copy(photos / "000.png", photos / "extra.png")
    assert refused(path) == (
        f"{photos}: expected the 3 photos of {path}, found 4 photos; "
        "it should have those photos and no others; their order is that of their names"
    )
    (photos / "extra.png").unlink()
    (photos / "000.png").rename(photos / "999.png")  # now the last
    assert refused(path).startswith(f"{photos}/001.png: expected the photo of frame 0 of {path}, found another one: ")
    replace(made, photo=(90, 160)).write_photos(photos)
    (photos / "999.png").unlink()
    # 90 * 518 / 160 = 291.4, and 21 * 14 = 294.
    assert refused(path) == (
        f"{photos}/000.png: expected a photo that VGGT makes 518x364 pixels, as in {path}, found one of 160x90, which becomes 518x294 "
        "(width x height); put the photos that the file was made from in this folder, or remove it to use the images in the file"
    )


def test_a_turned_photo_has_the_size_that_the_tool_gave_it(tmp_path: Path):
    """VGGT does not turn photos: one of 140x100 pixels with an orientation stays wide. MapAnything turns it."""
    from PIL import Image

    for name in ("vggt", "map_anything"):
        write, made = WITH_PHOTOS[name]
        folder = tmp_path / name
        save(folder / "predictions.npz", write(made))
        made.write_photos(folder / "images")
        for photo in sorted((folder / "images").iterdir()):
            with Image.open(photo) as image:
                pixels = np.asarray(image)
            tag = Image.Exif()
            tag[0x0112] = 6  # the pixels are to be turned clockwise
            turned = pixels if name == "vggt" else np.rot90(pixels, 1)
            Image.fromarray(np.ascontiguousarray(turned)).save(photo.with_suffix(".jpg"), quality=95, exif=tag)
            photo.unlink()
        frame = open_scene(folder).frames[0]
        assert frame.lens.size == WIDE
        np.testing.assert_allclose(frame.lens.intrinsics, made.camera, atol=1e-4)
        seen = files.view(made.camera, WIDE, made.poses[0])[1].astype(float)
        assert np.abs(frame.read_image() - seen).mean() < 8

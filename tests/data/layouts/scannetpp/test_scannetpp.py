"""ScanNet++: cameras, fisheye, labels and depth of the mesh are what was written."""

from __future__ import annotations

import json
import shutil
import tracemalloc
import warnings
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from landmarks import drawn, found
from PIL import Image

pytest.importorskip("embreex")
pytest.importorskip("trimesh")

from cast_room import miniature, pinhole_rays, poses
from scannetpp_writer import (
    DSLR,
    DSLR_SIZE,
    NAMES,
    PHONE,
    PHONE_SIZE,
    TEST,
    UNKNOWN,
    colmap,
    fisheye_pixels,
    fisheye_rays,
    mask,
    phone_rays,
    transforms,
    write_dslr,
    write_phone,
    write_scan,
)

from semgs.data.cameras.fisheye import FisheyeLens
from semgs.data.layouts.parts import mesh_maps
from semgs.data.layouts.parts.mesh_maps import LabelledTriangles
from semgs.data.layouts.scannet.scannet_labels import NYU40_NAMES
from semgs.data.layouts.scannetpp import scannetpp_scan as scannetpp
from semgs.data.layouts.scannetpp.devices import in_mesh_world
from semgs.data.layouts.scannetpp.scannetpp_labels import BY_SCANNET, BY_US, NYU40_OF, labels_of
from semgs.data.layouts.scannetpp.scannetpp_mesh import object_names, read_mesh, vertex_labels
from semgs.data.scenes import open_scene, open_scenes
from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError
from semgs.geometry.cameras import project

ORDER = sorted(range(6), key=lambda index: NAMES[index])


@pytest.fixture(scope="module")
def scan(tmp_path_factory) -> Path:
    return write_scan(tmp_path_factory.mktemp("scans of rooms"))


@pytest.fixture
def copied(scan, tmp_path) -> Path:
    """A scan to spoil."""
    return Path(shutil.copytree(scan.parents[1], tmp_path / "scannetpp")) / "data" / scan.name


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch) -> Path:
    """A cache of the test's own."""
    monkeypatch.setenv("SEMGS_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def check_maps(
    labels: np.ndarray, depths: np.ndarray, pose: np.ndarray, k: np.ndarray, hidden: np.ndarray | None
) -> None:
    """Labels and depths of a pinhole are those of the room at the pixels' centres; none where a mask hides them."""
    truth = miniature().photograph(pose, pinhole_rays(labels.shape, k, 0.5))
    wrong = labels != truth.labels
    shown = np.ones(labels.shape, bool) if hidden is None else ~hidden
    assert wrong[shown].mean() < 1e-3  # a ray through an edge may end on either side
    same = shown & ~wrong & (truth.labels != 255)
    assert np.abs(depths - truth.depth / 1000)[same].max() < 0.0011
    if hidden is not None:
        assert (labels[hidden] == 255).all()
        assert (depths[hidden] == 0).all()


def test_the_phones_frames_are_read_as_they_were_written(scan):
    scene = open_scene(scan / "iphone")
    assert (scene.name, scene.layout, scene.unit) == ("0a76e06478", "ScanNet++ iphone", "metric")
    assert [frame.name for frame in scene.frames] == [f"frame_{10 * n:06d}.jpg" for n in range(6)]
    views = scene.read(range(6), "native")
    torch.testing.assert_close(views.cameras.world_from_camera, torch.from_numpy(poses()), atol=1e-9, rtol=0)
    stored = np.asarray(Image.open(scan / "iphone" / "rgb" / "frame_000010.jpg"))
    assert np.array_equal((views.images[1] * 255).round().byte().permute(1, 2, 0).numpy(), stored)
    k = np.array([[PHONE["fl_x"], 0, PHONE["cx"]], [0, PHONE["fl_y"], PHONE["cy"]], [0, 0, 1]])
    assert views.cameras[0].intrinsics.tolist() == k.tolist()
    for index in range(6):
        check_maps(views.labels[index].numpy(), views.depths[index].numpy(), poses()[index], k, mask(PHONE_SIZE) == 0)


def test_both_ways_of_telling_the_cameras_tell_the_same(scan, copied):
    shutil.rmtree(copied / "dslr" / "colmap")
    shutil.rmtree(copied / "iphone" / "colmap")
    for device in ("dslr", "iphone"):
        first, second = open_scene(scan / device), open_scene(copied / device)
        assert [frame.name for frame in first.frames] == [frame.name for frame in second.frames]
        assert first.splits == second.splits
        for one, other in zip(first.frames, second.frames, strict=True):
            np.testing.assert_allclose(one.world_from_camera, other.world_from_camera, atol=1e-9)
            assert one.lens == other.lens


def test_the_dslrs_photos_are_undistorted_and_have_exact_labels(scan):
    scene = open_scene(scan)
    assert scene.layout == "ScanNet++ dslr"
    assert [frame.name for frame in scene.frames] == sorted(NAMES)
    views = scene.read(range(6), size=(80, 120))
    for index, number in enumerate(ORDER):
        pose, k = poses()[number], views.cameras[index].intrinsics.numpy()
        np.testing.assert_allclose(views.cameras[index].world_from_camera.numpy(), pose, atol=1e-9)
        hidden = (views.labels[index].numpy() == 255) & (views.depths[index].numpy() == 0)
        assert 0.02 < hidden.mean() < 0.2
        check_maps(views.labels[index].numpy(), views.depths[index].numpy(), pose, k, hidden)
        truth = miniature().photograph(pose, pinhole_rays((80, 120), k, 0.5)).colour / 255
        off = views.images[index].permute(1, 2, 0).numpy() - truth
        assert -10 * np.log10(np.mean(off**2)) > 22  # interpolated twice, compressed once, of edges without blur


def test_the_parts_for_training_and_test_are_known_by_position(scan):
    scene = open_scene(scan)
    names = [frame.name for frame in scene.frames]
    assert {names[index] for index in scene.splits["test"]} == set(TEST)
    assert sorted((*scene.splits["train"], *scene.splits["test"])) == list(range(6))


def test_a_matrix_goes_to_the_meshs_world_and_axes(scan):
    """By hand: the camera looks along the world's x, its y is down, at (1, 2, 3)."""
    pose = np.array([[0.0, 0, 1, 1], [-1, 0, 0, 2], [0, -1, 0, 3], [0, 0, 0, 1]])
    stored = np.array([[-1.0, 0, 0, 2], [0, 0, -1, 1], [0, -1, 0, -3], [0, 0, 0, 1]])
    np.testing.assert_array_equal(in_mesh_world(stored[None])[0], pose)


LARGE = (290, 440)
LENS = {"fl_x": 198.4, "fl_y": 199.1, "cx": 223.3, "cy": 141.9, **{f"k{n}": DSLR[f"k{n}"] for n in range(1, 5)}}


def landmarks() -> np.ndarray:
    """Points before the first cameras, up to the corners of their pictures."""
    grid = np.stack(np.meshgrid(np.linspace(-0.85, 0.85, 5), np.linspace(-0.55, 0.55, 4), [1.0]), axis=-1).reshape(
        -1, 3
    )
    return 2.5 * grid @ poses()[1][:3, :3].T + poses()[1][:3, 3]


def offsets(scene, points: np.ndarray) -> np.ndarray:
    """How far the spots in the first frame are from where its camera puts the points [n 2]."""
    views = scene.read([0], "native")
    expected = project(torch.from_numpy(points), views.cameras[0])[:, :2].numpy()
    inside = ((expected > 9) & (expected < np.array(views.size[::-1]) - 9)).all(axis=1)
    assert inside.sum() >= 12
    return np.abs(found(views.images[0], expected[inside], (8, 8)) - expected[inside])


def write_spots(folder: Path) -> Path:
    """A DSLR whose photos show the landmarks, without a mesh."""
    dslr = folder / "dslr"
    (dslr / "resized_images").mkdir(parents=True)
    named = {f"DSC0000{index}.JPG": poses()[index] for index in (1, 2)}
    for name, pose in named.items():
        picture = drawn(LARGE, fisheye_pixels(landmarks(), pose, LENS), sigma=1.5)
        Image.fromarray(picture).save(dslr / "resized_images" / name, "PNG")
    colmap(dslr / "colmap", "OPENCV_FISHEYE", LARGE, LENS, named, "\r\n")
    return folder


def test_a_fisheye_is_undone_to_a_tenth_of_a_pixel(tmp_path):
    scene = open_scene(write_spots(tmp_path / "with a space"))
    assert offsets(scene, landmarks()).max() < 0.1
    lens = scene.frames[0].lens
    x, y = lens.maps()  # in OpenCV's positions, of which the first pixel's is 0
    for row, column in ((0, 0), (3, 400), (120, 77), (289, 439)):
        ray = np.linalg.inv(lens.intrinsics) @ (column + 0.5, row + 0.5, 1)
        expected = fisheye_pixels(ray[None], np.eye(4), LENS)
        np.testing.assert_allclose((x[row, column] + 0.5, y[row, column] + 0.5), expected[0], atol=2e-3)
    directions = lens.directions(fisheye_pixels(landmarks(), poses()[1], LENS))
    inside = (landmarks() - poses()[1][:3, 3]) @ poses()[1][:3, :3]
    np.testing.assert_allclose(directions, inside / inside[:, 2:], atol=1e-6)


def toolbox(picture: np.ndarray, camera: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """What `dslr/undistort.py` does: the picture and its K."""
    size = (picture.shape[1], picture.shape[0])
    k = np.array([[camera["fl_x"], 0, camera["cx"]], [0, camera["fl_y"], camera["cy"]], [0, 0, 1]])
    bent = np.array([camera[f"k{n}"] for n in range(1, 5)])
    new = cv2.fisheye.estimateNewCameraMatrixForUndistortRectify(k, bent, size, np.eye(3), balance=0.0)
    new[0, 2], new[1, 2] = size[0] / 2, size[1] / 2
    maps = cv2.fisheye.initUndistortRectifyMap(k, bent, np.eye(3), new, size, cv2.CV_32FC1)
    return cv2.remap(picture, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101), new


def test_the_toolboxs_undistortion_is_a_named_choice(tmp_path):
    folder = write_spots(tmp_path)
    scene = open_scene(folder, as_peers=["toolbox-undistortion"])
    picture = np.asarray(Image.open(folder / "dslr" / "resized_images" / "DSC00001.JPG"))
    expected, k = toolbox(picture, LENS)
    views = scene.read([0], "native")
    np.testing.assert_allclose(views.cameras[0].intrinsics.numpy(), k)
    inner = (slice(None), slice(5, -5), slice(5, -5))  # what is outside is made up in another way
    np.testing.assert_allclose(views.images[0].numpy()[inner], expected.transpose(2, 0, 1)[inner] / 255, atol=0.005)
    assert 0.15 < offsets(scene, landmarks()).max() < 1  # ours is within 0.1
    assert "toolbox" in scene.notes[-1]


def test_what_the_toolbox_undistorted_is_read_as_it_is(tmp_path):
    folder = write_spots(tmp_path)
    dslr = folder / "dslr"
    (dslr / "undistorted_images").mkdir()
    (dslr / "nerfstudio").mkdir()
    for path in (dslr / "resized_images").iterdir():
        picture, k = toolbox(np.asarray(Image.open(path)), LENS)
        Image.fromarray(picture).save(dslr / "undistorted_images" / path.name, "PNG")
    camera = {
        "fl_x": k[0, 0],
        "fl_y": k[1, 1],
        "cx": k[0, 2],
        "cy": k[1, 2],
        "k1": 0.0,
        "k2": 0.0,
        "k3": 0.0,
        "k4": 0.0,
    }
    named = {f"DSC0000{index}.JPG": poses()[index] for index in (1, 2)}
    told = transforms("PINHOLE", LARGE, camera, named)
    (dslr / "nerfstudio" / "transforms_undistorted.json").write_text(json.dumps(told))
    scene = open_scene(folder)
    assert scene.frames[0].lens.is_pinhole
    assert scene.frames[0].picture.parent.name == "undistorted_images"
    np.testing.assert_allclose(scene.cameras[0].intrinsics.numpy(), k)
    assert offsets(scene, landmarks()).max() < 1  # the toolbox's half pixel
    shutil.rmtree(dslr / "undistorted_images")
    scene = open_scene(folder)
    assert not scene.frames[0].lens.is_pinhole
    assert "the fisheye images are read" in scene.notes[0]


def test_without_a_mesh_there_are_no_labels_and_the_phones_depth_is_its_sensors(tmp_path):
    write_phone(tmp_path / "scan")
    scene = open_scene(tmp_path / "scan")
    views = scene.read([0, 1], "native")
    assert views.labels is None
    assert scene.notes == (
        "There is no scans/mesh_aligned_0.05.ply, so there are no labels.",
        "Depth is from the iphone's sensor.",
    )
    truth = miniature().photograph(poses()[0], phone_rays()).depth / 1000
    depths = views.depths[0].numpy()
    assert (depths[mask(PHONE_SIZE) == 0] == 0).all()
    assert np.median(np.abs(depths - truth)[depths > 0]) < 0.05  # sixteen pixels share one of the sensor's
    write_dslr(tmp_path / "other")
    scene = open_scene(tmp_path / "other")
    assert scene.read([0], "native").depths is None
    assert scene.notes[-1] == "There is no depth."


def test_without_embree_there_are_no_labels_and_the_extra_is_named(scan, monkeypatch):
    monkeypatch.setattr(scannetpp, "find_spec", lambda name: None if name == "embreex" else find_spec(name))
    scene = open_scene(scan / "iphone")
    assert scene.classes is None
    assert scene.read([0], "native").depths is not None
    assert any("pip install -e '.[raycast]'" in note for note in scene.notes)


def test_a_table_of_another_version_leaves_the_depth(copied):
    (copied / "scannetv2-labels.combined.tsv").write_text("index\tname\n1\twall\n")
    with pytest.raises(InputError, match=r"\.tsv: id: expected ScanNet's"):
        open_scene(copied / "iphone")
    scene = open_scene(copied / "iphone", needs_labels=False)
    view = scene.read([0], "native")
    assert (scene.classes, view.labels) == (None, None)
    assert view.depths is not None
    assert scene.notes[-1].startswith("The labels are left out: ")


def test_masks_are_undistorted_with_their_pictures(scan):
    frame = open_scene(scan).frames[0]
    views = frame.view((0.5, 10.0), SCANNET20).checked()
    seen = (views.depths[0] > 0).numpy()
    rows, columns = np.nonzero(~seen)
    assert (rows.max() < 60 and columns.max() < 70) or seen.all()
    corner = fisheye_rays(DSLR_SIZE, DSLR)[DSLR_SIZE[0] // 3 - 1, DSLR_SIZE[1] // 4 - 1]
    k = views.cameras[0].intrinsics.numpy()
    x, y, _ = k @ corner
    assert abs(columns.max() + 1 - x) < 2
    assert abs(rows.max() + 1 - y) < 2


def test_names_of_no_table_are_told_with_their_number(scan):
    scene = open_scene(scan)
    told = next(note for note in scene.notes if "in no table" in note)
    assert f"1 of {len(object_names(scan / 'scans' / 'segments_anno.json'))} object names" in told
    assert f"{UNKNOWN} (1)." in told


TOP_100 = (
    "wall", "ceiling", "floor", "table", "door", "ceiling lamp", "cabinet", "blinds", "curtain", "chair", "storage cabinet",
    "office chair", "bookshelf", "whiteboard", "window", "box", "window frame", "monitor", "shelf", "doorframe", "pipe", "heater",
    "kitchen cabinet", "sofa", "windowsill", "bed", "shower wall", "trash can", "book", "plant", "blanket", "tv", "computer tower",
    "kitchen counter", "refrigerator", "jacket", "electrical duct", "sink", "bag", "picture", "pillow", "towel", "suitcase",
    "backpack", "crate", "keyboard", "rack", "toilet", "paper", "printer", "poster", "painting", "microwave", "board", "shoes",
    "socket", "bottle", "bucket", "cushion", "basket", "shoe rack", "telephone", "file folder", "cloth", "blind rail", "laptop",
    "plant pot", "exhaust fan", "cup", "coat hanger", "light switch", "speaker", "table lamp", "air vent", "clothes hanger",
    "kettle", "smoke detector", "container", "power strip", "slippers", "paper bag", "mouse", "cutting board", "toilet paper",
    "paper towel", "pot", "clock", "pan", "tap", "jar", "soap dispenser", "binder", "bowl", "tissue box", "whiteboard eraser",
    "toilet brush", "spray bottle", "headphones", "stapler", "marker",
)  # fmt: skip
"""The classes of ScanNet++'s semantic benchmark in its order, as several public configurations list them (its own file is not public)."""


@pytest.mark.parametrize("name", TOP_100)
def test_each_of_the_top_100_is_mapped_or_ignored(name):
    known, missed = labels_of({name: 1}, None)
    assert missed == ()
    nyu40 = NYU40_NAMES[NYU40_OF[name] - 1]
    assert known == ((name, SCANNET20.names.index(nyu40) if nyu40 in SCANNET20.names else 255),)


def test_the_top_100_are_a_hundred_and_each_name_has_one_class():
    assert len(set(TOP_100)) == 100
    known, _ = labels_of(dict.fromkeys(TOP_100, 1), None)
    assert sum(label == 255 for _, label in known) == 72  # as docs/data.md has it
    names = [name for table in (BY_SCANNET, BY_US) for names in table.values() for name in names]
    assert len(names) == len(set(names))
    assert set(SCANNET20.names) - {"otherfurniture"} <= set(names)
    assert set(BY_SCANNET) | set(BY_US) <= set(NYU40_NAMES)


def test_scannets_own_table_comes_first(tmp_path):
    from semgs.data.layouts.scannet.scannet_labels import LabelTable

    table = LabelTable(tmp_path, {}, {"rack": 3, "swivel stool": 5})
    known, missed = labels_of({"rack": 2, "Swivel  Stool": 1, "crate": 4, "gizmo": 9}, table)
    assert dict(known) == {"rack": 2, "Swivel  Stool": 4, "crate": 19}
    assert missed == (("gizmo", 9),)


def small_mesh(folder: Path, groups: list[dict], segments: list[int]) -> None:
    """The annotations of a mesh with a few vertices."""
    (folder / "segments.json").write_text(json.dumps({"segIndices": segments}))
    (folder / "segments_anno.json").write_text(json.dumps({"segGroups": groups}))


def test_of_objects_that_share_a_vertex_the_smallest_counts_even_if_it_has_no_label(tmp_path):
    groups = [
        {"label": "cup", "segments": [7]},
        {"label": "wall", "segments": [3, 7, 9, 11]},
        {"label": "door", "segments": [9, 11, 400]},
        {"label": "window", "segments": [9, 11]},
    ]
    small_mesh(tmp_path, groups, [3, 3, 7, 9, 11, 5])
    labels = vertex_labels(tmp_path, 6, {"wall": 0, "door": 7, "window": 8})
    assert labels.tolist() == [0, 0, 255, 7, 7, 255]  # of two as small as each other the first


def test_segments_may_have_any_numbers_without_taking_memory_for_those_between(tmp_path):
    """Counting up to the largest number took a gigabyte for one damaged file."""
    small_mesh(tmp_path, [{"label": "wall", "segments": [2**62]}], [2**62, 5, 2**62])
    tracemalloc.start()
    try:
        labels = vertex_labels(tmp_path, 3, {"wall": 0})
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert labels.tolist() == [0, 255, 0]
    assert most < 1e6


def test_what_was_cast_is_kept_and_what_changed_is_cast_anew(copied, cache, monkeypatch):
    scene = open_scene(copied)
    first = scene.read([0, 1], size=(40, 60))
    kept = sorted(cache.rglob("*.npz"))
    assert len(kept) == 2
    assert kept[0].parent == cache / "casts" / copied.name

    def refused(*_):
        raise AssertionError("cast again")

    monkeypatch.setattr(LabelledTriangles, "cast", refused)
    again = scene.read([0, 1], size=(40, 60))
    assert torch.equal(first.labels, again.labels)
    assert torch.equal(first.depths, again.depths)
    with pytest.raises(AssertionError, match="cast again"):
        scene.read([0], size=(20, 30))
    kept[0].write_bytes(kept[0].read_bytes()[:-20])
    with pytest.raises(AssertionError, match="cast again"):
        scene.read([0, 1], size=(40, 60))
    monkeypatch.undo()
    monkeypatch.setenv("SEMGS_CACHE", str(cache))
    masked = copied / "scans" / "mesh_aligned_0.05_mask.txt"
    masked.write_text("\r\n".join(str(vertex) for vertex in range(len(miniature().corners) * 3)))
    assert (scene.read([0, 1], size=(40, 60)).depths == 0).all()


def test_where_nothing_can_be_kept_it_is_cast_and_said_once(scan, tmp_path, monkeypatch):
    (tmp_path / "a file").touch()
    monkeypatch.setenv("SEMGS_CACHE", str(tmp_path / "a file"))
    mesh_maps._say_once.cache_clear()
    scene = open_scene(scan)
    with pytest.warns(UserWarning, match="cannot be cached in .*a file/casts .* set SEMGS_CACHE to another"):
        views = scene.read([0], size=(20, 30))
    assert views.labels is not None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene.read([1], size=(20, 30))


def test_bad_and_absent_pictures_are_counted(scan, tmp_path):
    folder = tmp_path / "scan"
    write_dslr(folder, bad="DSC00007.JPG", end="\r\n")
    (folder / "dslr" / "resized_images" / "DSC00003.JPG").unlink()
    (folder / "dslr" / "resized_anon_masks" / "DSC00009.png").unlink()
    scene = open_scene(folder)
    assert [frame.name for frame in scene.frames] == ["DSC00002.JPG", "DSC00008.JPG", "DSC00009.JPG", "DSC00010.JPG"]
    assert scene.absent == ("DSC00003.JPG",)
    assert scene.notes[:3] == (
        f"1 of 6 listed images are missing in {folder / 'dslr' / 'resized_images'}, the first is DSC00003.JPG.",
        "1 image is marked as bad and left out.",
        "1 of 4 images have no mask in resized_anon_masks, the first is DSC00009.JPG.",
    )
    assert scene.splits == {"train": (0, 1, 3), "test": (2,)}


def test_scans_of_a_folder_are_found_and_the_other_device_is_told_of(scan):
    (scene,) = open_scenes(scan.parent)
    assert (scene.name, scene.layout) == (scan.name, "ScanNet++ dslr")
    assert f"There is also iphone/; to read it, open {scan / 'iphone'}." in scene.notes
    assert not any("There is also" in note for note in open_scene(scan / "dslr").notes)


def replaced(path: Path, old: str, new: str) -> None:
    """Exchange a text in a file."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("dslr/colmap/cameras.txt", "OPENCV_FISHEYE", "EQUIRECTANGULAR", r"cameras\.txt: line 3: expected a camera model of .*, found EQUIRECTANGULAR"),
        ("dslr/colmap/cameras.txt", " -0.0003", "", r"line 3: expected 8 parameters of OPENCV_FISHEYE, found 7"),
        ("dslr/colmap/cameras.txt", "78.3", "wide", r"line 3: expected numbers"),
        ("dslr/colmap/cameras.txt", "1 OPENCV_FISHEYE 174", "1 OPENCV_FISHEYE 175", r"DSC00002\.JPG: expected 175x116 pixels .*, found 174x116"),
        ("dslr/colmap/cameras.txt", "-0.0304", "-9.5", r"camera 1: expected a possible camera"),
        ("dslr/colmap/images.txt", " 1 DSC00002.JPG", " 2 DSC00002.JPG", r"images\.txt: line 5: expected a camera that cameras\.txt has, found 2"),
        ("dslr/colmap/images.txt", "1 DSC00010.JPG", "", r"line 3: expected IMAGE_ID QW"),
        ("dslr/train_test_lists.json", '"DSC00003.JPG"', "3", r"train_test_lists\.json: test: expected a list of names"),
        ("scans/segments.json", '"segIndices": [', '"segIndices": [5, ', r"segIndices: expected a segment for each of the \d+ vertices"),
        ("scans/segments.json", '"segIndices": [', '"segIndices": ["a", ', r"segIndices: expected a list of integers"),
        ("scans/segments_anno.json", '"segGroups"', '"groups"', r"segments_anno\.json: segGroups: expected a list of objects"),
        ("scans/segments_anno.json", "[", "", r"segments_anno\.json: expected JSON"),
    ],
)  # fmt: skip
def test_broken_files_are_named(copied, name, old, new, message):
    replaced(copied / name, old, new)
    with pytest.raises(InputError, match=message):
        open_scene(copied).read([0], size=(20, 30))


@pytest.mark.parametrize("comment", [b"comment B\xfcro\n", b"comment B\xc3\xbcro\r\n", b"obj_info \xff\n"])
@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_a_mesh_may_have_comments_in_any_encoding(tmp_path, comment, form):
    vertices = np.array([[1, 2, 3], [4, 5, 6], [7, 8, 10]], "<f4")
    body = b"1 2 3\n4 5 6\n7 8 10\n3 0 2 1\n"
    if form != "ascii":
        body = vertices.tobytes() + b"\x03" + np.array([0, 2, 1], "<i4").tobytes()
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    head = f"format {form} 1.0\nelement vertex 3\n{properties}{faces}"
    (tmp_path / "a.ply").write_bytes(b"ply\n" + comment + head.encode() + body)
    found, triangles = read_mesh(tmp_path / "a.ply")
    np.testing.assert_array_equal(found, vertices)
    np.testing.assert_array_equal(triangles, [[0, 2, 1]])


def test_a_mesh_that_git_lfs_has_not_fetched_is_called_so(tmp_path):
    (tmp_path / "a.ply").write_bytes(b"version https://git-lfs.github.com/spec/v1\noid sha256:4d\nsize 9\n")
    with pytest.raises(InputError, match=r"a\.ply: expected the mesh of the scan, found a Git LFS pointer"):
        read_mesh(tmp_path / "a.ply")


def test_a_broken_mesh_is_named_when_it_is_read(copied):
    path = copied / "scans" / "mesh_aligned_0.05.ply"
    path.write_bytes(path.read_bytes()[:5000])
    with pytest.raises(InputError, match=r"mesh_aligned_0\.05\.ply: expected a PLY with triangles"):
        open_scene(copied).read([0], size=(20, 30))
    (copied / "scans" / "mesh_aligned_0.05_mask.txt").write_text("1 2 x")
    path.write_bytes(b"ply")
    with pytest.raises(InputError, match=r"mesh_aligned_0\.05\.ply: expected a PLY"):
        open_scene(copied).read([0], size=(20, 30))


def test_frames_that_were_not_extracted_are_asked_for(tmp_path):
    write_phone(tmp_path / "scan")
    shutil.rmtree(tmp_path / "scan" / "iphone" / "rgb")
    (tmp_path / "scan" / "iphone" / "rgb.mkv").touch()
    with pytest.raises(
        InputError, match=r"iphone: expected images in rgb/, found none; extract the frames first: ffmpeg"
    ):
        open_scene(tmp_path / "scan")


def test_a_transforms_file_that_lacks_a_key_is_named(copied):
    shutil.rmtree(copied / "dslr" / "colmap")
    replaced(copied / "dslr" / "nerfstudio" / "transforms.json", '"fl_y"', '"fly"')
    with pytest.raises(
        InputError, match=r"transforms\.json: frames\[\d\]\.fl_y: expected a number of pixels, found nothing"
    ):
        open_scene(copied)


def test_a_fisheye_may_also_be_without_any_distortion():
    lens = FisheyeLens((100, 150), (70.0, 70.0), (75.0, 50.0))
    assert not lens.is_pinhole
    ray = lens.directions(np.array([[75 + 70 * 0.5, 50.0]]))[0]
    np.testing.assert_allclose(ray, [np.tan(0.5), 0, 1], atol=1e-7)


def test_unknown_names_of_equally_many_objects_are_sorted():
    _, missed = labels_of({"zzz": 2, "gizmo": 3, "aaa": 2, "mmm": 2}, None)
    assert missed == (("gizmo", 3), ("aaa", 2), ("mmm", 2), ("zzz", 2))

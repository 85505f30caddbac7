"""Folders of class maps."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from scenes_on_disk import SIZE, TABLE, write_labelled

from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError
from semgs.segmenters.class_map_files import MapFiles, read_probabilities, save_class_map, save_table
from semgs.segmenters.features.feature_files import FeatureFiles
from semgs.segmenters.opening import open_class_sources
from semgs.segmenters.tables import make_class_table
from semgs.sources.source import MadeBy


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    return open_scene(write_labelled(tmp_path / "scene", 3))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the table: wall 0, seat 4 and 5, floor 1; 2 and 3 are no label."""
    made = tmp_path / "maps"
    made.mkdir()
    (made / "classes.json").write_text(json.dumps(TABLE))
    return made


def numbers(path: Path, values: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(values.astype(np.uint8)).save(path)


def even(classes: int = 3, size: tuple[int, int] = SIZE) -> np.ndarray:
    return np.full((classes, *size), 1 / classes, np.float16)


def test_numbers_become_certain_classes_and_no_label_is_even(folder: Path, scene: Scene):
    values = np.zeros(SIZE, int)
    values[0, :4] = 5, 1, 3, 255
    numbers(folder / "images/000.png", values)
    found = MapFiles.opened(folder, scene).of(scene.frames[0], SIZE)
    assert found[:, 0, :5].T.tolist() == [
        [0, 1, 0],
        [0, 0, 1],
        [pytest.approx(1 / 3)] * 3,
        [pytest.approx(1 / 3)] * 3,
        [1, 0, 0],
    ]


def test_a_map_may_lie_at_the_top_if_no_other_frame_has_its_name(folder: Path, scene: Scene):
    numbers(folder / "000.png", np.ones(SIZE))
    maps = MapFiles.opened(folder, scene)
    assert maps.path_of(scene.frames[0]) == folder / "000.png"
    assert maps.path_of(scene.frames[1]) is None
    twice = MapFiles(folder, maps.labels, maps.stems + maps.stems)
    assert twice.path_of(scene.frames[0]) is None


def test_what_was_saved_is_read_again_with_its_table(tmp_path: Path, scene: Scene):
    made = MadeBy("net.onnx", "abc", "Apache-2.0")
    save_table(tmp_path / "out", make_class_table("net", ("wall", "chair")), made)
    given = np.stack((np.full((6, 8), 0.25, np.float32), np.full((6, 8), 0.75, np.float32)))
    save_class_map(tmp_path / "out", scene.frames[2], given, "0f")
    maps = MapFiles.opened(tmp_path / "out", scene)
    assert maps.made_by == made
    assert maps.photos == {scene.frames[2].name: "0f"}
    assert maps.title == f"{tmp_path / 'out'}, made by net.onnx (licence Apache-2.0)"
    assert maps.classes.colours == (SCANNET20.colours[0], SCANNET20.colours[4])
    torch.testing.assert_close(maps.of(scene.frames[2], SIZE)[1], torch.full(SIZE, 0.75))
    # Maps of a network are in ScanNet's classes unless its own are wanted: chair is the fifth of them.
    for classes, place, count in ((None, 4, 20), ("own", 1, 2)):
        found = open_class_sources(str(tmp_path / "out"), classes)(scene).of(scene.frames[2], SIZE)
        assert found.shape[0] == count
        torch.testing.assert_close(found[place], torch.full(SIZE, 0.75))


@pytest.mark.parametrize("name", ["../../photos/a.png", "/photos/a.png", "x/../../../a.png"])
def test_maps_of_photos_outside_the_scene_stay_in_their_folder(tmp_path: Path, scene: Scene, name: str):
    frame = replace(scene.frames[0], name=name)
    out = tmp_path / "a/b/out"
    save_table(out, make_class_table("net", ("wall", "chair")), MadeBy("net.onnx", "abc"))
    save_class_map(out, frame, np.full((2, 6, 8), 0.5, np.float32), "0f")
    assert [path for path in tmp_path.rglob("*.npz") if not path.is_relative_to(out)] == []
    assert MapFiles.opened(out, replace(scene, frames=(frame, *scene.frames[1:]))).path_of(frame) is not None


def test_frames_that_differ_only_in_their_ending_are_refused_for_they_would_share_a_map(folder: Path, scene: Scene):
    first, second, *rest = scene.frames
    same = replace(scene, frames=(replace(first, name="a/0.jpg"), replace(second, name="a/0.png"), *rest))
    for opened in (lambda: MapFiles.opened(folder, same), lambda: FeatureFiles.opened(folder, same)):
        with pytest.raises(InputError, match=r"differ in more than their endings.*found a/0\.jpg and a/0\.png"):
            opened()
    # The same name in two folders is no conflict.
    apart = replace(scene, frames=(replace(first, name="a/0.jpg"), replace(second, name="b/0.png"), *rest))
    assert MapFiles.opened(folder, apart).stems["0"] == 2


def test_names_of_scannet_have_its_table(folder: Path, scene: Scene):
    listed = [{"name": name, "colour": [1, 2, 3]} for name in SCANNET20.names]
    (folder / "classes.json").write_text(json.dumps({"name": "mine", "classes": listed}))
    assert open_class_sources(str(folder))(scene).classes is SCANNET20


def test_a_table_of_unknown_names_is_kept_or_refused(folder: Path, scene: Scene):
    table = {"name": "own", "classes": [{"name": name, "colour": [0, 0, 0]} for name in ("wall", "gizmo", "widget")]}
    (folder / "classes.json").write_text(json.dumps(table))
    assert open_class_sources(str(folder))(scene).classes.names == ("wall", "gizmo", "widget")
    with pytest.raises(InputError, match=r"2 of 3 class names are unknown \(gizmo, widget\).*--classes own"):
        open_class_sources(str(folder), "scannet20")(scene)


def test_bad_maps_are_refused_by_name(folder: Path, scene: Scene):
    maps, first = MapFiles.opened(folder, scene), scene.frames[0]
    with pytest.raises(
        InputError, match=r"a map of frame images/000.jpg: images/000.png or images/000.npz, found none"
    ):
        maps.of(first, SIZE)
    numbers(folder / "images/000.png", np.full(SIZE, 9))
    with pytest.raises(InputError, match="the numbers of table three, found 9 at 768 pixels"):
        maps.of(first, SIZE)
    numbers(folder / "images/000.png", np.zeros((24, 40)))
    with pytest.raises(InputError, match=r"32x24 pixels .*found 40x24"):
        maps.of(first, SIZE)


@pytest.mark.parametrize(
    ("values", "found"),
    [
        (even(4), "the 3 classes of classes.json along the first axis, found 4"),
        (even(3, (24, 40)), "32x24 pixels .*, as its photo, found 40x24"),
        (even() * 1.5, "off 1 by up to 0.5"),
        (even() - 1, "negative or not finite"),
        (even() * np.float16("nan"), "negative or not finite"),
        (even()[0], r"found \(24, 32\) of float16"),
        (even().astype(np.uint8), r"found \(3, 24, 32\) of uint8"),
    ],
)  # fmt: skip
def test_bad_probabilities_are_refused_by_name(folder: Path, scene: Scene, values: np.ndarray, found: str):
    (folder / "images").mkdir()
    np.savez(folder / "images/000.npz", values)
    with pytest.raises(InputError, match=found):
        MapFiles.opened(folder, scene).of(scene.frames[0], SIZE)


def test_a_file_that_is_no_archive_of_one_array_is_refused(tmp_path: Path):
    (tmp_path / "a.npz").write_bytes(b"PK but no more")
    with pytest.raises(InputError, match="a zip archive"):
        read_probabilities(tmp_path / "a.npz")
    np.savez(tmp_path / "b.npz", even(), even())
    with pytest.raises(InputError, match=r"one array of probabilities .*found 2 arrays"):
        read_probabilities(tmp_path / "b.npz")


def test_objects_are_not_unpickled(tmp_path: Path):
    np.savez(tmp_path / "a.npz", np.array([{"a": 1}], dtype=object))
    with pytest.raises(InputError, match="an array of numbers"):
        read_probabilities(tmp_path / "a.npz")

"""Labelled images without cameras."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from image_sets import CLASSES, random_numbers, write_image_set

from semgs.data.origin.licences import terms_of
from semgs.data.scenes import open_scene, open_scenes
from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError

SIZES = {"b": (32, 48), "a": (48, 32), "c": (32, 40)}


@pytest.fixture
def numbers() -> dict[str, np.ndarray]:
    return {name: random_numbers(seed, size) for seed, (name, size) in enumerate(SIZES.items())}


def test_images_of_any_size_are_one_scene_in_the_order_of_their_names(tmp_path: Path, numbers: dict[str, np.ndarray]):
    scene = open_scene(write_image_set(tmp_path / "flats", numbers), needs_cameras=False)
    assert (scene.name, scene.layout, scene.posed, scene.classes) == ("flats", "labelled images", False, SCANNET20)
    assert [frame.name for frame in scene.frames] == ["images/a.png", "images/b.png", "images/c.png"]
    assert [frame.lens.size for frame in scene.frames] == [(48, 32), (32, 48), (32, 40)]
    assert scene.depth_range().near == 0.5  # images are not searched for points in common


def test_labels_are_the_classes_that_the_numbers_stand_for(tmp_path: Path, numbers: dict[str, np.ndarray]):
    scene = open_scene(write_image_set(tmp_path / "flats", numbers), needs_cameras=False)
    meaning = np.full(256, 255)
    meaning[[0, 1, 7]] = 0, 1, SCANNET20.index("cabinet")
    for index, name in enumerate("abc"):
        np.testing.assert_array_equal(scene.read([index], "native").labels[0], meaning[numbers[name]])


def test_a_number_without_a_meaning_is_an_error_that_names_the_image(tmp_path: Path, numbers: dict[str, np.ndarray]):
    numbers["b"][3, 5] = 77
    scene = open_scene(write_image_set(tmp_path / "flats", numbers), needs_cameras=False)
    with pytest.raises(InputError, match=r"b\.png: image b\.png: expected the numbers of table scannet20, found 77 at"):
        scene.read([1], "native")


def test_one_image_is_enough(tmp_path: Path):
    scene = open_scene(write_image_set(tmp_path / "one", {"x": random_numbers(0, (16, 24))}), needs_cameras=False)
    assert scene.read([0], "native").images.shape == (1, 3, 16, 24)


def test_without_cameras_it_is_no_scene_to_reconstruct(tmp_path: Path, numbers: dict[str, np.ndarray]):
    folder = write_image_set(tmp_path / "flats", numbers)
    for opened in (open_scene, open_scenes):
        with pytest.raises(InputError, match=r"images with cameras, found labelled images.*supervision pictures"):
            opened(folder)


@pytest.mark.parametrize(
    ("break_it", "told"),
    [
        (
            lambda folder: (folder / "labels/b.png").unlink(),
            r"labels/b\.png: expected the labels of b\.png, found no such",
        ),
        (lambda folder: [one.unlink() for one in (folder / "images").iterdir()], "images: expected images, found none"),
        (
            lambda folder: (folder / "images/b.png").rename(folder / "images/a.jpg"),
            "different names, found a, as a.jpg",
        ),
        (lambda folder: (folder / "classes.json").write_text("{"), r"classes\.json: .*JSON"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, numbers: dict[str, np.ndarray], break_it, told: str):
    folder = write_image_set(tmp_path / "flats", numbers)
    break_it(folder)
    with pytest.raises(InputError, match=told):
        open_scene(folder, needs_cameras=False)


def test_weights_repeat_the_terms_that_the_set_states(tmp_path: Path, numbers: dict[str, np.ndarray]):
    stated = write_image_set(tmp_path / "flats", numbers, CLASSES | {"terms": "CC BY 2.0, see sources.json"})
    silent = write_image_set(tmp_path / "rooms", numbers)
    assert terms_of(open_scene(stated, needs_cameras=False)).text == "flats: CC BY 2.0, see sources.json"
    assert "not known" in terms_of(open_scene(silent, needs_cameras=False)).text


def test_files_of_macos_beside_images_are_ignored(tmp_path: Path, numbers: dict[str, np.ndarray]):
    folder = write_image_set(tmp_path / "flats", numbers)
    for name in ("images/._a.png", "labels/._a.png", "images/._c.jpg"):
        (folder / name).write_bytes(b"\0\5\26\7Mac OS X")
    scene = open_scene(folder, needs_cameras=False)
    assert [frame.name for frame in scene.frames] == ["images/a.png", "images/b.png", "images/c.png"]

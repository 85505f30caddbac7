"""Class tables of one's own, in files."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
from test_transforms_json import DEPTHS, SIZE, with_maps

from semgs.data.scenes import open_scene
from semgs.data.tables.class_files import LIKE, LIKE_SCANNET20, read_class_file
from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs.files.errors import InputError

FIVE = {
    "name": "five",
    "classes": [
        {"name": "wall", "colour": [174, 199, 232], "ids": [1]},
        {"name": "seat", "colour": [188, 189, 34], "ids": [5, 6]},
    ],
    "ignored": [0],
}


def written(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content))
    return path


def test_numbers_mean_the_class_that_lists_them_or_nothing(tmp_path):
    found = read_class_file(written(tmp_path / "t.json", FIVE))
    assert (found.table.name, found.table.names, found.table.raw_ids) == ("five", ("wall", "seat"), (1, 5))
    assert found.table.colours[1] == (188, 189, 34)
    assert [found.meaning[number] for number in (0, 1, 5, 6, 255, 2)] == [255, 0, 1, 1, 255, None]


def test_without_numbers_classes_are_counted_from_0(tmp_path):
    content = {"classes": [{"name": name, "colour": [1, 2, 3]} for name in ("a", "b", "c")]}
    found = read_class_file(written(tmp_path / "mine.json", content))
    assert found.table.name == "mine"
    assert found.meaning[:4] == (0, 1, 2, None)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda t: t.pop("classes"), 'a list "classes"'),
        (lambda t: t.update(classes=[]), 'a list "classes"'),
        (lambda t: t.update(colour=3), "'colour'"),
        (lambda t: t["classes"].append("floor"), r"classes\[2\]: expected an object with a name"),
        (lambda t: t["classes"][0].update(colour=[1, 2]), r"classes\[0\]\.colour"),
        (lambda t: t["classes"][0].update(colour=[1, 2, 256]), r"classes\[0\]\.colour"),
        (lambda t: t["classes"][1].update(ids=[]), r"classes\[1\]\.ids"),
        (lambda t: t["classes"][1].pop("ids"), r"classes\[1\]\.ids"),
        (lambda t: t["classes"][1].update(ids=[1]), "found 1 twice"),
        (lambda t: t.update(ignored=[5]), "found 5 twice"),
        (lambda t: t["classes"][1].update(name="wall"), "has a class name twice"),
        (lambda t: t.update(ignored="0"), "ignored"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, change, told):
    table = json.loads(json.dumps(FIVE))
    change(table)
    with pytest.raises(InputError, match=told):
        read_class_file(written(tmp_path / "t.json", table))


MAPPED = {
    "classes": [
        {"id": 0, "name": "wall", "scannet20": "wall"},
        {"id": 20, "name": "dresser", "scannet20": "cabinet"},
        {"id": 23, "scannet20": None},
    ],
    "unknown": 99,
    "terms": "CC BY 2.0",
}


def test_a_file_may_say_which_of_scannets_classes_a_number_is(tmp_path):
    found = read_class_file(written(tmp_path / "t.json", MAPPED))
    assert found.table == SCANNET20
    assert [found.meaning[number] for number in (0, 20, 23, 99, 255, 1)] == [0, 2, 255, 255, 255, None]
    assert found.terms == "CC BY 2.0"
    assert read_class_file(written(tmp_path / "five.json", FIVE)).terms == ""
    assert read_class_file(written(tmp_path / "five.json", FIVE | {"terms": "ours"})).terms == "ours"


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda t: t.update(name="t", ignored=[1]), "'ignored'"),
        (lambda t: t.update(terms=3), "terms: expected text"),
        (lambda t: t.update(unknown=256), "unknown: expected a number from 0 to 255, found 256"),
        (lambda t: t.update(unknown="none"), "unknown"),
        (lambda t: t.update(unknown={}), r"unknown: expected a whole number, or a list of them, found {}"),
        (
            lambda t: t.update(unknown=20 * [list(range(9))]),
            r"unknown: expected a whole number, or a list of them, found .{60}$",
        ),
        (lambda t: t.update(unknown=20), r"classes\[1\]\.id: expected each number once, found 20 twice"),
        (lambda t: t["classes"].append({"id": 0, "scannet20": "door"}), r"classes\[3\]\.id: .*found 0 twice"),
        (lambda t: t["classes"].append({"id": 255, "scannet20": "door"}), r"classes\[3\]\.id: .*255, which always"),
        (lambda t: t["classes"].append({"id": -1, "scannet20": "door"}), r"classes\[3\]\.id: expected a number"),
        (lambda t: t["classes"].append({"id": 3, "scannet20": "ceiling"}), r"classes\[3\]\.scannet20: .*'ceiling'"),
        (
            lambda t: t["classes"].append({"id": 3, "name": "door"}),
            r"classes\[3\]: expected an object with id, scannet20",
        ),
    ],
)
def test_what_is_wrong_with_such_a_file_is_named(tmp_path, change, told):
    table = json.loads(json.dumps(MAPPED))
    change(table)
    with pytest.raises(InputError, match=told):
        read_class_file(written(tmp_path / "t.json", table))


def test_a_class_cannot_have_the_number_of_pixels_without_a_label(tmp_path):
    """Masks of 0 and 255, as Label Studio exports them."""
    rest = {"name": "rest", "colour": [9, 9, 9], "ids": [0]}
    table = {"classes": [rest, {"name": "furniture", "colour": [99, 9, 9], "ids": [255]}]}
    told = (
        r"classes\[1\]\.ids: expected numbers from 0 to 254, found 255, which always means no label; "
        "write another number into the masks and here"
    )
    with pytest.raises(InputError, match=told):
        read_class_file(written(tmp_path / "t.json", table))
    table["classes"][1]["ids"] = [1]
    found = read_class_file(written(tmp_path / "t.json", table | {"ignored": [255]}))
    assert [found.meaning[number] for number in (0, 1, 255, 2)] == [0, 1, 255, None]


def test_a_file_that_is_absent_or_no_json_is_refused(tmp_path):
    with pytest.raises(InputError, match="No such file"):
        read_class_file(tmp_path / "t.json")
    (tmp_path / "t.json").write_text("{")
    with pytest.raises(InputError, match="as JSON"):
        read_class_file(tmp_path / "t.json")


def test_a_scene_may_name_a_file_that_says_what_its_labels_mean(tmp_path):
    written(tmp_path / "five.json", FIVE)
    numbers = np.random.default_rng(1).choice(np.array([0, 1, 5, 6, 255], np.uint8), SIZE)
    scene = open_scene(with_maps(tmp_path / "scene", {"label_set": "../five.json"}, DEPTHS, numbers))
    assert scene.classes is not None
    assert scene.classes.names == ("wall", "seat")
    views = scene.read([0, 2], "native")
    expected = np.array([255, 0, 255, 255, 255, 1, 1] + 249 * [255])[numbers]
    np.testing.assert_array_equal(views.labels[1], expected)
    cv2.imwrite(str(tmp_path / "scene" / "l1.png"), np.where(numbers == 6, np.uint8(7), numbers))
    with pytest.raises(
        InputError, match=r"l1\.png: frame images/001\.png: expected the numbers of table five, found 7 at"
    ):
        scene.read([1], "native")


def test_a_scene_whose_table_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"five\.json"):
        open_scene(with_maps(tmp_path / "scene", {"label_set": "five.json"}, DEPTHS, np.zeros(SIZE, np.uint8)))


@pytest.mark.parametrize(("unknown", "ignored"), [(7, {7}), ([7], {7}), ([0, 255], {0}), ([7, 9], {7, 9}), ([], set())])
def test_several_numbers_may_mean_no_label(tmp_path: Path, unknown: object, ignored: set[int]):
    content = {"classes": [{"id": 1, "name": "wall", "scannet20": "wall"}], "unknown": unknown}
    (tmp_path / "classes.json").write_text(json.dumps(content))
    meaning = read_class_file(tmp_path / "classes.json").meaning
    assert {number for number, label in enumerate(meaning) if label == IGNORE} == {*ignored, IGNORE}
    assert meaning[1] == 0


@pytest.mark.parametrize("unknown", [[0, 256], "255", [True], {"a": 1}, [[0]]])
def test_what_means_no_label_is_a_number_or_a_list(tmp_path: Path, unknown: object):
    content = {"classes": [{"id": 1, "name": "wall", "scannet20": "wall"}], "unknown": unknown}
    (tmp_path / "classes.json").write_text(json.dumps(content))
    with pytest.raises(InputError, match="unknown: expected a whole number, or a list of them, found"):
        read_class_file(tmp_path / "classes.json")


@pytest.mark.parametrize(
    ("content", "key", "example"),
    [
        (["wall"], None, LIKE),
        ({"wall": 1}, None, LIKE),
        ({"classes": ["wall"]}, "classes[0]", LIKE),
        ({"classes": [{"name": "wall"}]}, "classes[0].colour", LIKE),
        ({"classes": [{"name": "wall", "color": [1, 2, 3]}]}, "classes[0]", LIKE),
        ({"classes": [{"name": "wall", "colour": [1, 2, 3], "ids": 1}]}, "classes[0].ids", LIKE),
        ({"classes": [{"name": "wall", "colour": [1, 2, 3]}], "ids": [1]}, None, LIKE),
        ({"classes": [{"name": "wall", "scannet20": "wall"}]}, "classes[0]", LIKE_SCANNET20),
    ],
)
def test_a_file_of_another_form_is_shown_one_that_can_be_read(
    tmp_path: Path, content: object, key: str | None, example: str
):
    """Whole, so that the next mistake need not be found by trying."""
    with pytest.raises(InputError) as told:
        read_class_file(written(tmp_path / "t.json", content))
    assert (told.value.key, told.value.advice) == (key, example)
    shown = json.loads(example.removeprefix("write the file like "))
    assert (
        read_class_file(written(tmp_path / "shown.json", shown)).meaning[shown["classes"][0].get("id", 1)] is not None
    )

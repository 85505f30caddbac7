"""Groups of classes, with numbers worked out by hand, and files that are none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from semgs.data.tables.class_groups import INCLUDED, class_groups
from semgs.data.tables.classes import SCANNET20
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.intervals import paired_differences
from semgs.evaluation.scoring.summary import summarise
from semgs.files.errors import InputError

NAMES = ("wall", "table", "floor", "desk")


def written(path: Path, content: object) -> str:
    path.write_text(json.dumps(content))
    return str(path)


def test_counts_of_merged_classes_are_added_and_others_stay(tmp_path: Path):
    groups = class_groups(written(tmp_path / "mine.json", {"groups": {"flat": ["table", "desk", "shelf"]}}), NAMES)
    assert (groups.name, groups.of, groups.names) == ("mine", (0, 1, 2, 1), ("wall", "flat", "floor"))
    assert groups.merged(np.array([1, 2, 3, 4])).tolist() == [1, 6, 3]
    confusion = np.arange(16).reshape(4, 4)
    assert groups.merged(confusion).tolist() == [[0, 1 + 3, 2], [4 + 12, 5 + 7 + 13 + 15, 6 + 14], [8, 9 + 11, 10]]


def test_a_desk_that_is_called_a_table_is_right_by_groups():
    """Of 10 table pixels 6 are called desk, of 10 wall pixels 5 floor: accuracy 9 of 20, by groups 15 of 20; IoU of walls 5/10, of tables 10/10."""
    confusion = np.zeros((4, 4), np.int64)
    confusion[0, 0], confusion[0, 2], confusion[1, 1], confusion[1, 3] = 5, 5, 4, 6
    frame = FrameScores("room", "1.png", ("0.png", "2.png"), confusion=confusion, truth=confusion.sum(1))
    found = summarise([frame.by_groups(class_groups("alike", NAMES))])
    assert found["accuracy"] == pytest.approx(9 / 20)
    assert found["miou"] == pytest.approx((5 / 10 + 4 / 10) / 2)
    assert found["accuracy_merged"] == pytest.approx(15 / 20)
    assert found["miou_merged"] == pytest.approx((5 / 10 + 10 / 10) / 2)
    assert "miou_merged" not in summarise([frame])


def test_differences_of_merged_metrics_have_intervals():
    def frames(right: int) -> list[FrameScores]:
        made = []
        for scene in range(6):
            confusion = np.diag([right + scene, 4, 0, 0])
            confusion[0, 2] = 20 - right
            one = FrameScores(f"{scene}", "1.png", ("0.png",), confusion=confusion, truth=confusion.sum(1))
            made.append(one.by_groups(class_groups("alike", NAMES)))
        return made

    difference = paired_differences(frames(10), frames(12))["accuracy_merged"]
    pixels = 6 * 24 + 15
    assert difference.value == pytest.approx(6 * 2 / pixels)
    assert difference.excludes_zero


@pytest.mark.parametrize("name", INCLUDED)
def test_included_groups_give_a_reason_for_each(name: str):
    import semgs.data.tables as tables

    content = json.loads((Path(tables.__file__).parent / "groups" / f"{name}.json").read_text())
    assert content["groups"].keys() == content["why"].keys()
    assert {one for members in content["groups"].values() for one in members} <= set(SCANNET20.names)


def test_the_included_groups_have_their_numbers():
    assert len(class_groups("coarse13", SCANNET20.names).names) == 13
    assert len(class_groups("alike", SCANNET20.names).names) == 20 - 2 - 1 - 1


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"groups": {"a": ["wall"], "b": ["wall"]}}, "expected wall in one group, found in a and b"),
        ({"groups": {"a": ["cup"]}}, "expected some of the classes wall, table, floor, desk, ..., found cup"),
        ({"groups": {"a": [3]}}, "expected names of classes, found 3"),
        ({"groups": ["wall"]}, "expected groups of classes as"),
        ([], "expected groups of classes as"),
    ],
)
def test_other_files_are_refused_in_one_line(content: object, said: str, tmp_path: Path):
    with pytest.raises(InputError, match=r"mine\.json") as caught:
        class_groups(written(tmp_path / "mine.json", content), NAMES)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)

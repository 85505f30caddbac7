"""Files that say what a segmenter's classes mean, and how much it votes."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import torch
from correspondences import write_correspondence
from scenes_on_disk import TABLE, write_labelled

from semgs.data.scenes import open_scene
from semgs.files.errors import InputError
from semgs.geometry.fusion import LEAST
from semgs.segmenters.labelling import ClassVotes, weigh
from semgs.segmenters.opening import open_class_sources, read_correspondence
from semgs.segmenters.tables import make_class_table

TWO = make_class_table("two", ("a", "b"))


def test_weighed_votes_by_hand():
    votes = ClassVotes((0.5, 1.0), (1.0, 2.0), (0.0, 0.3))
    theirs, own = (torch.tensor(one).double()[:, None, None] for one in ([0.8, 0.2], [0.4, 0.6]))
    a = math.sqrt(0.8 + LEAST) * (0.4 + LEAST)
    b = (0.2 + LEAST) * (0.6 + LEAST) ** 2 * math.exp(0.3)
    torch.testing.assert_close(weigh(theirs, own, votes).flatten(), torch.tensor([a, b]).double() / (a + b))


def test_a_file_is_read_as_it_was_written(tmp_path: Path):
    table = [[0.25, 0.75], [0, 0]]
    votes = {"theirs": [1.0, 0.0], "own": [0.5, 2.0], "bias": [0.0, -0.1]}
    path = write_correspondence(tmp_path / "meaning.json", ("sofa", "lamp"), table, classes=TWO, votes=votes)
    found = read_correspondence(path)
    assert (found.segmenter, found.theirs) == ("net", ("sofa", "lamp"))
    assert found.votes == ClassVotes((1.0, 0.0), (0.5, 2.0), (0.0, -0.1))
    assert found.correspondence.table.tolist() == table
    assert found.correspondence.classes == TWO


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("format", "other", "another file"),
        ("version", 2, "another file"),
        ("table", [[0.5, 0.5]], r"table is \(1, 2\)"),
        ("table", [[0.5, -0.5], [0, 0]], "table is"),
        ("theirs", ["one"], "table is"),
        ("votes", {"theirs": [1], "own": [1], "bias": [1]}, "votes are not of 2 classes"),
        ("votes", {"theirs": [1, 1]}, "TypeError"),
        ("classes", {}, "name: missing"),
    ],
)
def test_a_damaged_file_is_refused(tmp_path: Path, key: str, value: object, told: str):
    path = write_correspondence(tmp_path / "meaning.json", ("sofa", "lamp"), np.eye(2), classes=TWO)
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(InputError, match=told):
        read_correspondence(path)


def test_a_file_for_another_segmenter_is_refused(tmp_path: Path):
    scene = open_scene(write_labelled(tmp_path / "scene", 5))
    folder = tmp_path / "maps"
    folder.mkdir()
    (folder / "classes.json").write_text(json.dumps(TABLE))
    other = write_correspondence(tmp_path / "other.json", ("sofa", "lamp"), np.eye(2), classes=TWO)
    with pytest.raises(InputError, match="the classes that net has in the correspondence, found others"):
        open_class_sources(str(folder), correspondence=other)(scene)
    names = tuple(one["name"] for one in TABLE["classes"])
    own = write_correspondence(tmp_path / "own.json", names, np.eye(3, 2), classes=TWO)
    assert open_class_sources(str(folder), correspondence=own)(scene).classes == TWO

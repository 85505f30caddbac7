"""What a segmenter's classes mean, and how much it votes, learnt on labelled scenes."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import torch
from scenes_on_disk import SIZE, TABLE, write_labelled

from semgs.data.scenes import open_scene
from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs.files.errors import InputError
from semgs.geometry.fusion import LEAST
from semgs.segmenters.fitting import (
    Fit,
    count_pairs,
    fit_correspondence,
    fit_votes,
    make_correspondence,
    read_fit,
    sample_pixels,
    save_fit,
)
from semgs.segmenters.labelling import ClassVotes, weigh
from semgs.segmenters.names import Correspondence
from semgs.segmenters.opening import open_class_sources
from semgs.segmenters.photo_maps import one_hot
from semgs.segmenters.tables import make_class_table

TWO = make_class_table("two", ("a", "b"))


class Shifted:
    """A source that says the label after the true one, of the labels 0, 1 and 4, at 0.8."""

    classes = make_class_table("three", ("x", "y", "z"))
    title = "shifted"
    made_by = None
    known = np.ones(3, bool)

    def of(self, frame, size, fit="crop"):
        labels = frame.view((0.1, 10.0), SCANNET20, size=size, fit="crop").labels[0]
        said = torch.zeros(size, dtype=torch.uint8)
        for place, label in enumerate((0, 1, 4)):
            said[labels == label] = (place + 1) % 3
        return 0.7 * one_hot(said, 3) + 0.1


def test_the_class_frequency_is_divided_out_by_its_root():
    """Six and four tenths of all pixels: 6 / 0.6 ** 0.5 = 7.746 and 2 / 0.4 ** 0.5 = 3.162, so the first row is 0.710 and 0.290."""
    found = make_correspondence(np.array([[6.0, 2.0], [0.0, 2.0], [0.0, 0.0]]), TWO).table
    first = 6 / math.sqrt(0.6), 2 / math.sqrt(0.4)
    np.testing.assert_allclose(found[0], np.array(first) / sum(first), rtol=1e-6)
    assert found[0].round(3).tolist() == pytest.approx([0.710, 0.290])
    assert found[1:].tolist() == [[0, 1], [0, 0]]


def test_a_segmenter_that_calls_things_by_other_names_is_understood(tmp_path: Path):
    scene = open_scene(write_labelled(tmp_path / "scene", 3))
    found = fit_correspondence(lambda scene: Shifted(), [scene], lambda scene: ([0, 2], scene.read([0, 2], SIZE)))
    assert found.table.argmax(1).tolist() == [4, 0, 1]
    counted = count_pairs(Shifted(), scene, scene.read([0], SIZE), [0], 20)
    labels = scene.read([0], SIZE).labels
    assert counted[1, 0] == pytest.approx(0.8 * int((labels == 0).sum()), rel=1e-6)
    assert counted[2, 0] == pytest.approx(0.1 * int((labels == 0).sum()), rel=1e-6)
    assert counted.sum() == pytest.approx(int((labels != IGNORE).sum()), rel=1e-6)


def test_maps_with_other_classes_for_another_scene_are_not_counted_as_the_same(tmp_path: Path):
    scenes = [open_scene(write_labelled(tmp_path / name, 3)) for name in ("first", "second")]
    other = Shifted()
    other.classes = make_class_table(
        "three", ("y", "x", "z")
    )  # in another order, so that the numbers would be added wrongly
    with pytest.raises(InputError, match="expected the classes of the maps of first, found others for second"):
        fit_correspondence(
            lambda scene: other if scene.name == "second" else Shifted(),
            scenes,
            lambda scene: ([0], scene.read([0], SIZE)),
        )


def test_votes_go_to_the_one_that_is_right():
    """The network is right in nine of ten pixels and says so; the segmenter is as sure and says anything."""
    generator = torch.Generator().manual_seed(1)
    labels = torch.randint(0, 3, (20_000,), generator=generator).to(torch.uint8)
    wrong = torch.rand(20_000, generator=generator) < 0.1
    thought = torch.where(wrong, (labels + 1) % 3, labels)
    said = torch.randint(0, 3, (20_000,), generator=generator).to(torch.uint8)
    own, theirs = (0.85 * one_hot(one[None], 3)[:, 0] + 0.05 for one in (thought, said))
    votes = fit_votes([(theirs, own, labels)], 3)
    assert max(map(abs, votes.theirs)) < 0.1
    assert min(votes.own) > 0.8


def test_weighed_votes_by_hand():
    votes = ClassVotes((0.5, 1.0), (1.0, 2.0), (0.0, 0.3))
    theirs, own = (torch.tensor(one).double()[:, None, None] for one in ([0.8, 0.2], [0.4, 0.6]))
    a = math.sqrt(0.8 + LEAST) * (0.4 + LEAST)
    b = (0.2 + LEAST) * (0.6 + LEAST) ** 2 * math.exp(0.3)
    torch.testing.assert_close(weigh(theirs, own, votes).flatten(), torch.tensor([a, b]).double() / (a + b))


def test_a_sample_is_of_labelled_pixels_and_keeps_them_together(tmp_path: Path):
    views = open_scene(write_labelled(tmp_path / "scene", 4)).read([0, 1], SIZE)
    labels = views.labels.clone()
    labels[1, :, 20:] = IGNORE
    maps = torch.stack([one_hot(one, 20) for one in labels])
    theirs, own, found = sample_pixels(views.changed(labels=labels), maps, 1 - maps)
    assert len(found) == 24 * 32 + 24 * 20
    assert theirs.argmax(0).tolist() == found.tolist()
    torch.testing.assert_close(own, 1 - theirs)


def test_a_fit_is_written_and_read_again(tmp_path: Path):
    table = np.array([[0.25, 0.75], [0, 0]], np.float32)
    fitted = Fit("net", ("sofa", "lamp"), Correspondence(table, TWO), ClassVotes((1.0, 0.0), (0.5, 2.0), (0.0, -0.1)))
    save_fit(tmp_path / "fit.json", fitted)
    found = read_fit(tmp_path / "fit.json")
    assert (found.segmenter, found.theirs, found.votes) == (fitted.segmenter, fitted.theirs, fitted.votes)
    assert found.correspondence.table.tolist() == table.tolist()
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
def test_a_damaged_fit_is_refused(tmp_path: Path, key: str, value: object, told: str):
    path = tmp_path / "fit.json"
    save_fit(path, Fit("net", ("sofa", "lamp"), Correspondence(np.eye(2, dtype=np.float32), TWO)))
    path.write_text(json.dumps(json.loads(path.read_text()) | {key: value}))
    with pytest.raises(InputError, match=told):
        read_fit(path)


def test_a_fit_of_another_segmenter_is_refused(tmp_path: Path):
    scene = open_scene(write_labelled(tmp_path / "scene", 5))
    folder = tmp_path / "maps"
    folder.mkdir()
    (folder / "classes.json").write_text(json.dumps(TABLE))
    save_fit(tmp_path / "fit.json", Fit("net", ("sofa", "lamp"), Correspondence(np.eye(2, dtype=np.float32), TWO)))
    with pytest.raises(InputError, match="the classes that net has in the fit, found others"):
        open_class_sources(str(folder), correspondence=tmp_path / "fit.json")(scene)
    names = tuple(one["name"] for one in TABLE["classes"])
    save_fit(tmp_path / "own.json", Fit("maps", names, Correspondence(np.eye(3, 2, dtype=np.float32), TWO)))
    assert open_class_sources(str(folder), correspondence=tmp_path / "own.json")(scene).classes == TWO

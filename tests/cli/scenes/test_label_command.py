"""`semgs label`: what it writes, says and refuses."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import tiny_models
from correspondences import write_correspondence
from scenes_on_disk import write_labelled

from semgs.cli.main import main
from semgs.data.scenes import open_scene

NAMES = ("wall", "mug")


@pytest.fixture
def scans(tmp_path: Path) -> Path:
    for seed, name in enumerate(("attic", "bath")):
        write_labelled(tmp_path / "scans" / name, seed, frames=3)
    return tmp_path / "scans"


@pytest.fixture
def maps(tmp_path: Path) -> Path:
    """Probabilities of two classes for both scenes; the upper half is a wall by 0.8, the lower half a mug by 0.6."""
    folder = tmp_path / "maps"
    found = np.empty((2, 12, 16), np.float16)
    found[0, :6], found[0, 6:] = 0.8, 0.4
    found[1] = 1 - found[0]
    for scene in ("attic", "bath"):
        (folder / scene / "images").mkdir(parents=True)
        for frame in range(3):
            np.savez(folder / scene / "images" / f"{frame:03d}.npz", found)
    (folder / "classes.json").write_text(json.dumps({"name": "few", "classes": [{"name": one, "colour": [1, 2, 3]} for one in NAMES]}))  # fmt: skip
    (folder / "segmenter.json").write_text(json.dumps({"name": "net.onnx", "digest": "1a", "licence": "MIT"}))
    return folder


def label(*arguments: object) -> int:
    """Run the command at the scenes' size; its exit code."""
    return main(["label", *map(str, arguments), "--size", "48x64"])


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The line that a command line is refused with."""
    assert label(*arguments) == 2
    shown = capsys.readouterr()
    assert (shown.out, shown.err.count("\n")) == ("", 1)
    return shown.err


def test_scenes_get_the_segmenters_labels_and_the_command_that_learns_from_them(
    scans: Path, maps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "out"
    assert label(scans, "--out", out, "--segmenter", maps, "--confidence", "0.65", "--classes", "own") == 0
    shown = capsys.readouterr()
    assert shown.err == ""
    assert f"{out}: 2 scenes, 6 frames" in shown.out
    assert "50.0% of the pixels have a label: one class is at least 65% likely" in shown.out
    assert f"semgs train small --init small --data {out} --classes {out / 'classes.json'} --out RUN" in shown.out
    scene = open_scene(out / "bath.zip")
    labels = scene.read([2], "native").labels
    assert labels is not None
    assert labels[0, :24].unique().tolist() == [0]
    assert labels[0, 24:].unique().tolist() == [255]
    assert scene.classes is not None
    assert scene.classes.names == NAMES
    assert label(scans, out, "--segmenter", maps, "--confidence", "0.65", "--classes", "own") == 0, "nothing to resume"


def test_names_that_are_unknown_are_counted(
    scans: Path, maps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    (maps / "attic/images/001.npz").unlink()
    renamed = {"name": "few", "classes": [{"name": one, "colour": [1, 2, 3]} for one in ("wall", "gizmo")]}
    (maps / "classes.json").write_text(json.dumps(renamed))
    assert label(scans, tmp_path / "out", "--segmenter", maps) == 0
    shown = capsys.readouterr().out
    assert "left out: attic" in shown
    assert "1 of the 2 class names of " in shown
    assert "made by net.onnx (licence MIT) are unknown, so they say nothing about the scene's classes: gizmo." in shown


def test_a_correspondence_says_what_the_classes_mean(scans: Path, maps: Path, tmp_path: Path):
    table = np.zeros((2, 20), np.float32)
    table[0, [1, 4]], table[1, 4] = (0.9, 0.1), 1
    meaning = write_correspondence(tmp_path / "meaning.json", NAMES, table)
    out, options = tmp_path / "out", ("--confidence", "0.65", "--correspondence", meaning)
    assert label(scans, out, "--segmenter", maps, *options) == 0
    scene = open_scene(out / "attic.zip")
    labels = scene.read([1], "native").labels
    assert labels is not None
    assert labels[0, :20].unique().tolist() == [1], "floor by 0.9 of 0.8; the rows in between are blends"
    assert labels[0, 28:].unique().tolist() == [255], "chair by 0.1 of 0.4 and all of 0.6"
    assert label(scans, tmp_path / "other", "--segmenter", maps, "--confidence", "0.63", *options[2:]) == 0
    labels = open_scene(tmp_path / "other" / "attic.zip").read([1], "native").labels
    assert labels is not None
    assert labels[0, 28:].unique().tolist() == [4]


def test_words_make_the_classes_of_the_labels(scans: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    tiny_models.write_model(tmp_path / "clipseg", "clipseg")
    options = ("--segmenter", tmp_path / "clipseg", "--words", "mug", "power socket", "--confidence", "0")
    assert label(scans / "bath", tmp_path / "out", *options) == 0
    assert f"--classes {tmp_path / 'out' / 'classes.json'}" in capsys.readouterr().out
    scene = open_scene(tmp_path / "out" / "bath.zip")
    assert scene.classes is not None
    assert scene.classes.names == ("mug", "power socket", "none of these")


def test_one_scene_may_have_its_maps_in_the_folder_itself(scans: Path, maps: Path, tmp_path: Path):
    for name in ("classes.json", "segmenter.json"):
        shutil.copy(maps / name, maps / "bath")
    assert label(scans / "bath", tmp_path / "one", "--segmenter", maps / "bath") == 0
    assert label(scans / "bath", tmp_path / "two", "--segmenter", maps) == 0
    first, second = (open_scene(tmp_path / name / "bath.zip").read([0, 1]).labels for name in ("one", "two"))
    assert first is not None
    assert second is not None
    assert (first == second).all()


def test_a_scene_without_maps_is_left_out_and_named(
    scans: Path, maps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    shutil.rmtree(maps / "bath")
    (maps / "attic" / "images" / "001.npz").unlink()
    line = refused(capsys, scans, tmp_path / "out", "--segmenter", maps)
    assert (
        f"{maps / 'attic'}: expected a map of frame images/001.jpg: images/001.png or images/001.npz, found none"
        in line
    )
    np.savez(maps / "attic" / "images" / "001.npz", np.full((2, 12, 16), 0.5, np.float32))
    assert label(scans, tmp_path / "new", "--segmenter", maps) == 0
    assert (
        f"left out: bath: {maps / 'bath'}: expected a folder with the class maps of scene bath, found none"
        in capsys.readouterr().out
    )


def test_what_cannot_be_is_refused_and_nothing_is_written(
    scans: Path, maps: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "out"
    assert "--segmenter" in refused(capsys, scans, out)
    assert "--confidence: expected a number from 0 to 1, found '1.5'" in refused(capsys, scans, out, "--segmenter", maps, "--confidence", "1.5")  # fmt: skip
    assert "expected a segmenter" in refused(capsys, scans, out, "--segmenter", tmp_path / "nowhere")
    with_words = refused(capsys, scans, out, "--segmenter", maps, "--words", "mug")
    assert "expected a text-prompted model for --words, such as CLIPSeg" in with_words
    both = refused(capsys, scans, out, "--segmenter", maps, "--words", "mug", "--classes", "scannet20")
    assert "--classes scannet20 cannot go with --words" in both
    assert "nothing there" in refused(capsys, tmp_path / "nowhere", out, "--segmenter", maps)
    (maps / "classes.json").write_text('{"classes": []}')
    assert 'classes.json: expected an object with a list "classes"' in refused(capsys, scans, out, "--segmenter", maps)
    (maps / "classes.json").write_text(
        json.dumps({"classes": [{"name": one, "colour": [1, 2, 3]} for one in ("zig", "zag")]})
    )
    line = refused(capsys, scans, out, "--segmenter", maps, "--classes", "scannet20")
    assert "2 of 2 class names are unknown (zig, zag)" in line
    assert not out.exists()

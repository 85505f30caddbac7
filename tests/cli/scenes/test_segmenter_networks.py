"""`semgs reconstruct --segmenter` with networks: exported ones, and models that words describe the classes of."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import onnx_writer
import pytest
import tiny_models

import semgs
from semgs.cli.main import main
from semgs.segmenters.exported import Exported


@pytest.fixture
def network(tmp_path: Path) -> Path:
    """Says floor where red is stronger than green, else chair."""
    path = tmp_path / "net.onnx"
    weight = np.array([[20.0, 0, 0], [0, 20, 0]])
    onnx_writer.write_pixelwise(
        path, weight, np.zeros(2), shape=(1, 3, "height", "width"), outputs={"logits": "float32"}
    )
    return described(path)


def described(path: Path, **changed: Any) -> Path:
    """The same network with its description."""
    content = {
        "size": "any", "scaling": {"offset": 0, "scale": 255}, "layout": "NCHW", "dtype": "float32", "classes": ["floor", "chair"],
        "output": "logits", "licence": "MIT",
    }  # fmt: skip
    path.with_suffix(".json").write_text(json.dumps(content | changed))
    return path


def command(room: Path, out: Path, *options: str) -> list[str]:
    """A small reconstruction with random weights."""
    return [
        "reconstruct", str(room), "--out", str(out), "--context", "0", "3", "--size", "32x48", "--weights", "random", *options,
    ]  # fmt: skip


@pytest.mark.long
def test_a_second_run_takes_the_maps_of_the_first(
    room: Path, network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    sizes, titles = [], []
    answer = Exported.__call__

    def counted(self: Exported, image: np.ndarray) -> np.ndarray:
        sizes.append(image.shape[:2])
        return answer(self, image)

    @contextmanager
    def shown(title: str) -> Iterator[None]:
        titles.append(title)
        yield

    monkeypatch.setattr(Exported, "__call__", counted)
    monkeypatch.setattr("semgs.cli.progress.Terminal.stage", staticmethod(shown))
    out = tmp_path / "out"
    run = command(room, out, "--segmenter", str(network))

    assert main(run) == 0
    assert sizes == [(48, 64)] * 3, "a grey image, which is timed, and two photos"
    (title,) = [title for title in titles if title.startswith("Classes of 2 photos from net.onnx (licence MIT)")]
    assert ": about 0." in title
    assert "MB more memory" in title
    assert "classes   net.onnx (licence MIT); fused over the input views" in capsys.readouterr().out
    first = semgs.load_scene(out / "scene.safetensors")
    assert first.classes is not None
    assert first.classes.name == "scannet20"
    assert first.model == "small, classes from net.onnx (licence MIT); fused over the input views"
    page = (out / "report.html").read_text()
    assert "Classes: net.onnx (licence MIT); fused over the input views." in page
    assert 'href="segmenter/"' in page
    saved = {path.name for path in (out / "segmenter").rglob("*") if path.is_file()}
    assert saved == {"000.npz", "003.npz", "classes.json", "segmenter.json"}

    sizes.clear(), titles.clear()
    assert main([*run, "--overwrite"]) == 0
    assert sizes == []
    assert "Classes of 2 photos from net.onnx (licence MIT)" in titles
    again = semgs.load_scene(out / "scene.safetensors")
    assert first.gaussians.semantic is not None
    assert again.gaussians.semantic is not None
    assert (first.gaussians.semantic.features - again.gaussians.semantic.features).abs().max() < 2e-3


def test_words_make_the_classes_of_a_scene(room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder, out = tmp_path / "clipseg", tmp_path / "out"
    tiny_models.write_model(folder, "clipseg")
    (folder / "README.md").write_text("---\nlicense: apache-2.0\n---\n")
    assert main(command(room, out, "--segmenter", str(folder), "--words", "mug", "power socket")) == 0
    assert "clipseg (licence apache-2.0)" in capsys.readouterr().out
    scene = semgs.load_scene(out / "scene.safetensors")
    assert scene.classes is not None
    assert scene.classes.names == ("mug", "power socket", "none of these")
    assert {one["name"] for one in json.loads((out / "report.json").read_text())["classes"]} <= set(scene.classes.names)
    assert "none of these" in (out / "report.html").read_text()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--words", "mug"], "--words is for --segmenter"),
        (["--segmenter", "hf:a/b", "--words", "mug", " "], "--words: expected words, found an empty one"),
        (["--segmenter", "hf:a/b", "--words", "mug", "Mug"], "--words: expected different words, found 'mug' twice"),
        (["--segmenter", "hf:a/b", "--words", "mug", "--classes", "scannet20"], "--classes scannet20 cannot go with --words"),
        (["--segmenter", "hf:a/b", "--words", "mug", "--with-own-classes"], "--words cannot go with --with-own-classes"),
        (["--segmenter", "NETWORK", "--words", "mug"], "net.onnx: expected a text-prompted model for --words, such as CLIPSeg, found something else"),
        (["--segmenter", "hf:a"], "hf:a: expected hf:OWNER/NAME, optionally followed by @REVISION, found something else"),
    ],
)  # fmt: skip
def test_words_that_do_not_fit_end_with_one_line(
    room: Path, network: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: list[str], told: str
):
    options = [str(network) if option == "NETWORK" else option for option in options]
    assert main(command(room, tmp_path / "out", *options)) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert told in line
    assert not (tmp_path / "out").exists()


def test_an_answer_outside_the_table_ends_with_one_line_and_nothing_is_written(
    room: Path, network: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    described(network, classes=["floor", "chair", "table"])
    assert main(command(room, tmp_path / "out", "--segmenter", str(network))) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert (
        "net.onnx: expected logits that fit net.json, found shape (1, 2, 48, 64) instead of one image with 3 classes"
        in line
    )
    assert not (tmp_path / "out").exists()


def test_unknown_class_names_are_counted_in_a_note(
    room: Path, network: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "out"
    described(network, classes=["floor", "gizmo"])
    assert main(command(room, out, "--segmenter", str(network))) == 0
    note = "1 of the 2 class names of net.onnx (licence MIT) are unknown, so they say nothing about the scene's classes: gizmo."
    assert f"note      {note}" in capsys.readouterr().out
    assert note in json.loads((out / "report.json").read_text())["notes"]
    assert main([*command(room, out, "--segmenter", str(network)), "--classes", "own", "--overwrite"]) == 0
    assert "unknown, so they" not in capsys.readouterr().out

"""The two published networks for ADE20K's 31 most frequent classes, on real photos and on a house with true labels."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import semgs
from semgs.cli.main import main
from semgs.data.scenes import open_scene
from semgs.segmenters.opening import open_network, open_segmenter

NAMES = (
    "background", "wall", "building", "sky", "floor", "tree", "ceiling", "road", "bed", "window", "grass", "cabinet", "sidewalk",
    "person", "earth", "door", "table", "mountain", "plant", "curtain", "chair", "car", "water", "painting", "sofa", "shelf", "house",
    "sea", "mirror", "rug", "field", "armchair",
)  # fmt: skip
LOGITS = {"mosaic_ade32": "decoder/add", "deeplabv3plus_ade32": "logits/semantic/BiasAdd"}
"""The inner tensor with the logits of each network, which ends in an argmax."""

pytestmark = [pytest.mark.long, pytest.mark.parametrize("name", LOGITS)]


def beside(shared: Path, folder: Path, name: str, **changed: Any) -> Path:
    """A link to a network, and its description."""
    pytest.importorskip("ai_edge_litert", reason="LiteRT files need the extra [litert]")
    path = folder / f"{name}.tflite"
    if not path.exists():
        path.symlink_to(shared / "pretrained" / path.name)
    content = {
        "size": [512, 512], "scaling": {"offset": 0, "scale": 1}, "layout": "NHWC", "dtype": "uint8", "classes": NAMES,
        "output": "logits", "tensor": LOGITS[name], "licence": "Apache-2.0",
    } | changed  # fmt: skip
    kept = {key: value for key, value in content.items() if value is not None}
    path.with_suffix(".json").write_text(json.dumps(kept))
    return path


def test_the_logits_lead_to_the_class_numbers(shared: Path, tmp_path: Path, name: str):
    """Up to rounding: the network interpolates logits that it has rounded to 8 bits."""
    image = open_scene(shared / "data/hololens_office").frames[0].read_undistorted()
    soft = open_network(beside(shared, tmp_path, name))(image)
    hard = open_network(beside(shared, tmp_path, name, output="class numbers", tensor=None))(image)
    assert soft.shape == (32, 128, 128)
    assert hard.shape == (32, 512, 512)
    places = np.arange(128) * 4 + 2
    assert (soft.argmax(0) == hard.argmax(0)[places][:, places]).mean() > 0.9
    assert soft[0].mean() < 0.05, "the network was trained never to answer background"


def test_single_views_of_a_house_score_as_published_with_the_files(shared: Path, tmp_path: Path, name: str):
    """mIoU and accuracy on all pictures are .333 / .775 for MOSAIC and .268 / .716 for DeepLabv3+."""
    opened = open_segmenter(beside(shared, tmp_path, name))
    counts = np.zeros((20, 20))
    for part in ("dining", "kitchen", "living"):
        scene = open_scene(shared / "data/small_house" / part)
        source = opened.source(scene)
        for position in range(0, len(scene), 4):
            found = source.of(scene.frames[position], (240, 320)).argmax(0).numpy()
            labels = scene.read((position,), (240, 320)).labels[0].numpy()
            np.add.at(counts, (labels[labels < 20], found[labels < 20]), 1)
    right = np.diag(counts)
    union = counts.sum(0) + counts.sum(1) - right
    score, accuracy = (right / union.clip(1))[counts.sum(1) > 0].mean(), right.sum() / counts.sum()
    expected = {"mosaic_ade32": (0.333, 0.775), "deeplabv3plus_ade32": (0.268, 0.716)}[name]
    assert abs(score - expected[0]) < 0.03
    assert abs(accuracy - expected[1]) < 0.03


def test_a_real_scene_gets_its_classes(shared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str):
    """The first two photos show a table with chairs around it, on a wooden floor."""
    out = tmp_path / "out"
    path = beside(shared, tmp_path, name)
    office = [
        "reconstruct",
        str(shared / "data/hololens_office"),
        "--out",
        str(out),
        "--context",
        "0",
        "1",
        "--refine",
        "0",
    ]
    assert main([*office, "--segmenter", str(path)]) == 0
    told = capsys.readouterr()
    assert f"classes   {name}.tflite (licence Apache-2.0); fused over the input views" in told.out
    assert "XNNPACK" not in told.err
    scene = semgs.load_scene(out / "scene.safetensors")
    assert scene.classes is not None
    assert scene.gaussians.semantic is not None
    found = scene.gaussians.semantic.features.argmax(-1).flatten()
    shares = np.bincount(found.numpy(), minlength=20) / len(found)
    assert shares[scene.classes.index("table")] > 0.4
    assert shares[scene.classes.index("chair")] > 0.05
    assert shares[scene.classes.index("floor")] > 0.05


def test_a_student_of_a_network_names_its_teacher(
    shared: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
):
    path, taught, run = beside(shared, tmp_path, name), str(tmp_path / "taught"), tmp_path / "run"
    office = str(shared / "data/hololens_office")
    assert main(["label", office, taught, "--segmenter", str(path), "--size", "96x128", "--every", "2"]) == 0
    share = float(re.search(r"([\d.]+)% of the pixels have a label", capsys.readouterr().out)[1])
    assert 50 < share < 95
    command = ["train", "small", "--init", "small", "--data", taught, "--out", str(run), "--steps", "1", "--batch", "1"]
    assert main(command) == 0
    capsys.readouterr()
    assert main(["weights", str(run / "weights.safetensors")]) == 0
    assert f"labels by {name}.tflite (licence Apache-2.0)" in capsys.readouterr().out

from __future__ import annotations

import io
import json
import re
import shutil
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest
import torch
from ply import read_ply

import semgs
from semgs.cli.main import main
from semgs.geometry.cameras import inverse_rigid
from semgs.geometry.gaussians import move_cameras
from semgs.model.weights.load import load
from semgs.model.weights.weights_file import save
from semgs.rendering.render import render
from semgs.run.options.segmenter_options import SegmenterOptions
from semgs.run.reconstruct import Reconstruct
from semgs.runtime.stopwatch import COMPILE

BINARIES = ("gaussians.ply", "semantics.ply", "scene.safetensors")
OUTPUTS = {
    ".semgs", "export.json", "gaussians.ply", "semantics.ply", "scene.safetensors", "renders", "report.html", "report.json",
}  # fmt: skip


@pytest.fixture(scope="module")
def done(room: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The folder of a run with untrained weights, and what it said; not to be changed."""
    out = tmp_path_factory.mktemp("done") / "out" / "room"
    told, errors = io.StringIO(), io.StringIO()
    with redirect_stdout(told), redirect_stderr(errors):
        assert main(["reconstruct", str(room), "--out", str(out), "--weights", "random", "--context", "0", "3"]) == 0
    assert errors.getvalue() == ""
    return out, told.getvalue()


def test_all_files_appear_and_the_summary_tells_what_was_done(done: tuple[Path, str]) -> None:
    out, told = done
    assert {path.name for path in out.iterdir()} == OUTPUTS
    assert [path.name for path in out.parent.iterdir()] == ["room"]
    numbers = json.loads((out / "report.json").read_text())
    assert numbers["choice"]["context"] == [0, 3]
    assert numbers["choice"]["targets"] == [2], "frame 1 decided when refining stopped"
    assert (numbers["refinement"]["passes"], numbers["refinement"]["check"]) == (15, "images/001.png")
    stages = [name for name in numbers["seconds"] if name != COMPILE]
    assert stages == [
        "choose",
        "check",
        "refine",
        "load",
        "read",
        "encode",
        "expose",
        "sharpen",
        "render",
        "write",
    ]  # smooth pictures have no matches that fit
    for part in (
        "0 (images/000.png), 3 (images/003.png)", numbers["choice"]["reason"], "PSNR", "encode", "random",
        str(out / "gaussians.ply"), f"Open {out / 'report.html'} in a browser.",
    ):  # fmt: skip
        assert part in told, part
    assert len(list((out / "renders").glob("target_002_*.png"))) == 9
    report = (out / "report.html").read_text()
    assert "untrained" in report
    assert numbers["model"]["looks"] == 2
    assert ", two looks at each photo" in report


@pytest.mark.parametrize(
    ("options", "looks"),
    [
        ({}, 2),
        ({"refine": 30}, 2),
        ({"looks": 1}, 1),
        ({"refine": 0}, 1),
        ({"refine": 0, "looks": 2}, 2),
        ({"segmenting": SegmenterOptions("maps")}, 1),
        ({"segmenting": SegmenterOptions("maps", with_own_classes=True)}, 2),
        ({"model": "small_plain"}, 1),
        ({"model": "mvsplat"}, 1),
    ],
)
def test_photos_are_looked_at_twice_if_nothing_else_was_asked(options: dict, looks: int) -> None:
    given = Reconstruct(Path("room"), Path("out"), weights="random", **options)
    assert given.load_network("cpu").looks == looks


def test_a_network_whose_classes_depend_on_the_cameras_cannot_look_twice(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--model", "small_plain", "--weights", "random", "--looks", "2"]
    assert main(["reconstruct", str(room), "--out", str(tmp_path / "out"), *arguments]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        "semgs: error: looks is 2; expected 1, as small_plain has no classes that depend on single views alone"
    )
    assert not (tmp_path / "out").exists()


def test_labels_of_another_version_do_not_stop_a_reconstruction(scene: Path, tmp_path: Path) -> None:
    file = scene / "transforms.json"
    described = json.loads(file.read_text()) | {"label_set": "scannet20_v3"}
    described["frames"][0]["label_file_path"] = "images/000.png"
    file.write_text(json.dumps(described))
    out = tmp_path / "out"
    assert main(["reconstruct", str(scene), "--out", str(out), "--weights", "random", "--context", "0", "1"]) == 0
    told = [note for note in json.loads((out / "report.json").read_text())["notes"] if "labels are left out" in note]
    assert len(told) == 1
    assert "scannet20_v3" in told[0]
    assert main(["evaluate", "random", "--data", str(scene), "--out", str(tmp_path / "eval")]) == 2


def test_the_ply_seen_from_the_cameras_that_its_matrix_gives_looks_like_the_scene(done: tuple[Path, str]) -> None:
    out, _ = done
    scene = semgs.load_scene(out)
    (matrix,) = {json.dumps(file["scene_from_file"]) for file in json.loads((out / "export.json").read_text())["files"]}
    cameras = move_cameras(inverse_rigid(torch.tensor(json.loads(matrix), dtype=torch.float64)), scene.cameras)
    assert (cameras.centres - scene.cameras.centres).norm(dim=-1).min() > 1, "the file is in another frame"
    found = read_ply(out / "gaussians.ply")
    scene_from_file = torch.tensor(json.loads(matrix), dtype=torch.float64)
    moved = found.means.double() @ scene_from_file[:3, :3].mT + scene_from_file[:3, 3]
    assert torch.cdist(moved, scene.gaussians.means.double()).min(1).values.max() < 1e-5
    with torch.no_grad():
        expected = render(scene.gaussians.with_footprints(), scene.cameras, near=scene.near)
        read = render(found, cameras, near=scene.near)
    # A Gaussian whose alpha is within a rounding error of 1/255 may be drawn from one file and skipped from the other, and of Gaussians at
    # the same depth, which convex upsampling makes within a texel, either may be the first.
    for one, other in ((expected.images, read.images), (expected.alphas, read.alphas)):
        difference = (one - other).abs()
        assert difference.max() < 0.02
        assert (difference > 1e-3).double().mean() < 0.02
        assert difference.mean() < 1e-4
    assert ((expected.depths - read.depths).abs() / expected.depths.clamp(min=0.1)).max() < 1e-3
    assert len(read_ply(out / "semantics.ply")) == len(scene.gaussians)


def test_the_scene_file_holds_what_was_read(done: tuple[Path, str]) -> None:
    scene = semgs.load_scene(done[0])
    assert scene.frames == ("images/000.png", "images/003.png")
    assert scene.unit == "metric"
    assert scene.cameras.size == (48, 64)
    assert scene.source == "room"
    assert scene.near == 0.5


def test_a_second_run_replaces_the_folder_with_the_same_bytes(
    done: tuple[Path, str], room: Path, tmp_path: Path
) -> None:
    first, _ = done
    out = tmp_path / "room"
    shutil.copytree(first, out)
    for name in BINARIES:
        (out / name).write_bytes(b"of an earlier run")
    arguments = ["reconstruct", str(room), "--out", str(out), "--weights", "random", "--context", "0", "3"]
    assert main([*arguments, "--overwrite"]) == 0
    for name in BINARIES:
        assert (out / name).read_bytes() == (first / name).read_bytes()


def test_frames_by_name_another_size_other_bounds_and_weights_from_a_file(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save(tmp_path / "mine.safetensors", load("small", "random"), {"description": "drawn for a test"})
    arguments = ["--weights", str(tmp_path / "mine.safetensors"), "--context", "002.png", "0", "--size", "32x50"]
    bounds = ["--depth-range", "0.25", "5"]
    assert (
        main(["reconstruct", str(room / "transforms.json"), "--out", str(tmp_path / "out"), *arguments, *bounds]) == 0
    )
    numbers = json.loads((tmp_path / "out/report.json").read_text())
    assert numbers["depth_range"] == {"near": 0.25, "far": 5.0, "reason": "you say so"}
    assert numbers["choice"]["context"] == [2, 0]
    assert numbers["size"] == {"height": 32, "width": 50}
    assert "drawn for a test" in numbers["model"]["weights"]
    assert not re.search("untrained", capsys.readouterr().out)


def test_a_colour_only_model_leaves_out_what_needs_classes(room: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = ["--model", "mvsplat", "--weights", "random", "--size", "32x48"]
    assert main(["reconstruct", str(room), "--out", str(out), *arguments]) == 0
    assert {path.name for path in out.iterdir()} == OUTPUTS - {"semantics.ply"}
    assert not list((out / "renders").glob("*_classes.png"))
    assert semgs.load_scene(out).classes is None
    assert "colour only" in (out / "report.html").read_text()


def test_pictures_are_checked_once_when_they_are_read(
    room: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of the input views together, those of the target views together, and the padded ones of the network."""
    checks, constructor = [0], semgs.Views.__init__

    def counting(self: semgs.Views, *arguments: object, **named: object) -> None:
        checks[0] += 1
        constructor(self, *arguments, **named)

    monkeypatch.setattr(semgs.Views, "__init__", counting)
    arguments = ["--out", str(tmp_path / "out"), "--weights", "random", "--context", "0", "3", "--size", "32x48"]
    assert main(["reconstruct", str(room), *arguments]) == 0
    assert checks[0] <= 3


def test_the_least_confidence_reaches_the_label_files(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--weights", "random", "--context", "0", "3", "--size", "32x48"]
    assert main(["reconstruct", str(room), "--out", str(tmp_path / "out"), *options, "--min-confidence", "1"]) == 0
    numbers = json.loads((tmp_path / "out" / "report.json").read_text())
    assert (numbers["min_confidence"], numbers["temperatures"]) == (1, None)
    assert numbers["unknown"] + numbers["unseen"] == pytest.approx(1, abs=1e-4)
    assert numbers["classes"] == []
    capsys.readouterr()
    colour_only = [*options, "--model", "mvsplat", "--min-confidence", "0.5"]
    assert main(["reconstruct", str(room), "--out", str(tmp_path / "b"), *colour_only]) == 2
    assert "predicts colour only" in capsys.readouterr().err

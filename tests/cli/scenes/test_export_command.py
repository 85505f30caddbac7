"""`semgs export`: what it writes, says and refuses."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from ply import read_ply
from turned_cameras import write_scene

import semgs
from semgs.cli.main import main
from semgs.files.images.pictures import read_rgb


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An output folder of two views, given against their order in the file; not to be changed."""
    folder = tmp_path_factory.mktemp("exported")
    room = write_scene(folder / "room")
    given = ["--out", str(folder / "out"), "--weights", "random", "--context", "3", "0", "--size", "32x48"]
    assert main(["reconstruct", str(room), *given]) == 0
    return folder / "out"


def export(done: Path, out: Path, *options: object) -> dict:
    """Run the command; the content of export.json."""
    assert main(["export", str(done), "--out", str(out), *map(str, options)]) == 0
    return json.loads((out / "export.json").read_text())


def in_scene(record: dict, name: str, positions: np.ndarray) -> np.ndarray:
    """Positions of a file in the scene's coordinates, by export.json."""
    (matrix,) = [file["scene_from_file"] for file in record["files"] if file["name"] == name]
    return positions @ np.array(matrix)[:3, :3].T + np.array(matrix)[:3, 3]


def test_every_format_has_its_own_up_and_leads_back_to_the_scene(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("rosbags")
    capsys.readouterr()
    options = ("--as", "ply", "points", "mcap", "gltf", "colmap", "--colour", "photo", "classes", "--up=-y")
    record = export(done, tmp_path / "out", *options)
    shown = capsys.readouterr().out
    names = ["gaussians.ply", "semantics.ply", "points.ply", "points.mcap", "gaussians.glb", "colmap"]
    assert {path.name for path in (tmp_path / "out").iterdir()} == {".semgs", "export.json", *names}
    assert [(file["name"], file["up"]) for file in record["files"]] == list(
        zip(names, ("-y", "-y", "z", "z", "y", "-y"), strict=True)
    )
    for name in names:
        assert str(tmp_path / "out" / name) in shown
    scene = semgs.load_scene(done)
    means = scene.gaussians.means.numpy()
    splats = read_ply(tmp_path / "out" / "gaussians.ply").means.numpy()
    cloud = trimesh.load(tmp_path / "out" / "points.ply").vertices
    assert np.abs(in_scene(record, "gaussians.ply", splats) - means).max() < 1e-5
    assert np.abs(in_scene(record, "points.ply", cloud) - means).max() < 1e-5
    assert read_ply(tmp_path / "out" / "gaussians.ply").means.median(0).values.abs().max() < 1e-5
    (mesh,) = trimesh.load(tmp_path / "out" / "gaussians.glb").geometry.values()
    assert np.abs(in_scene(record, "gaussians.glb", mesh.vertices) - means).max() < 1e-5
    # Up is -y in the scene, -y in the PLY and z among the points.
    assert np.allclose(np.diff(-splats[:, 1]), np.diff(cloud[:, 2]), atol=1e-5)
    assert np.allclose(np.diff(-means[:, 1]), np.diff(cloud[:, 2]), atol=1e-5)
    assert record["classes"][5] == {"number": 5, "name": "sofa", "colour": list(scene.classes.colours[5])}
    assert record["up"] == {"direction": [0, -1, 0], "reason": "as given", "certain": True}


def test_a_usd_file_has_z_up_and_leads_back_to_the_scene(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("pxr")
    from pxr import Usd, UsdGeom, UsdSemantics, UsdVol

    capsys.readouterr()
    record = export(done, tmp_path / "out", "--as", "usd", "--up=-y")
    assert f"{len(semgs.load_scene(done).gaussians):,} Gaussians, up is Z" in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "out").iterdir()} == {".semgs", "export.json", "scene.usdc"}
    stage = Usd.Stage.Open(str(tmp_path / "out" / "scene.usdc"))
    assert (UsdGeom.GetStageUpAxis(stage), record["files"][0]["up"]) == ("Z", "z")
    scene = semgs.load_scene(done)
    labels = scene.gaussians.semantic.features.argmax(-1).numpy()
    for prim in stage.GetPrimAtPath("/World/Gaussians").GetChildren():
        (label,) = UsdSemantics.LabelsAPI(prim, "class").GetLabelsAttr().Get()
        positions = np.array(UsdVol.ParticleField3DGaussianSplat(prim).GetPositionsAttr().Get())
        means = scene.gaussians.means[labels == scene.classes.index(label)].numpy()
        assert np.abs(in_scene(record, "scene.usdc", positions) - means).max() < 1e-5


def test_without_the_library_of_usd_the_extra_is_named_and_nothing_is_written(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    capsys.readouterr()
    assert main(["export", str(done), "--out", str(tmp_path / "out"), "--as", "ply", "usd"]) == 2
    assert "USD files need usd-core 26.3 or newer: pip install -e '.[usd]'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_photos_of_a_model_are_those_of_its_cameras(done: Path, tmp_path: Path) -> None:
    export(done, tmp_path / "out", "--as", "colmap")
    images = tmp_path / "out" / "colmap" / "images"
    assert sorted(path.name for path in images.iterdir()) == ["000_003.png", "001_000.png"]
    for name, photo in (("000_003.png", "context_003_input.png"), ("001_000.png", "context_000_input.png")):
        assert np.array_equal(read_rgb(images / name), read_rgb(done / "renders" / photo))
    opened = semgs.open_scene(tmp_path / "out" / "colmap")
    assert [frame.name for frame in opened.frames] == ["000_003.png", "001_000.png"]


def test_a_scene_file_alone_has_no_photos_and_the_command_says_so(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy(done / "scene.safetensors", tmp_path / "alone.safetensors")
    capsys.readouterr()
    export(tmp_path / "alone.safetensors", tmp_path / "out", "--as", "colmap")
    assert "no photos of the input views, so colmap/images is missing" in capsys.readouterr().out
    assert not (tmp_path / "out" / "colmap" / "images").exists()
    assert (tmp_path / "out" / "colmap" / "sparse" / "0" / "points3D.bin").is_file()


def test_the_scenes_own_frame_is_kept_and_its_origin_is_recorded(tmp_path: Path) -> None:
    far = [500_000.0, -4_000_000.0, 20.0]

    def move(scene: dict) -> None:
        for frame in scene["frames"]:
            for axis in range(3):
                frame["transform_matrix"][axis][3] += far[axis]

    room = write_scene(tmp_path / "room", move)
    given = ["--out", str(tmp_path / "far"), "--weights", "random", "--context", "0", "3", "--size", "32x48"]
    assert main(["reconstruct", str(room), *given]) == 0
    record = export(tmp_path / "far", tmp_path / "out", "--frame", "scene")
    scene = semgs.load_scene(tmp_path / "far")
    splats = read_ply(tmp_path / "out" / "gaussians.ply")
    torch.testing.assert_close(splats.means, scene.gaussians.means, rtol=0, atol=0)
    torch.testing.assert_close(splats.colour.features[:, :4], scene.gaussians.colour.features[:, :4])
    assert record["files"][0]["up"] is None
    assert record["up"] is None
    assert np.array(record["files"][0]["scene_from_file"])[:3, 3].tolist() == list(scene.origin)
    # The PLY of reconstruct is centred, and its matrix leads back across 4,000 km.
    centred = read_ply(tmp_path / "far" / "gaussians.ply").means
    assert centred.median(0).values.abs().max() < 1e-5
    beside = json.loads((tmp_path / "far" / "export.json").read_text())
    back = in_scene(beside, "gaussians.ply", centred.double().numpy())
    assert np.abs(back - (scene.gaussians.means.double().numpy() + scene.origin)).max() < 1e-5


def test_only_what_passes_is_written_and_it_stays_where_it_was(done: Path, tmp_path: Path) -> None:
    scene = semgs.load_scene(done)
    probabilities, labels = scene.gaussians.semantic.features.max(-1)
    name = scene.classes.names[int(labels.mode().values)]
    opacity, confidence = float(scene.gaussians.opacities.median()), float(probabilities.median())
    keep = (
        (scene.gaussians.opacities >= opacity)
        & (probabilities >= confidence)
        & (labels == scene.classes.names.index(name))
    )
    assert 0 < keep.sum() < len(keep) / 2
    options = ("--min-opacity", opacity, "--min-confidence", confidence, "--classes", name)
    record = export(done, tmp_path / "out", *options)
    assert record["files"][0]["count"] == keep.sum()
    whole, part = read_ply(done / "gaussians.ply"), read_ply(tmp_path / "out" / "gaussians.ply")
    torch.testing.assert_close(part.means, whole.means[keep], rtol=0, atol=0)


def test_what_cannot_be_exported_is_refused_in_one_line(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"

    def refused(*options: object, scene: Path = done) -> str:
        capsys.readouterr()
        assert main(["export", str(scene), "--out", str(out), *map(str, options)]) == 2
        shown = capsys.readouterr()
        assert (shown.out, shown.err.count("\n")) == ("", 1)
        assert not out.exists()
        return shown.err

    assert "there is no class 'chiar'; did you mean chair?" in refused("--classes", "chiar")
    assert "no Gaussian is left" in refused("--min-opacity", "1")
    assert "--up is for --frame upright" in refused("--frame", "scene", "--up", "z")
    assert "--colour is for --as ply" in refused("--as", "points", "--colour", "classes")
    assert "found no such file" in refused(scene=tmp_path / "nowhere")
    assert "expected a number from 0 to 1" in refused("--min-confidence", "50")
    assert "--resolution is for --as occupancy" in refused("--resolution", "0.1")
    assert "--step-height is for --as occupancy" in refused("--step-height", "0.2", "--as", "objects")
    assert "--robot-height is for --as occupancy" in refused("--robot-height", "2")


def test_an_earlier_export_is_replaced_only_when_asked(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    export(done, tmp_path / "out", "--as", "points")
    assert main(["export", str(done), "--out", str(tmp_path / "out")]) == 2
    assert "--overwrite" in capsys.readouterr().err
    export(done, tmp_path / "out", "--overwrite")
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [".semgs", "export.json", "gaussians.ply"]


def test_without_rosbags_the_extra_is_named_before_anything_is_written(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "rosbags.rosbag2", None)
    assert main(["export", str(done), "--as", "mcap", "--out", str(tmp_path / "out")]) == 2
    assert "needs rosbags: pip install -e '.[ros]'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_labels_and_confidence_are_columns_of_the_ply_where_asked(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    record = export(done, tmp_path / "plain", "--as", "ply")
    export(done, tmp_path / "out", "--as", "ply", "--labels")
    plain, splat = (semgs.load_splat(tmp_path / name / "gaussians.ply") for name in ("plain", "out"))
    assert not plain.extra
    assert list(splat.extra) == ["label", "confidence"]
    scene = semgs.load_scene(done)
    assert splat.extra["label"].tolist() == scene.gaussians.semantic.features.argmax(-1).tolist()
    assert (splat.extra["confidence"] > 0.05).all()
    names = [entry["name"] for entry in record["classes"]]
    assert splat.comments == (*(f"label {number} {name}" for number, name in enumerate(names)), "label 255 unseen")
    torch.testing.assert_close(splat.gaussians.means, plain.gaussians.means, rtol=0, atol=0)
    (most,) = np.bincount(splat.extra["label"]).argsort()[-1:]
    export(done, tmp_path / "one", "--as", "ply", "--labels", "--classes", names[most])
    one = semgs.load_splat(tmp_path / "one" / "gaussians.ply")
    assert one.extra["label"].tolist() == [most] * int((splat.extra["label"] == most).sum())
    capsys.readouterr()
    for options, mode in ((("--as", "points"), "--as ply"), (("--as", "ply", "--colour", "classes"), "--colour photo")):
        assert main(["export", str(done), "--out", str(tmp_path / "no"), *options, "--labels"]) == 2
        assert f"--labels is for {mode};" in capsys.readouterr().err

"""`semgs reconstruct --features` and `semgs query`: what they write, say and refuse."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from ply import read_ply
from saved_scenes import wall
from turned_cameras import write_scene

import semgs
from semgs.cli.main import main
from semgs.scene.scene_file import save_scene
from semgs.segmenters.features.compression import Compression
from semgs.segmenters.features.scene_features import SceneFeatures, load_features, save_features

NUMBERS = 40
AXES = np.linalg.qr(np.random.default_rng(7).normal(size=(NUMBERS, NUMBERS)))[0]


def write_features(folder: Path, frames: int = 4) -> Path:
    """Features of one direction in the left half of each photo, and of another in the right half."""
    (folder / "images").mkdir(parents=True)
    for frame in range(frames):
        values = np.empty((NUMBERS, 6, 8), np.float16)
        values[:, :, :4], values[:, :, 4:] = 3 * AXES[0][:, None, None], 5 * AXES[1][:, None, None]
        np.save(folder / "images" / f"{frame:03d}.npy", values)
    return folder


def reconstruct(room: Path, out: Path, *options: object) -> int:
    """Run `semgs reconstruct` with untrained weights; its exit code."""
    given = ["--out", str(out), "--weights", "random", "--context", "0", "3", "--size", "32x48"]
    return main(["reconstruct", str(room), *given, *map(str, options)])


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An output folder with features; not to be changed."""
    folder = tmp_path_factory.mktemp("featured")
    room = write_scene(folder / "room")
    assert reconstruct(room, folder / "out", "--features", write_features(folder / "clip")) == 0
    return folder / "out"


@pytest.fixture
def left(tmp_path: Path) -> Path:
    """The direction of the left halves."""
    np.save(tmp_path / "left.npy", 20 * AXES[0])
    return tmp_path / "left.npy"


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The line that a command line is refused with."""
    capsys.readouterr()
    assert main([*map(str, arguments)]) == 2
    shown = capsys.readouterr()
    assert (shown.out, shown.err.count("\n")) == ("", 1)
    return shown.err


def test_the_report_says_what_is_kept(done: Path):
    report = json.loads((done / "report.json").read_text())
    told = report["features"]
    assert (told["numbers"], told["compression"], told["directions"], told["entries"]) == (NUMBERS, "components", 2, None)  # fmt: skip
    assert told["kept"] == pytest.approx(1, abs=1e-4)
    assert told["largest_change_of_a_cosine"] < 0.01
    assert "features" in report["seconds"]
    assert "40 numbers from" in (done / "report.html").read_text()
    features = load_features(done)
    assert len(features.codes) == report["gaussians"]


def test_a_query_finds_what_looks_like_the_embedding(
    done: Path, left: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "out"
    assert main(["query", str(done), "--embedding", str(left), "--threshold", "0.9", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    numbers = json.loads((out / "query.json").read_text())
    files = {f"{view:03d}_similarity.{kind}" for view in (0, 1) for kind in ("png", "tiff")}
    assert {path.name for path in out.iterdir()} == {".semgs", "export.json", "found.ply", "query.json", *files}
    scene, features = semgs.load_scene(done), load_features(done)
    cosine = torch.nn.functional.cosine_similarity(
        features.compression.features(features.coordinates), torch.from_numpy(AXES[0]).float()[None], dim=1
    )
    above = cosine > 0.9
    assert 0.1 < above.double().mean() < 0.6
    assert numbers["above"] == int(above.sum())
    assert len(read_ply(out / "found.ply")) == numbers["above"]
    whole = read_ply(done / "gaussians.ply").means
    torch.testing.assert_close(read_ply(out / "found.ply").means, whole[above], rtol=0, atol=0)
    assert f"{numbers['above']:,} of {numbers['gaussians']:,} Gaussians are above 0.900" in shown
    assert numbers["deviation"]["sample"] <= numbers["deviation"]["at_most"] + 1e-3 < 0.02
    values = np.asarray(Image.open(out / "000_similarity.tiff"))
    assert values.shape == (32, 48)
    alphas = semgs.render(scene.gaussians, scene.cameras, near=scene.near).alphas
    nothing = np.isnan(values)
    assert nothing[alphas[0].numpy() < 0.01].all()
    assert np.nanmax(values) <= 1
    assert numbers["views"][0]["seen"] == pytest.approx(1 - nothing.mean())
    assert np.asarray(Image.open(out / "000_similarity.png")).shape == (32, 48, 3)


@pytest.mark.parametrize("book", [False, True])
def test_without_a_threshold_a_feature_that_half_of_the_room_has_is_found(book: bool, tmp_path: Path):
    scene = wall()
    save_scene(tmp_path / "scene.safetensors", scene)
    count = len(scene.gaussians)
    first = torch.arange(count) % 2 == 0
    entries = torch.cat((torch.zeros(1, 2), torch.eye(2))) if book else torch.eye(2)
    codes = torch.where(first, 1, 2).to(torch.uint8) if book else entries[(~first).long()]
    compression = Compression(torch.eye(4)[:, :2], entries if book else None)
    save_features(
        tmp_path / "features.safetensors", SceneFeatures(compression, codes, 1.0, 0.0, torch.eye(4)[:2], "segments")
    )
    np.save(tmp_path / "first.npy", np.array([2.0, 0, 0, 0]))
    command = ["query", str(tmp_path), "--embedding", str(tmp_path / "first.npy"), "--out", str(tmp_path / "out")]
    assert main(command) == 0
    numbers = json.loads((tmp_path / "out" / "query.json").read_text())
    assert (numbers["above"], numbers["gaussians"]) == (1230, 2460)
    assert numbers["threshold"] == pytest.approx(0.9999, abs=1e-6)
    found = read_ply(tmp_path / "out" / "found.ply")
    assert len(found) == 1230


def test_without_a_threshold_the_likest_tenth_is_written_and_an_unreached_one_writes_none(
    done: Path, left: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    np.save(tmp_path / "mixed.npy", (AXES[0] + 0.5 * AXES[1] + AXES[2]).astype(np.float32)[None])
    arguments = ["query", str(done), "--embedding", str(tmp_path / "mixed.npy")]
    assert main([*arguments, "--out", str(tmp_path / "tenth")]) == 0
    numbers = json.loads((tmp_path / "tenth" / "query.json").read_text())
    assert numbers["threshold"] == pytest.approx(numbers["quantiles"]["0.9"])
    assert 0 < numbers["above"] <= 0.1 * numbers["gaussians"]
    assert main([*arguments, "--threshold", "1", "--out", str(tmp_path / "none")]) == 0
    assert "try a threshold below 0." in capsys.readouterr().out
    assert not (tmp_path / "none" / "found.ply").exists()


def test_a_network_without_classes_takes_features_too(tmp_path: Path, left: Path):
    room, out = write_scene(tmp_path / "room"), tmp_path / "out"
    write_features(tmp_path / "clip")
    assert reconstruct(room, out, "--features", tmp_path / "clip", "--model", "mvsplat") == 0
    assert main(["query", str(out), "--embedding", str(left), "--out", str(tmp_path / "found")]) == 0


def test_what_does_not_fit_is_refused(done: Path, left: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    room, out = write_scene(tmp_path / "room"), tmp_path / "new"
    shutil.copytree(done, tmp_path / "bare")
    (tmp_path / "bare" / "features.safetensors").unlink()
    query = ("query", done, "--out", out, "--embedding")
    assert "found no such file; give the folder that `semgs reconstruct --features DIR --out` wrote" in refused(
        capsys, "query", tmp_path / "bare", "--embedding", left, "--out", out
    )
    for values, said in (
        (np.zeros(NUMBERS), "expected an embedding with a direction, found zeros only"),
        (np.ones(39), "expected 40 numbers, as a feature of the scene has, found shape (39,)"),
        (np.ones((8, 5)), "found shape (8, 5)"),
        (np.where(np.arange(NUMBERS) == 3, np.nan, 1.0), "[3]: expected finite numbers, found NaN or infinity"),
    ):
        np.save(tmp_path / "bad.npy", values)
        line = refused(capsys, *query, tmp_path / "bad.npy")
        assert f"{tmp_path / 'bad.npy'}: " in line
        assert said in line
    assert "expected a cosine, from -1 to 1" in refused(capsys, *query, left, "--threshold", "1.5")
    assert "nowhere.npy" in refused(capsys, *query, tmp_path / "nowhere.npy")
    maps = write_features(tmp_path / "clip")
    (maps / "images" / "003.npy").unlink()
    command = ("reconstruct", room, "--out", out, "--weights", "random", "--context", "0", "3", "--features")
    assert "expected the features of frame images/003.png: images/003.npy or images/003.npz, found none" in refused(
        capsys, *command, maps
    )
    np.save(maps / "images" / "003.npy", np.ones((5, 6, 8)))
    assert "images/003.png: expected features of 40 numbers, as of images/000.png, found 5" in refused(
        capsys, *command, maps
    )
    assert "expected a folder of feature maps, found nothing there" in refused(capsys, *command, tmp_path / "nowhere")
    assert not out.exists()

"""`semgs render`, `view`, `export` and `query` with splats of other programs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from known_scenes import write_scene
from PIL import Image
from saved_scenes import wall
from splat_files import columns_3dgs, known_row, ply, save, spz, spz_blocks

from semgs.cli.main import main
from semgs.data.scenes import open_scene
from semgs.export.ply import save_ply
from semgs.geometry.cameras import project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.scene.scene_file import FILE_NAME, save_scene
from semgs.splats.load import load_splat


@pytest.fixture
def stick(tmp_path: Path) -> Path:
    """Red Gaussians along x, from -2 to 2, in a PLY."""
    means = torch.zeros(81, 3)
    means[:, 0] = torch.linspace(-2, 2, 81)
    red = torch.tensor([1.7, -1.7, -1.7]).expand(81, 1, 3)
    shape = Appearance(torch.eye(4)[:1].repeat(81, 1), torch.full((81, 3), 0.1), red)
    save_ply(tmp_path / "stick.ply", Gaussians(means, torch.full((81,), 0.95), shape))
    return tmp_path / "stick.ply"


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    return write_scene(tmp_path / "photos", 3, (24, 32)).path


def front_of(photos: Path, path: Path) -> Path:
    """A splat of 300 Gaussians, 2 m in front of the cameras of a scene."""
    pose = torch.from_numpy(open_scene(photos).frames[1].world_from_camera)
    spread = torch.randn(300, 3, generator=torch.Generator().manual_seed(0), dtype=torch.float64) * torch.tensor(
        [0.7, 0.7, 0.01]
    )
    means = (spread + torch.tensor([0.0, 0, 2])) @ pose[:3, :3].mT + pose[:3, 3]
    shape = Appearance(torch.eye(4)[:1].repeat(300, 1), torch.full((300, 3), 0.1), torch.ones(300, 1, 3))
    save_ply(path, Gaussians(means.float(), torch.full((300,), 0.9), shape))
    return path


def lit(path: Path) -> tuple[int, int]:
    """Width and height of what is not black in an image."""
    rows, columns = np.nonzero(np.array(Image.open(path)).max(-1) > 100)
    return int(np.ptp(columns)), int(np.ptp(rows))


@pytest.mark.long
def test_a_splat_is_circled_and_up_may_be_given(stick: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["render", str(stick), "--out", str(tmp_path / "a"), "--frames", "4", "--size", "60x80"]) == 0
    told = capsys.readouterr().out
    assert "4 images each of colour, depth" in told
    assert "note: which way is up is uncertain (no field of PLY says it, -Y is usual); set it with --up" in told
    # The circle is about -y: along the stick and across it in turn.
    sizes = [lit(tmp_path / "a" / f"000{index}_colour.png") for index in range(4)]
    assert all(abs(one[0] - other[0]) <= 3 for one, other in zip(sizes[:2], sizes[2:], strict=True))
    assert abs(sizes[0][0] - sizes[1][0]) > 30
    up_x = ["--up", "x", "--degrees", "20", "--path", "orbit"]
    assert main(["render", str(stick), "--out", str(tmp_path / "b"), "--frames", "2", "--size", "60x80", *up_x]) == 0
    assert "note" not in capsys.readouterr().out
    width, height = lit(tmp_path / "b" / "0000_colour.png")
    assert height > 3 * width  # upright


def test_cameras_of_a_scene_are_the_inputs(photos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    splat = front_of(photos, tmp_path / "a.ply")
    command = [
        "render",
        str(splat),
        "--cameras",
        str(photos),
        "--path",
        "inputs",
        "--frames",
        "2",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main(command) == 0
    listed = json.loads((tmp_path / "out" / "transforms.json").read_text())["frames"]
    first = np.array(listed[0]["transform_matrix"]) @ np.diag([1, -1, -1, 1])
    np.testing.assert_allclose(first, open_scene(photos).frames[0].world_from_camera, atol=1e-6)
    assert np.array(Image.open(tmp_path / "out" / "0000_colour.png")).shape == (24, 32, 3)
    assert "2 images" in capsys.readouterr().out


def test_a_splat_is_exported_in_every_format_that_it_can_have(
    photos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    splat = front_of(photos, tmp_path / "a.ply")
    out = tmp_path / "out"
    command = [
        "export",
        str(splat),
        "--cameras",
        str(photos),
        "--as",
        "ply",
        "gltf",
        "points",
        "colmap",
        "--frame",
        "scene",
    ]
    assert main([*command, "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "up is uncertain" not in told
    assert told.startswith("note: The splat does not look like the photos from their cameras (PSNR ")  # which are noise
    for name in ("gaussians.ply", "gaussians.glb"):
        torch.testing.assert_close(load_splat(out / name).gaussians.means, load_splat(splat).gaussians.means)
    model = open_scene(out / "colmap")
    assert len(model) == 3
    assert np.array(Image.open(next((out / "colmap" / "images").iterdir()))).shape == (24, 32, 3)
    assert model.points is not None
    seen = project(torch.from_numpy(model.points).double(), model.cameras[1])
    assert float(seen[:, 2].median()) == pytest.approx(2, abs=0.1)


@pytest.mark.long
def test_a_page_shows_a_splat(stick: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    pytest.importorskip("viser")
    pytest.importorskip("zstandard")
    packed = save(tmp_path / "b.spz", spz(4, spz_blocks(4)))
    for splat, count in ((stick, 81), (packed, 2)):
        page = tmp_path / f"{splat.stem}.html"
        assert main(["view", str(splat), "--html", str(page)]) == 0
        assert f"{count} of {count} Gaussians" in capsys.readouterr().out
        assert page.read_text().startswith("<!doctype html>")


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["query", "{splat}", "--embedding", "a.npy"], "a scene with features, found a splat of another program"),
        (["export", "{splat}", "--as", "colmap"], "give the scene that has them with --cameras"),
        (["export", "{splat}", "--as", "occupancy"], "--as occupancy needs metres, which a splat has not"),
        (["export", "{splat}", "--colour", "classes"], "a scene with classes for --colour classes"),
        (["render", "{splat}", "--show", "classes"], "a scene with classes for --show classes"),
        (["render", "{splat}", "--cameras", "nowhere"], "nowhere: expected a folder with a scene"),
        (["render", "{splat}", "--degrees", "0"], "--degrees is 0"),
        (["render", "{bad}"], "bad.ply: position of Gaussian 0: expected finite numbers"),
        (["render", "{scene}", "--cameras", "{photos}"], "--cameras is for splats of other programs"),
        (["export", "none.ply"], "none.ply: expected a splat: PLY, compressed PLY, SPZ, or glTF with KHR_gaussian_splatting, found no such file"),
    ],
)  # fmt: skip
def test_what_cannot_work_is_refused_in_one_line(
    stick: Path, photos: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], command: list[str], message: str
):
    bad = save(tmp_path / "bad.ply", ply({"vertex": columns_3dgs([known_row(x=np.nan)])}))
    (tmp_path / "scene").mkdir()
    save_scene(tmp_path / "scene" / FILE_NAME, wall())
    names = {"splat": stick, "bad": bad, "scene": tmp_path / "scene", "photos": photos}
    assert main([*(word.format(**names) for word in command), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr()
    assert message in told.err
    assert "Traceback" not in told.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--as", "colmap"], "--as colmap is for training on photos; give the scene that has them with --cameras"),
        (["--as", "occupancy"], "--as occupancy needs metres, which a splat has not; give a scene in metres with --cameras"),
        (["--as", "ply", "objects"], "a scene with classes for --as objects"),
        (["--classes", "chair"], "a scene with classes for --classes"),
        (["--labels"], "a scene with classes for --labels"),
        (["--colour", "classes"], "a scene with classes for --colour classes"),
    ],
)  # fmt: skip
def test_what_no_splat_can_give_is_refused_before_it_is_read(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: list[str],
    message: str,
):
    opened: list[Path] = []
    monkeypatch.setattr("semgs.run.export.open_given", lambda scene, *_: opened.append(scene))
    splat = save(tmp_path / "a.ply", ply({"vertex": columns_3dgs([known_row()])}))
    assert main(["export", str(splat), *options, "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err
    assert opened == []


def test_things_of_a_splat_are_refused_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    opened: list[Path] = []
    monkeypatch.setattr("semgs.cli.commands.scenes.view.open_given", lambda scene, *_: opened.append(scene))
    splat = save(tmp_path / "a.ply", ply({"vertex": columns_3dgs([known_row()])}))
    assert main(["view", str(splat), "--objects", "--html", str(tmp_path / "a.html")]) == 2
    assert "expected a scene with classes for --objects, found a splat of another program" in capsys.readouterr().err
    assert opened == []

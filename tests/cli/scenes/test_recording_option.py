"""`semgs reconstruct --all`: its folder is one that every other command takes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from turned_cameras import write_scene

import semgs
from semgs.cli.main import main
from semgs.data.demo_scene import demo_scene
from semgs.geometry.cameras import project
from semgs.scene.own_views import own_images, own_points
from semgs.viewer.splat_groups import SceneSplats


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a walk of nine frames, the fifth of them black; not to be changed."""
    folder = tmp_path_factory.mktemp("walk")

    def far(scene: dict) -> None:
        for number, frame in enumerate(scene["frames"]):
            frame["transform_matrix"][0][3] += 0.3 * number

    scene = write_scene(folder / "scene", far, frames=9)
    black = torch.zeros(48, 64, 3, dtype=torch.uint8).numpy()
    from semgs.files.images.pictures import write_png

    write_png(scene / "images" / "004.png", black)
    out = folder / "out"
    assert main(["reconstruct", str(scene), "--out", str(out), "--weights", "random", "--all"]) == 0
    return out


@pytest.mark.long
def test_the_report_says_which_frames_were_used_and_which_were_not(done: Path) -> None:
    report = json.loads((done / "report.json").read_text())
    used = report["choice"]["context"]
    assert len(used) >= 3
    assert 4 not in used
    assert 4 not in report["choice"]["targets"]
    assert "1 because its image is black" in " ".join(report["notes"])
    assert report["gaussians"] == len(semgs.load_scene(done).gaussians)
    assert {path.name for path in done.iterdir()} >= {
        "gaussians.ply",
        "semantics.ply",
        "export.json",
        "report.html",
        "renders",
    }


def test_a_merged_scene_is_saved_and_read_again(done: Path, tmp_path: Path) -> None:
    scene = semgs.load_scene(done)
    assert scene.places is not None
    assert len(scene.own_views) == len(scene.gaussians)
    semgs.save_scene(tmp_path / "again.safetensors", scene)
    assert (tmp_path / "again.safetensors").read_bytes() == (done / "scene.safetensors").read_bytes()
    # Gaussians move along the rays of their places only; joined ones are near them.
    own = zip(scene.gaussians.means.double(), scene.cameras[scene.own_views], strict=True)
    x, y, z = torch.cat([project(mean[None], camera) for mean, camera in own]).unbind(-1)
    height, width = scene.cameras.size
    rows, columns = (-(-side // scene.stride) for side in (height, width))
    place = (y / scene.stride).long() * columns + (x / scene.stride).long()
    assert (z > 0).all()
    assert (place == scene.places % (rows * columns)).double().mean() > 0.9


def test_other_commands_take_the_folder(done: Path, tmp_path: Path) -> None:
    formats = ["ply", "points", "gltf", "colmap"]
    assert main(["export", str(done), "--as", *formats, "--min-opacity", "0.1", "--out", str(tmp_path / "files")]) == 0
    assert (tmp_path / "files" / "colmap" / "images").is_dir()
    assert main(["render", str(done), "--path", "inputs", "--frames", "2", "--out", str(tmp_path / "images")]) == 0
    scene = semgs.load_scene(done)
    splats = SceneSplats.of(scene)
    assert len(splats.colours) == len(scene.gaussians)
    assert own_images(scene).shape[:3] == own_points(scene).shape[:3]


def test_upright_files_objects_occupancy_and_the_viewer_take_a_merged_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The included room by the included weights, without `--up`: the way up is found, and with it the floor."""
    folder = tmp_path / "out"
    options = ["--all", "--size", "96x128", "--refine", "1"]
    assert main(["reconstruct", str(demo_scene()), "--out", str(folder), *options]) == 0
    assert semgs.load_scene(folder).places is not None
    for name in ("ply", "objects", "occupancy"):
        assert main(["export", str(folder), "--out", str(tmp_path / name), "--as", name]) == 0
    things = json.loads((tmp_path / "objects" / "objects.json").read_text())
    assert len(things["objects"]) >= 1
    assert (tmp_path / "occupancy" / "map.pgm").is_file()
    page = tmp_path / "room.html"
    assert main(["view", str(folder), "--html", str(page)]) == 0
    assert page.stat().st_size > 100_000
    assert "error" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--context", "0", "1"], "--context cannot go with --all"),
        (["--views", "5"], "--views cannot go with --all"),
    ],
)
def test_options_that_do_not_go_with_all_frames_are_refused(options, said, tmp_path: Path, capsys) -> None:
    scene = write_scene(tmp_path / "scene")
    assert main(["reconstruct", str(scene), "--out", str(tmp_path / "out"), "--all", *options]) == 2
    assert said in capsys.readouterr().err


def test_a_recording_with_nothing_usable_ends_with_one_line(tmp_path: Path, capsys) -> None:
    """Cameras 100 m apart share nothing."""

    def scatter(scene: dict) -> None:
        for number, frame in enumerate(scene["frames"]):
            frame["transform_matrix"][0][3] += 100 * number

    scene = write_scene(tmp_path / "scene", scatter)
    out = tmp_path / "out"
    assert main(["reconstruct", str(scene), "--out", str(out), "--weights", "random", "--all"]) == 2
    lines = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
    assert len(lines) == 1
    assert "expected two frames that share 30% of what they see, found 0% at most" in lines[0]
    assert not out.exists()

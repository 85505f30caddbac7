"""`semgs render`: what it writes, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from saved_scenes import SIZE, wall

from semgs.cli.main import main
from semgs.export.stills import GAP_PX, Stills
from semgs.scene.scene_file import FILE_NAME, save_scene


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scene file, far from its origin; not to be changed."""
    folder = tmp_path_factory.mktemp("done")
    save_scene(folder / FILE_NAME, wall(origin=5e6))
    return folder


def render(scene: Path, out: Path, *options: object) -> int:
    """Run `semgs render`; its exit code."""
    return main(["render", str(scene), "--out", str(out), *map(str, options)])


def pixels(path: Path) -> np.ndarray:
    return np.array(Image.open(path))


def test_a_folder_has_an_image_for_each_camera_and_show_and_its_cameras_can_be_rendered_again(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, again = tmp_path / "out", tmp_path / "again"
    assert render(done, out, "--frames", 3, "--show", "colour", "rgba", "--size", "32x50", "--up", "z") == 0
    assert capsys.readouterr().out == f"{out}: 3 images each of colour, rgba\n"
    images = {f"{index:04d}_{show}.png" for index in range(3) for show in ("colour", "rgba")}
    assert {path.name for path in out.iterdir()} == images | {".semgs", "transforms.json"}
    assert pixels(out / "0000_rgba.png").shape == (32, 50, 4)
    listed = json.loads((out / "transforms.json").read_text())["frames"]
    assert all(4.9e6 < frame["transform_matrix"][0][3] < 5.1e6 for frame in listed)  # the source's coordinates
    assert render(done / FILE_NAME, again, "--path", out / "transforms.json", "--show", "colour") == 0
    for index in range(3):
        first, second = (pixels(folder / f"{index:04d}_colour.png").astype(int) for folder in (out, again))
        assert np.abs(first - second).max() <= 1
    assert (pixels(again / "0000_colour.png") != pixels(again / "0001_colour.png")).any()


def test_a_path_may_begin_with_the_home_folder(done: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    assert render(done, tmp_path / "stills", "--frames", 1, "--show", "colour") == 0
    assert render(done, tmp_path / "again", "--path", "~/stills/transforms.json", "--show", "colour") == 0


def test_a_video_has_the_images_side_by_side(done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    av = pytest.importorskip("av")
    out, stills = tmp_path / "a.MP4", tmp_path / "stills"
    assert render(done, out, "--frames", 4, "--fps", 8, "--path", "inputs") == 0
    assert capsys.readouterr().out == f"{out}: 4 images, 0.5 s at 8 images per second\n"
    assert render(done, stills, "--frames", 4, "--path", "inputs") == 0
    with av.open(str(out)) as container:
        decoded = [frame.to_ndarray(format="rgb24", src_colorspace="ITU709") for frame in container.decode(video=0)]
    height, width = SIZE
    assert [frame.shape for frame in decoded] == [(height, 2 * width + GAP_PX, 3)] * 4
    for index, frame in enumerate(decoded):
        still = pixels(stills / f"{index:04d}_colour.png").astype(int)
        assert np.abs(frame[:, :width] - still).mean() < 4
    assert len(list(stills.glob("*_classes.png"))) == 4


def test_a_scene_without_classes_shows_colour_and_depth(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_scene(tmp_path / "scene", wall(classes=False))
    assert render(tmp_path / "scene", tmp_path / "out", "--frames", 1) == 0
    assert {path.name for path in (tmp_path / "out").glob("*.png")} == {"0000_colour.png", "0000_depth.png"}
    capsys.readouterr()
    assert render(tmp_path / "scene", tmp_path / "b", "--show", "colour", "classes") == 2
    assert "a scene with classes for --show classes" in capsys.readouterr().err


def test_only_what_semgs_wrote_is_replaced_and_only_if_it_should_be(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("av")
    options = ("--frames", 1, "--show", "colour")
    for out in (tmp_path / "stills", tmp_path / "a.mp4"):
        assert render(done, out, *options) == 0
        capsys.readouterr()
        assert render(done, out, *options) == 2
        assert "--overwrite" in capsys.readouterr().err
        assert render(done, out, *options, "--overwrite") == 0
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").touch()
    assert render(done, tmp_path / "mine", *options, "--overwrite") == 2
    assert {path.name for path in tmp_path.iterdir()} == {"stills", "a.mp4", "mine"}


@pytest.mark.parametrize("name", ["stills", "a.mp4"])
def test_if_it_is_stopped_half_way_nothing_is_left(
    done: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    pytest.importorskip("av")
    usual = Stills.images

    def stopped(*given: object) -> Iterator[tuple[np.ndarray, ...]]:
        yield next(usual(*given))
        raise SystemExit(143)  # as SIGTERM does

    monkeypatch.setattr(Stills, "images", stopped)
    assert render(done, tmp_path / name, "--frames", 3) == 143
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--degrees", 0), "--degrees is 0; expected more than 0, at most 360"),
        (("--degrees", 361), "--degrees is 361"),
        (("--degrees", "nan"), "--degrees is nan"),
        (("--degrees", 20, "--path", "inputs"), "--degrees is for --path orbit"),
        (("--up", "z", "--path", "inputs"), "--up is for orbit; --path is inputs"),
        (
            ("--path", "orbitt"),
            "--path is orbitt; did you mean orbit?; expected orbit, inputs or a file of cameras, found nothing there",
        ),
        (("--path", "."), "--path is .; expected orbit, inputs or a file of cameras, found a folder"),
        (
            ("--min-confidence", 0.5, "--show", "colour", "confidence"),
            "--min-confidence is for --show classes and overlay; --show is colour confidence",
        ),
        (("--degrees", 20, "--path", "absent.json"), "--degrees is for --path orbit"),
        (("--frames", 0), "frames"),
        (("--fps", 0), "fps"),
        (("--size", "8x8"), "size"),
        (("--min-confidence", 1.5), "min-confidence"),
        (("--show", "sound"), "show"),
        (("--path", "absent.json"), "absent.json"),
        (("--path", "absent.json", "--frames", 4), "--frames is for --path orbit and inputs"),
        (("--show", "rgba"), "a video has no transparency"),
        (("--show", "colour", "classes", "depth", "alpha", "overlay", "--size", "64x4096"), "side by side"),
    ],
)
def test_bad_options_are_refused_in_one_line(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], options: tuple[object, ...], message: str
) -> None:
    pytest.importorskip("av")
    assert render(done, tmp_path / "a.mp4", *options) == 2
    shown = capsys.readouterr()
    assert message in shown.err
    assert shown.out == ""
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("sides", [(1, 40), (40, 1)])
def test_cameras_of_one_pixel_are_no_video_but_images(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], sides: tuple[int, int]
) -> None:
    pytest.importorskip("av")
    height, width = sides
    path = tmp_path / "cameras.json"
    frame = {"transform_matrix": np.eye(4).tolist()}
    path.write_text(json.dumps({"h": height, "w": width, "fl_x": 20, "frames": [frame]}))
    assert render(done, tmp_path / "a.mp4", "--path", path) == 2
    line = f"semgs: error: the images have {height}x{width} pixels; a video needs at least 2x2\n"
    assert capsys.readouterr().err == line
    assert render(done, tmp_path / "stills", "--path", path, "--show", "colour") == 0
    assert pixels(tmp_path / "stills" / "0000_colour.png").shape == (height, width, 3)


@pytest.mark.parametrize("name", ["a.gif", "a.WebM", "stills/x.png"])
def test_a_folder_is_not_named_like_a_file(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    assert render(done, tmp_path / name) == 2
    shown = capsys.readouterr().err
    assert f"{name}; expected a video (.mp4), or a folder, whose name has no ending" in shown
    assert list(tmp_path.iterdir()) == []


def test_images_per_second_are_for_a_video(done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert render(done, tmp_path / "stills", "--fps", 10) == 2
    assert "--fps is for a video" in capsys.readouterr().err


def test_bad_scenes_and_places_are_refused_in_one_line(
    done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_scene(tmp_path / "plain", wall(classes=False))
    single = wall()
    count = len(single.gaussians) // 2
    save_scene(
        tmp_path / "single",
        replace(
            single,
            gaussians=single.gaussians.map(lambda tensor: tensor[:count]),
            cameras=single.cameras[:1],
            depths=single.depths[:1],
            confidences=single.confidences[:1],
            depth_spread=None,
            depth_range=single.depth_range[:1],
            frames=("a.jpg",),
        ),
    )
    for scene, out, options, message in (
        (tmp_path / "nowhere", tmp_path / "out", (), "nowhere"),
        (tmp_path / "single", tmp_path / "out", ("--path", "inputs"), "two input views or more"),
        (done, tmp_path / "none" / "a.mp4", (), "an existing folder"),
        (done, done / FILE_NAME, (), FILE_NAME),
        (tmp_path / "plain", tmp_path / "out", ("--min-confidence", 0.5), "--show is colour depth"),
    ):
        assert render(scene, out, *options) == 2
        shown = capsys.readouterr().err
        assert message in shown
        assert shown.count("\n") == 1

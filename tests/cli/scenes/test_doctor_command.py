"""`semgs doctor`: exit codes, corrected cameras, the page, and bad input."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from semgs.cli.main import main
from semgs.data.demo_scene import demo_scene
from semgs.data.scenes import open_scene


def copied(folder: Path, change: Callable[[dict], object]) -> Path:
    """A copy of the included room; `change` edits its transforms.json."""
    shutil.copytree(demo_scene(), folder)
    described = json.loads((folder / "transforms.json").read_text())
    change(described)
    (folder / "transforms.json").write_text(json.dumps(described))
    return folder


def invert(described: dict) -> None:
    for frame in described["frames"]:
        frame["transform_matrix"] = np.linalg.inv(frame["transform_matrix"]).tolist()


def test_a_good_scene_is_described_and_ends_with_0(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", str(demo_scene())]) == 0
    said = capsys.readouterr().out
    for line in (
        "layout                  transforms.json",
        "measured depth          8 of 8 frames",
        "The cameras fit:",
    ):
        assert line in said


def test_it_says_that_photos_lie_on_their_side(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """EXIF says so of all 8 photos, and the cameras are for the pixels as stored. The page has the note too."""
    scene, page = copied(tmp_path / "scene", lambda described: None), tmp_path / "page.html"
    exif = Image.Exif()
    exif[0x0112] = 6
    for path in (scene / "images").iterdir():
        with Image.open(path) as image:
            image.save(path, exif=exif)
    assert main(["doctor", str(scene), "--page", str(page)]) == 0
    said = "Photos lie on their side, as EXIF says, and so do their cameras (8 of 8 tested)."
    assert f"note: {said}" in capsys.readouterr().out
    assert said in page.read_text()


def test_inverted_poses_end_with_3_and_are_corrected(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, out, page = copied(tmp_path / "scene", invert), tmp_path / "fixed.json", tmp_path / "page.html"
    assert main(["doctor", str(scene), "--fix", str(out), "--page", str(page)]) == 3
    said = capsys.readouterr().out
    assert "Likely mistake: poses inverted" in said
    assert f"{out}: the corrected cameras" in said
    assert "given cameras" in page.read_text()
    right, fixed = open_scene(demo_scene()), open_scene(out, needs_labels=False)
    for expected, frame in zip(right.frames, fixed.frames, strict=True):
        np.testing.assert_allclose(frame.world_from_camera, expected.world_from_camera, atol=1e-6)
        assert (frame.lens, frame.name) == (expected.lens, f"scene/{expected.name}")
        measured, truth = frame.measured(), expected.measured()
        assert measured is not None
        np.testing.assert_array_equal(measured, truth)
    assert fixed.unit == "metric"
    assert main(["doctor", str(out)]) == 0


def test_a_scene_with_one_usable_frame_ends_with_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = copied(tmp_path / "scene", lambda described: described.update(frames=described["frames"][:1]))
    assert main(["doctor", str(scene)]) == 2
    assert "expected at least two usable frames, found 1" in capsys.readouterr().err


@pytest.mark.long
def test_the_unit_of_depth_is_corrected(tmp_path: Path) -> None:
    scene = copied(tmp_path / "scene", lambda described: described.update(depth_unit_scale_factor=0.1))
    out = scene / "fixed.json"
    assert main(["doctor", str(scene), "--fix", str(out)]) == 3
    assert json.loads(out.read_text())["frames"][0]["depth_unit_scale_factor"] == pytest.approx(0.001)


def test_nothing_is_written_if_nothing_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "fixed.json"
    assert main(["doctor", str(demo_scene()), "--fix", str(out)]) == 0
    assert not out.exists()
    assert f"{out} was not written" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--fix", "fixed.txt"], "expected a file name that ends with .json"),
        (["--page", "page.txt"], "expected a file name that ends with .html"),
        (["--fix", "there.json"], "use --overwrite to replace it"),
        (["--fix", "nowhere/fixed.json"], "nowhere"),
    ],
)
def test_bad_options_end_with_2_and_one_line(
    options: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.json").write_text("{}")
    assert main(["doctor", str(demo_scene()), *options]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_damaged_image_and_a_missing_scene_end_with_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = copied(tmp_path / "scene", lambda described: None)
    first = scene / json.loads((scene / "transforms.json").read_text())["frames"][0]["file_path"]
    first.write_bytes(first.read_bytes()[:2000])
    assert main(["doctor", str(scene)]) == 2
    assert main(["doctor", str(tmp_path / "nothing")]) == 2
    assert capsys.readouterr().err.count("\n") == 2


def test_normalised_intrinsics_are_named_as_such(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def normalise(described: dict) -> None:
        described["fl_x"], described["cx"] = described["fl_x"] / described["w"], described["cx"] / described["w"]
        described["fl_y"], described["cy"] = described["fl_y"] / described["h"], described["cy"] / described["h"]

    assert main(["doctor", str(copied(tmp_path / "scene", normalise))]) == 2
    assert "divided by the image size" in capsys.readouterr().err

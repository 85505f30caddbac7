"""`semgs reconstruct --rerun`, read by Rerun's own reader."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from turned_cameras import write_scene

import semgs
import semgs.run.output.rerun_file
from semgs.cli.main import main

pytest.importorskip("rerun")


@dataclass(frozen=True)
class Done:
    """A walk of six frames that was reconstructed, its recording for Rerun, and what was printed about it."""

    out: Path
    file: Path
    report: dict


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Done:
    """Not to be changed."""
    folder = tmp_path_factory.mktemp("rerun")

    def far(scene: dict) -> None:
        for number, frame in enumerate(scene["frames"]):
            frame["transform_matrix"][0][3] += 0.3 * number

    scene = write_scene(folder / "scene", far, frames=6)
    out, file = folder / "out", folder / "walk.rrd"
    assert (
        main(["reconstruct", str(scene), "--out", str(out), "--weights", "random", "--all", "--rerun", str(file)]) == 0
    )
    return Done(out, file, json.loads((out / "report.json").read_text()))


def logged(file: Path, entity: str, component: str) -> dict[int | None, list]:
    """What was logged to an entity, by frame; None for what is there at all times."""
    from rerun.chunk import RrdReader

    found = {}
    for chunk in RrdReader(file).stream():
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and component in batch.schema.names:
            times = [None] if chunk.is_static else batch.column("frame").to_pylist()
            found |= dict(zip(times, batch.column(component).to_pylist(), strict=True))
    return found


@pytest.mark.long
def test_rerun_verifies_the_file_and_finds_the_entities_on_one_timeline(done: Done) -> None:
    from rerun.chunk import RrdReader

    told = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", done.file],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert told.returncode == 0, told.stderr
    assert "verified without error" in told.stdout + told.stderr
    entities, timelines = defaultdict(int), set()
    for chunk in RrdReader(done.file).stream():
        entities[chunk.entity_path] += 1
        timelines |= set(chunk.timeline_names)
    keyframes = done.report["choice"]["context"]
    expected = {"/world", "/world/camera", "/world/camera/photo", "/world/camera/classes", "/world/path"}
    expected |= {f"/world/{kind}/{number}" for kind in ("splats", "labels") for number in keyframes}
    assert expected <= set(entities)
    assert set(entities) - expected <= {"/world/things", "/world/floor"}
    assert timelines == {"frame"}
    assert [path.name for path in done.file.parent.iterdir() if path.is_file()] == ["walk.rrd"]


def test_photos_cameras_and_class_maps_are_at_their_frames(done: Done) -> None:
    frames = sorted(done.report["choice"]["context"] + done.report["choice"]["targets"])
    for entity, component in (("photo", "EncodedImage:blob"), ("classes", "SegmentationImage:buffer")):
        assert sorted(logged(done.file, f"/world/camera/{entity}", component)) == frames
    places = logged(done.file, "/world/camera", "Transform3D:translation")
    lenses = logged(done.file, "/world/camera", "Pinhole:image_from_camera")
    scene = semgs.load_scene(done.out)
    for view, number in enumerate(done.report["choice"]["context"]):
        np.testing.assert_allclose(places[number][0], scene.cameras.centres[view], rtol=1e-6)
        np.testing.assert_allclose(np.reshape(lenses[number][0], (3, 3)).T, scene.cameras.intrinsics[view], rtol=1e-6)


def test_each_gaussian_appears_once_at_the_frame_that_it_belongs_to(done: Done) -> None:
    scene = semgs.load_scene(done.out)
    for view, number in enumerate(done.report["choice"]["context"]):
        own = (scene.own_views == view).numpy()
        centres = logged(done.file, f"/world/splats/{number}", "GaussianSplats3D:centers")
        assert list(centres) == [number]
        np.testing.assert_array_equal(np.float32(centres[number]), scene.gaussians.means.numpy()[own])
        (turns,) = logged(done.file, f"/world/splats/{number}", "GaussianSplats3D:quaternions").values()
        wxyz = np.float32(turns)[:, [3, 0, 1, 2]]
        np.testing.assert_array_equal(wxyz, scene.gaussians.colour.quaternions.numpy()[own])
        (colours,) = logged(done.file, f"/world/splats/{number}", "GaussianSplats3D:colors").values()
        opacities = np.array(colours) & 255  # 0xrrggbbaa
        np.testing.assert_allclose(opacities / 255, scene.gaussians.opacities.numpy()[own], atol=0.51 / 255)
        (labels,) = logged(done.file, f"/world/labels/{number}", "Points3D:class_ids").values()
        assert labels == scene.gaussians.semantic.features[own].argmax(-1).tolist()


def test_what_cannot_be_found_is_a_note_and_no_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = write_scene(tmp_path / "scene", lambda scene: scene.pop("metric"))
    options = ["--weights", "random", "--rerun", str(tmp_path / "out" / "window.rrd")]
    assert main(["reconstruct", str(scene), "--out", str(tmp_path / "out"), *options]) == 0
    printed = capsys.readouterr().out
    assert "The Rerun file has no boxes: the unit of the scene is unknown" in printed
    assert "The Rerun file has no free floor: the unit of the scene is unknown" in printed
    assert (tmp_path / "out" / "window.rrd").stat().st_size > 0


def refused(capsys: pytest.CaptureFixture[str], scene: Path, file: Path) -> str:
    """The line with which the command refuses a file."""
    out = scene.parent / "out"
    assert main(["reconstruct", str(scene), "--out", str(out), "--rerun", str(file)]) == 2
    assert not out.exists()
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.strip()]
    return line


def test_without_rerun_the_extra_is_named_before_work_starts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = write_scene(tmp_path / "scene")
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert "--rerun needs rerun-sdk: pip install -e '.[rerun]'" in refused(capsys, scene, tmp_path / "walk.rrd")


def test_files_that_cannot_be_written_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = write_scene(tmp_path / "scene")
    assert "expected a file that ends in .rrd" in refused(capsys, scene, tmp_path / "walk.mp4")
    assert "no such folder" in refused(capsys, scene, tmp_path / "nowhere" / "walk.rrd")
    not_utf8 = tmp_path / os.fsdecode(b"k\xfcche.rrd")
    assert "expected a path in UTF-8, as Rerun needs it" in refused(capsys, scene, not_utf8)


def test_a_file_is_replaced_only_with_overwrite(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, file = write_scene(tmp_path / "scene"), tmp_path / "walk.rrd"
    file.write_bytes(b"mine")
    line = refused(capsys, scene, file)
    assert line.endswith("walk.rrd: expected a new file, found one that exists; use --overwrite to replace it")
    assert file.read_bytes() == b"mine"
    options = ["--weights", "random", "--rerun", str(file), "--overwrite"]
    assert main(["reconstruct", str(scene), "--out", str(tmp_path / "out"), *options]) == 0
    assert file.read_bytes().startswith(b"RRF")


def test_a_file_that_fails_halfway_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = write_scene(tmp_path / "scene")

    def fails(*_: object) -> None:
        raise RuntimeError("halfway")

    monkeypatch.setattr(semgs.run.output.rerun_file, "_write_found", fails)
    with pytest.raises(RuntimeError, match="halfway"):
        main(
            [
                "reconstruct",
                str(scene),
                "--out",
                str(tmp_path / "out"),
                "--rerun",
                str(tmp_path / "walk.rrd"),
                "--weights",
                "random",
            ]
        )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "scene"]

"""`semgs prepare`: what it writes, says and refuses."""

from __future__ import annotations

import errno
import zipfile
from pathlib import Path

import pytest
from turned_cameras import write_scene

from semgs.cli.main import main
from semgs.data.preparation import archive, prepared_set
from semgs.data.scenes import open_scene
from semgs.run.prepare import _size


@pytest.fixture
def scenes(tmp_path: Path) -> Path:
    """A folder of two small scenes, its name with a space."""
    for name in ("a", "b"):
        write_scene(tmp_path / "my scenes" / name, frames=3)
    return tmp_path / "my scenes"


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The line that a command line is refused with."""
    assert main(["prepare", *map(str, arguments)]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.startswith("semgs: error: ")
    assert told.err.count("\n") == 1
    return told.err


def test_scenes_become_archives_that_semgs_reads(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["prepare", str(scenes), "--out", str(out), "--size", "32x48", "--workers", "0"]) == 0
    told = capsys.readouterr()
    assert told.out.startswith(f"{out}: 2 scenes, 6 frames, ")
    assert f"semgs reconstruct {out / 'a.zip'} --out DIR" in told.out
    assert told.err == ""
    assert {path.name for path in out.iterdir()} == {
        "a.zip",
        "b.zip",
        "index.json",
        "settings.json",
        "SHA256SUMS",
        ".lock",
    }
    scene = open_scene(out / "b.zip")
    assert (scene.name, len(scene), scene.frames[0].lens.size) == ("b", 3, (32, 48))


def test_one_scene_is_enough_and_what_fails_is_told(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["prepare", str(scenes / "a"), str(tmp_path / "one"), "--size", "32x48"]) == 0
    (scenes / "b" / "images" / "001.png").write_bytes(b"\x89PNG cut short")
    assert main(["prepare", str(scenes), str(tmp_path / "two"), "--size", "32x48", "--workers", "0"]) == 0
    told = capsys.readouterr().out
    assert "two: 1 scene, 3 frames" in told
    assert "left out: b: " in told
    assert "001.png: expected a JPEG or PNG image" in told


def test_what_cannot_be_is_refused_and_nothing_is_written(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    (tmp_path / "split.txt").write_text("\n")
    assert "found an empty list" in refused(capsys, scenes, out, "--scenes", tmp_path / "split.txt")
    assert "nothing there" in refused(capsys, tmp_path / "nowhere", out)
    told = refused(capsys, _made(tmp_path / "empty"), out)
    assert "expected a scene or a folder of scenes, found no known layout; the folder is empty" in told
    assert "--every: expected a whole number, 1 or more" in refused(capsys, scenes, out, "--every", 0)
    assert "--size: expected height x width in pixels, such as 240x320, found 'auto'" in refused(
        capsys, scenes, out, "--size", "auto"
    )
    assert "--workers: expected a whole number, 0 or more" in refused(capsys, scenes, out, "--workers", -1)
    assert (
        "intrinsics: expected RGB-D frames, Replica, a phone's capture or a ROS bag, found layout transforms.json; leave it"
        in refused(capsys, scenes, out, "--intrinsics", 60, 60, 32, 24)
    )
    assert "expected fx, fy, cx, cy in pixels, fx and fy positive" in refused(
        capsys, scenes, out, "--intrinsics", 0, 1, 2, 3
    )
    assert "a new or empty folder" in refused(capsys, scenes, scenes)
    monkeypatch.setattr(prepared_set, "free_space", lambda path: 2000)
    assert "needs about" in (line := refused(capsys, scenes, out))
    assert "2 kB are free; free some" in line
    assert not out.exists()


def test_a_disk_that_fills_up_leaves_what_is_complete_and_no_part(
    scenes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    monkeypatch.setattr(prepared_set.PreparedSet, "needed_space", lambda *given: 0)
    written = archive._write

    def until_the_second_scene(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
        if (out / "a.zip").exists():
            raise OSError(errno.ENOSPC, "No space left on device", "b.zip")
        written(archive, name, data)

    monkeypatch.setattr(archive, "_write", until_the_second_scene)
    line = refused(capsys, scenes, out, "--size", "32x48", "--workers", 0)
    assert "the disk is full (b.zip); free some space or write elsewhere" in line
    assert {path.name for path in out.iterdir()} == {"a.zip", "settings.json", ".lock"}
    monkeypatch.setattr(archive, "_write", written)
    assert main(["prepare", str(scenes), str(out), "--size", "32x48", "--workers", "0"]) == 0


def test_sizes_are_told_as_people_say_them() -> None:
    assert [_size(count) for count in (0, 999, 1000, 123456, 4_560_000_000, 7 * 10**12)] == [
        "0 bytes", "999 bytes", "1 kB", "123 kB", "4.56 GB", "7 TB",
    ]  # fmt: skip


def _made(path: Path) -> Path:
    """A new folder."""
    path.mkdir()
    return path

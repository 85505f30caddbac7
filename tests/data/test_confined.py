"""In a confined process, names from data lead to nothing outside of its folder, and no file there is touched."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path

import pytest

from semgs.data.confined import VARIABLE, check_inside, confine_to, may_read, named_file
from semgs.files.errors import InputError


@pytest.fixture
def scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder to which this process is confined, with a folder `views` in it, beside a secret."""
    monkeypatch.setenv(VARIABLE, "")
    (tmp_path / "secret.png").write_bytes(b"x")
    (tmp_path / "scene2").mkdir()
    (tmp_path / "scene/views/images").mkdir(parents=True)
    (tmp_path / "scene/images").mkdir()
    (tmp_path / "scene/images/0.png").write_bytes(b"x")
    monkeypatch.chdir(tmp_path)
    confine_to(Path("scene"))
    return tmp_path / "scene"


OUTSIDE = {
    "absolute": "/etc/passwd",
    "absolute with two slashes": "//etc/passwd",
    "of the process": "/proc/self/environ",
    "a device": "/dev/zero",
    "climbing": "../../secret.png",
    "climbing, then back": "../../scene/images/0.png",
    "climbing far, then back": "../../../../../../etc/../tmp/scene/images/0.png",
    "climbing behind a folder": "images/../../../secret.png",
    "climbing behind nothing": "none/../../../secret.png",
    "climbing as on Windows": "..\\..\\secret.png",
    "a neighbour of the same beginning": "../../scene2/0.png",
    "a home": "~/secret.png",
    "another's home": "~root/secret.png",
    "an address": "http://127.0.0.1/a.png",
    "a file's address": "file:///etc/passwd",
    "a zero byte": "images/0.png\0.jpg",
    "a long name": "a" * 300,
    "a long path": "a/" * 3000,
}


@pytest.mark.parametrize("name", OUTSIDE.values(), ids=OUTSIDE)
def test_names_that_lead_outside_are_refused_before_anything_there_is_touched(
    scene: Path, name: str, monkeypatch: pytest.MonkeyPatch
):
    touched: list[Path] = []
    ask = os.lstat

    def ask_and_note(path: str, *rest: object, **more: object) -> os.stat_result:
        touched.append(Path.cwd() / path)
        return ask(path, *rest, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(os, "lstat", ask_and_note)
    with pytest.raises(InputError) as raised:
        named_file("transforms.json", Path("scene/views"), name)
    assert str(raised.value).startswith("transforms.json: expected names of files inside the scene's folder, found '")
    assert len(str(raised.value)) < 200
    assert [path for path in touched if not path.is_relative_to(scene) and path not in scene.parents] == []


@pytest.mark.parametrize(
    "name", ["images/0.png", "./images/0.png", "../images/0.png", "images/../../images/0.png", "none.png", "a~b.png", "..a/..b", "a..png"]
)  # fmt: skip
@pytest.mark.parametrize("folder", [Path("scene/views"), Path("scene/../scene/views")])
def test_names_inside_are_joined_as_they_are(scene: Path, folder: Path, name: str):
    assert named_file("transforms.json", folder, name) == folder / name


def test_links_inside_are_followed_and_those_that_lead_outside_are_not(scene: Path):
    (scene / "good.png").symlink_to(scene / "images/0.png")
    (scene / "bad.png").symlink_to(scene.parent / "secret.png")
    (scene / "up").symlink_to(scene.parent)
    assert named_file("a.txt", scene, "good.png") == scene / "good.png"
    for name in ("bad.png", "up/secret.png"):
        with pytest.raises(InputError):
            named_file("a.txt", scene, name)


def test_a_process_that_is_not_confined_reads_what_data_name(scene: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delenv(VARIABLE)
    assert named_file("a.txt", scene, "../secret.png") == scene / "../secret.png"
    assert named_file("a.txt", scene, "/etc/passwd") == Path("/etc/passwd")
    assert may_read(scene.parent)
    check_inside(scene, Content((scene.parent,)))


def test_the_folder_may_be_named_by_a_user(scene: Path, monkeypatch: pytest.MonkeyPatch):
    (scene.parent / "link").symlink_to(scene)
    for folder in ("scene", "link", "./scene/", f"{scene}/images/.."):
        monkeypatch.setenv(VARIABLE, folder)
        assert named_file("a.txt", scene, "images/0.png") == scene / "images/0.png"
        with pytest.raises(InputError):
            named_file("a.txt", scene, "../secret.png")


def test_places_above_are_searched_unless_they_are_outside(scene: Path):
    assert may_read(scene / "views")
    assert may_read(scene)
    assert not may_read(scene.parent)
    assert not may_read(scene.parent / "scene2")


@dataclass(frozen=True)
class Content:
    parts: object


@pytest.mark.parametrize(
    "wrap",
    [
        lambda path: Content(path),
        lambda path: Content((Content(None), Content([path]))),
        lambda path: (Content({"a": path}),),
        lambda path: Content({path: 1}),
    ],
)
def test_a_path_that_leads_outside_is_found_anywhere_in_data(scene: Path, wrap):
    check_inside(scene, wrap(scene / "images/0.png"))
    for path in (scene.parent / "secret.png", Path("/dev/zero"), Path("scene/../secret.png")):
        with pytest.raises(InputError, match="found one that leads out of it"):
            check_inside(scene, wrap(path))


def test_threads_and_child_processes_are_confined_too(scene: Path):
    refused: list[bool] = []
    thread = threading.Thread(target=lambda: refused.append(not may_read(scene.parent)))
    thread.start()
    thread.join()
    line = f"from pathlib import Path; from semgs.data.confined import may_read; print(may_read(Path({str(scene.parent)!r})))"
    root = Path(__file__).resolve().parents[2]
    told = subprocess.run(
        [sys.executable, "-c", line], capture_output=True, text=True, check=True, cwd=root, timeout=60
    )
    assert (refused, told.stdout.strip()) == ([True], "False")

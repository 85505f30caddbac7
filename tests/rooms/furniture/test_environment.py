"""Making the environment, with a stand-in for Python 3.11: what is said, what is made anew, what one is told when it fails."""

from __future__ import annotations

from pathlib import Path

import pytest

from semgs.files.errors import InputError
from semgs_rooms.furniture import environment
from semgs_rooms.furniture.environment import default_folder, find_python, is_ready, prepare, python_of

PYTHON = """#!/bin/sh
case "$*" in
    *version_info*) echo {version} ;;
    "-m venv "*) mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
    "-m pip "*) echo "$*"; {pip} ;;
    *"import bpy"*) {blender} ;;
esac
"""


@pytest.fixture
def python(tmp_path: Path):
    """Writes a program that acts as a Python, whose pip and Blender do as they are told."""

    def write(version: str = "3 11", pip: str = "true", blender: str = "true") -> str:
        path = tmp_path / "python3.11"
        path.write_text(PYTHON.format(version=version, pip=pip, blender=blender))
        path.chmod(0o755)
        return str(path)

    return write


def test_it_is_made_once_and_what_it_takes_is_said_before(tmp_path, python):
    folder, said = tmp_path / "env", []
    prepare(folder, python(pip="test ! -e $(dirname $0)/../../said"), said.append)
    assert python_of(folder).exists()
    (line,) = said
    assert str(folder) in line
    assert f"{environment.DOWNLOAD_MB} MB to download" in line
    assert "GPL" in line
    log = (folder / environment.LOG).read_text()
    assert "--no-deps" in log
    assert "--only-binary :all:" in log
    assert "requirements.txt" in log
    assert is_ready(folder)
    prepare(folder, python(pip="exit 1"), said.append)
    assert len(said) == 1


@pytest.mark.parametrize(
    ("how", "told"),
    [
        ({"pip": "echo 'ERROR: No matching distribution found for bpy==4.2.0'; echo bye; exit 1"}, "bpy==4.2.0; see"),
        (
            {"blender": "echo 'ImportError: libXi.so.6: cannot open'; exit 1"},
            r"importable, found ImportError: libXi\.so\.6",
        ),
        ({"blender": "sleep 60"}, "nothing after 1 s"),
    ],
)
def test_what_fails_is_one_line_and_the_next_call_makes_it_anew(tmp_path, python, monkeypatch, how, told):
    folder = tmp_path / "env"
    with monkeypatch.context() as patched:
        if told == "nothing after 1 s":  # the others have as long as they need
            patched.setattr(environment, "PATIENCE", 1.0)
        with pytest.raises(InputError, match=told) as caught:
            prepare(folder, python(**how))
    assert "\n" not in str(caught.value)
    assert not is_ready(folder)
    (folder / "half").write_text("left behind")
    prepare(folder, python())
    assert is_ready(folder)
    assert not (folder / "half").exists()


def test_other_pins_make_it_anew(tmp_path, python, monkeypatch):
    folder = tmp_path / "env"
    prepare(folder, python())
    before = default_folder()
    monkeypatch.setattr(environment, "_pins", lambda: "0" * 64)
    assert not is_ready(folder)
    assert default_folder() != before


def test_a_folder_of_something_else_is_left_alone(tmp_path, python):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("")
    with pytest.raises(InputError, match="something else"):
        prepare(tmp_path / "mine", python())
    assert (tmp_path / "mine" / "thesis.txt").exists()


def test_another_python_is_refused_with_the_one_that_is_needed(python, tmp_path):
    with pytest.raises(InputError, match=r"expected Python 3\.11.*--python /path/to/python3\.11"):
        find_python(python(version="3 12"))
    with pytest.raises(InputError, match=r"nowhere.*expected Python 3\.11"):
        find_python(str(tmp_path / "nowhere"))
    assert find_python(python()) == python()


def test_the_disk_must_have_room(tmp_path, python, monkeypatch):
    monkeypatch.setattr(environment, "DISK_GB", 1e9)
    with pytest.raises(InputError, match="GB of free disk"):
        prepare(tmp_path / "env", python())


def test_every_package_is_pinned():
    lines = (Path(environment.__file__).parent / "requirements.txt").read_text().splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert {"bpy==4.2.0", "infinigen==1.15.5", "numpy==1.26.4"} <= set(pins)
    assert all(line.count("==") == 1 for line in pins)


def test_nothing_of_ours_reaches_the_other_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("PYTHONPATH", "/ours")
    monkeypatch.setenv("VIRTUAL_ENV", "/ours")
    monkeypatch.setenv("BLENDER_USER_RESOURCES", "/mine")
    seen = environment.surroundings(tmp_path)
    assert "PYTHONPATH" not in seen
    assert "VIRTUAL_ENV" not in seen
    assert seen["BLENDER_USER_RESOURCES"] == str(tmp_path / "blender")

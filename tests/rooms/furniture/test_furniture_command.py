"""`python -m semgs_rooms.furniture`: with an environment that a program of the tests stands in for, and one line for what cannot be."""

from __future__ import annotations

import errno
import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("embreex")

from semgs.cli import main as semgs
from semgs_rooms.furniture import environment
from semgs_rooms.furniture.__main__ import main
from semgs_rooms.furniture.kinds import make_job

SEED = next(seed for seed in range(1000) if make_job(seed, 0).kind == "sidetable")


@pytest.fixture
def environment_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """One that is ready, and whose Python makes a table for any job."""
    stand_in = Path(__file__).with_name("stand_in.py")
    folder = tmp_path / "environment"
    (folder / "bin").mkdir(parents=True)
    (folder / "bin" / "python").write_text(f'#!/bin/sh\nexec "{sys.executable}" "{stand_in}" "$@"\n')
    (folder / "bin" / "python").chmod(0o755)
    (folder / environment.STAMP).write_text(environment._pins())
    told = {"sizes": {"sidetable": [0.5, 0.5, 0.55]}, "ways": {}, "calls": str(folder / "calls")}
    monkeypatch.setenv("STAND_IN", json.dumps(told))
    return folder


@pytest.mark.long
def test_it_generates_reports_what_there_is_and_rooms_take_it(
    tmp_path: Path, environment_folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "furniture"
    asked = ["--out", str(out), "--seed", str(SEED), "--pieces", "1", "--environment", str(environment_folder)]
    assert main(asked) == 0
    told = capsys.readouterr()
    assert told.err == ""
    assert f"{out}: 1 pieces of seed {SEED} (table 1)" in told.out
    assert f"semgs rooms --out OUT --assets {out}" in told.out
    rooms = ["--scenes", "1", "--size", "32x48", "--frames", "2", "--workers", "0", "--assets", str(out)]
    assert semgs.main(["rooms", str(tmp_path / "rooms"), *rooms]) == 0
    settings = json.loads((tmp_path / "rooms" / "settings.json").read_text())
    assert settings["assets"].startswith("lock ")
    (mesh,) = (out / "models").iterdir()
    mesh.write_bytes(b"")
    capsys.readouterr()
    assert semgs.main(["rooms", str(tmp_path / "rooms"), *rooms]) == 2
    assert f"1 altered: models/{mesh.name}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--pieces", "0"], "pieces 0"),
        (["--seed", "-1"], "seed is -1"),
        (["--limit", "0"], "--limit is 0"),
        (["--workers", "0"], "--workers 0"),
        (["--environment", "MINE"], "something else"),
        (["--environment", "NEW", "--python", "/nowhere/python3.11"], "expected Python 3.11"),
    ],
)
def test_what_cannot_be_ends_with_2_and_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], told: str
) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("")
    folders = {"MINE": str(tmp_path / "mine"), "NEW": str(tmp_path / "new")}
    assert main(["--out", str(tmp_path / "out"), *(folders.get(word, word) for word in arguments)]) == 2
    err = capsys.readouterr().err
    assert told in err
    assert err.count("\n") == 1


def test_an_environment_that_cannot_be_installed_ends_with_2_and_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    python = tmp_path / "python3.11"
    python.write_text(
        '#!/bin/sh\ncase "$*" in *version_info*) echo 3 11;; "-m venv "*) mkdir -p "$3/bin"; cp "$0" "$3/bin/python";; '
        '"-m pip "*) echo "ERROR: Could not find a version that satisfies the requirement bpy==4.2.0"; exit 1;; esac\n'
    )
    python.chmod(0o755)
    asked = [str(tmp_path / "out"), "--environment", str(tmp_path / "env"), "--python", str(python)]
    assert main(asked) == 2
    told = capsys.readouterr()
    assert "MB to download" in told.out
    assert told.err.count("\n") == 1
    assert "bpy==4.2.0" in told.err
    assert "install.log" in told.err


def test_its_help_and_that_of_rooms_name_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    assert semgs.main(["rooms", "--help"]) == 0
    assert "python -m semgs_rooms.furniture" in capsys.readouterr().out
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    assert "Usage: python -m semgs_rooms.furniture" in told
    assert "semgs rooms --assets" in told


def test_a_folder_that_may_not_be_written_ends_with_2_and_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(tmp_path / "out"))

    monkeypatch.setattr(Path, "mkdir", refuse)
    assert main([str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == f"semgs: error: {tmp_path / 'out'}: Permission denied\n"


def test_the_program_needs_nothing_of_ours() -> None:
    """It is started in an environment that has no semgs, and its head imports nothing but the standard library."""
    path = Path(environment.__file__).with_name("program.py")
    program = "import sys, runpy; runpy.run_path(sys.argv[1], run_name='x'); print(sorted({'semgs', 'numpy', 'bpy'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-I", "-c", program, str(path)], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert "semgs" not in [
        line.split()[1] for line in path.read_text().splitlines() if line.lstrip().startswith(("import ", "from "))
    ]

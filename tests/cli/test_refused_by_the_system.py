"""What the system refuses, or does in the middle: exit code 2 (or that of the signal) and one line, never a traceback."""

from __future__ import annotations

import errno
import io
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from paper_commands import main
from privileges import permissions_hold

from semgs.cli.arguments import parse
from semgs.cli.commands.scenes.demo import Demo
from semgs.cli.terminal import Printable
from semgs.files.folders import lock_folder
from semgs.run.usage_errors import line_for

Told = Callable[..., str]


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str]) -> Told:
    """Runs a command that must be refused, where permissions hold; the line without its beginning."""

    def run(*arguments: object) -> str:
        capsys.readouterr()
        with permissions_hold():
            assert main([str(one) for one in arguments]) == 2
        line = capsys.readouterr().err
        assert line.startswith("semgs: error: ")
        assert line.count("\n") == 1
        return line.removeprefix("semgs: error: ").rstrip()

    return run


@pytest.fixture
def closed(tmp_path: Path) -> Path:
    """A folder that nothing can be written into."""
    (tmp_path / "closed").mkdir(mode=0o500)
    return tmp_path / "closed"


def test_every_command_that_writes_says_so_before_the_work_where_it_cannot(
    room: Path, closed: Path, told: Told
) -> None:
    for name, *command in (
        ("new", "reconstruct", room, "--weights", "random", "--out"),
        ("new", "evaluate", "small", "--data", room, "--out"),
        ("new", "figure", "qualitative", "--weights", "small", "--data", room, "--out"),
        ("new", "demo", "--out"),
        ("new.json", "bench", "--quick", "--json"),
        ("new.safetensors", "weights", "calibrate", "small", "--data", room, "--out"),
        ("new.png", "rooms", "--sheet"),
        ("new", "prepare", room),
    ):
        line = told(*command, closed / name)
        assert "found Permission denied" in line, command
        assert str(closed) in line, command
    for command in (("rooms",), ("train", "small", "--out")):
        assert told(*command, closed / "new") == f"{closed / 'new'}: Permission denied"
    assert list(closed.iterdir()) == []


def test_a_data_set_that_can_no_longer_be_written_is_not_gone_on_with(room: Path, tmp_path: Path, told: Told) -> None:
    out = tmp_path / "set"
    assert main(["prepare", str(room), str(out), "--size", "32x48", "--workers", "0"]) == 0
    out.chmod(0o500)
    assert "Permission denied" in told("prepare", room, out, "--size", "32x48", "--workers", "0")


def test_a_second_prepare_into_a_folder_is_told_before_it_works(room: Path, tmp_path: Path, told: Told) -> None:
    out = tmp_path / "set"
    command = ("prepare", room, out, "--size", "32x48", "--workers", "0")
    assert main([str(one) for one in command]) == 0
    part = out / ".room.zip.0123abcd.part"
    part.touch()
    with lock_folder(out, "", ""):
        assert told(*command) == (
            f"{out}: expected a folder that no other process prepares scenes into, found one in use; "
            "stop that process first, or name another folder"
        )
        assert part.exists(), "what the other is writing is cleared away"
    assert main([str(one) for one in command]) == 0
    assert not part.exists()


def test_what_may_not_be_read_is_named(scene: Path, tmp_path: Path, told: Told) -> None:
    out = ("--out", tmp_path / "out")
    weights = tmp_path / "mine.safetensors"
    weights.touch(mode=0o000)
    assert told("reconstruct", scene, *out, "--weights", weights) == (
        f"{weights}: expected something that can be read, found Permission denied"
    )
    assert "mine.safetensors: expected something that can be read" in told("weights", weights)
    picture = next((scene / "images").iterdir())
    picture.chmod(0o000)
    assert picture.name in told("reconstruct", scene, *out, "--weights", "random")
    (scene / "images").chmod(0o600)
    assert "images" in told("reconstruct", scene, *out, "--weights", "random")
    scene.chmod(0o600)
    assert told("reconstruct", scene, *out).endswith("found Permission denied")
    scene.chmod(0o700)
    (scene / "images").chmod(0o700)


def test_names_too_long_for_the_system_are_refused(scene: Path, tmp_path: Path, told: Told) -> None:
    long = tmp_path / ("n" * 256)
    for command in (
        ("reconstruct", long, "--out", tmp_path / "out"),
        ("reconstruct", scene, "--out", long),
        ("reconstruct", scene, "--out", tmp_path / "out", "--weights", long),
        ("rooms", long),
        ("weights", long),
        ("compare", long),
    ):
        assert "n" * 256 in told(*command), command
    content = json.loads((scene / "transforms.json").read_text())
    content["frames"][0]["file_path"] = f"images/{'n' * 256}.png"
    (scene / "transforms.json").write_text(json.dumps(content))
    assert "File name too long" in told("reconstruct", scene, "--out", tmp_path / "out", "--weights", "random")


def test_a_limit_on_the_size_of_files_is_told(room: Path, tmp_path: Path, told: Told) -> None:
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        line = told("prepare", room, tmp_path / "set", "--size", "32x48", "--workers", "0")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert "File too large; raise the limit on the size of files (ulimit -f)" in line
    assert {path.name for path in (tmp_path / "set").iterdir()} == {"settings.json", ".lock"}


def test_no_memory_and_other_refusals_have_a_line_and_faults_of_ours_have_none() -> None:
    memory = "there is not enough memory; free some memory, or raise the limit on it (ulimit -v)"
    for allocate in (lambda: torch.empty(2**50), lambda: np.empty(2**55), lambda: bytearray(2**60)):
        with pytest.raises((RuntimeError, MemoryError)) as caught:
            allocate()
        assert line_for(caught.value) == memory
    assert line_for(OSError(errno.EIO, "Input/output error", "a.png")) == "a.png: Input/output error"
    assert (
        line_for(OSError(errno.ENOSPC, "No space left on device"))
        == "the disk is full; free some space or write elsewhere"
    )
    for fault in (
        ValueError("a fault"),
        RuntimeError("a fault"),
        ImportError("a fault"),
        FileNotFoundError(errno.ENOENT, "gone"),
    ):
        assert line_for(fault) is None


def test_hostile_names_reach_neither_terminal_nor_report(
    broken: Callable[..., Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = os.fsdecode(b"\xff\x1b[31mred")

    def renamed(scene: dict) -> None:
        for frame in scene["frames"]:
            new = frame["file_path"].replace("images/", f"images/{name}")
            (tmp_path / "scene" / frame["file_path"]).rename(tmp_path / "scene" / new)
            frame["file_path"] = new

    scene = broken(renamed).rename(tmp_path / name)
    out = tmp_path / f"{name}.out"
    assert main(["reconstruct", str(scene), "--out", str(out), "--weights", "random"]) == 0
    shown = capsys.readouterr().out
    assert "\\udcff\\x1b[31mred" in shown
    page = (out / "report.html").read_bytes()
    assert b"\\udcff\\x1b[31mred" in page
    assert "\x1b" not in shown
    assert b"\x1b" not in page
    assert json.loads((out / "report.json").read_text(encoding="utf-8"))["scene"]["name"] == name


def test_a_hostile_name_of_a_folder_is_prepared_into_and_shown_but_not_trained_into(
    room: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / os.fsdecode(b"\xff\x1b[31mred")
    assert main(["prepare", str(room), str(out), "--size", "32x48", "--workers", "0"]) == 0
    assert [path.name for path in out.glob("*.zip")] == ["room.zip"]
    shown = capsys.readouterr().out
    assert "\\udcff\\x1b[31mred: 1 scene, 4 frames" in shown
    assert "\x1b" not in shown
    assert main(["train", "small", "--out", str(out / "run")]) == 2
    assert "expected a path in UTF-8, as TensorBoard needs it" in capsys.readouterr().err


def test_output_is_shown_and_not_obeyed() -> None:
    stream = io.StringIO()
    print("a\x1b[2Jb", "c", file=Printable(stream))
    assert stream.getvalue() == "a\\x1b[2Jb c\n"


def test_deleting_the_stream_that_escapes_does_not_touch_the_one_below() -> None:
    stream = io.StringIO()
    plain = Printable(stream)
    stream.close()
    plain.close()  # as Python does when it deletes one


def run_process(program: str, redirected: str = "", **environment: str) -> subprocess.CompletedProcess[bytes]:
    """Runs a program in a shell with stdout or stderr closed or elsewhere."""
    return subprocess.run(
        ["sh", "-c", f'exec "$0" -c "$1" {redirected}', sys.executable, program],
        capture_output=True, check=False, env={**os.environ, **environment},
    )  # fmt: skip


VERSION = "import sys; from semgs.cli.main import main; sys.argv[1:] = ['--version']; sys.exit(main())"


@pytest.mark.parametrize("redirected", [">&-", ">&- 2>&-", "2>&-"])
def test_a_closed_stream_is_no_error(redirected: str) -> None:
    done = run_process(VERSION, redirected)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
def test_a_full_disk_behind_stdout_is_told_once() -> None:
    done = run_process(VERSION, ">/dev/full")
    assert (done.returncode, done.stderr) == (
        2,
        b"semgs: error: the disk is full; free some space or write elsewhere\n",
    )


def test_letters_that_the_terminals_encoding_lacks_are_escaped() -> None:
    program = "from semgs.cli.terminal import open_streams; open_streams(); print('K\\u00fcche \\u2020')"
    done = run_process(program, PYTHONIOENCODING="ascii")
    assert (done.returncode, done.stdout, done.stderr) == (0, b"K\\xfcche \\u2020\n", b"")


@pytest.mark.parametrize(("sent", "code", "line"), [("SIGINT", 130, b"semgs: interrupted\n"), ("SIGTERM", 143, b"")])
def test_a_signal_during_the_first_imports_ends_without_a_traceback(
    tmp_path: Path, sent: str, code: int, line: bytes
) -> None:
    """What parses arguments is imported first of what takes time: here a module of its name interrupts instead."""
    (tmp_path / "cyclopts.py").write_text(
        "import os, signal\n"
        "if signal.getsignal(signal.SIGINT) is signal.SIG_IGN: signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"os.kill(os.getpid(), signal.{sent})\n"
    )
    program = "import sys; from semgs.cli.main import main; sys.argv[1:] = ['demo']; sys.exit(main())"
    path = os.pathsep.join(filter(None, (str(tmp_path), os.environ.get("PYTHONPATH", str(Path.cwd())))))
    done = run_process(program, PYTHONPATH=path)
    assert (done.returncode, done.stderr) == (code, line)


def test_a_request_to_end_while_arguments_are_parsed_is_none_of_the_arguments(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def asked_to_end(*_: object, **__: object) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(10)

    monkeypatch.setattr("semgs.cli.options.typed_options.cyclopts.App", asked_to_end)
    assert main(["demo"]) == 143
    assert capsys.readouterr().err == ""

    def left(*_: object, **__: object) -> None:
        raise SystemExit(143)

    monkeypatch.setattr("semgs.cli.options.typed_options.cyclopts.App", left)
    with pytest.raises(SystemExit, match="143"):
        parse(Demo, "semgs demo", [])

"""A few cases of every format, and that the fuzzer sees what it has to see."""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import pytest

from fuzz.cases import Bench, run_block
from fuzz.format import Format
from fuzz.formats import FORMATS
from fuzz.watch import SECRET, TooLong, Watch
from semgs.files.errors import InputError

CASES = 15
SLOW = ("training", "scannetpp", "weights")
"""Formats whose readers take seconds to import or to begin."""


@pytest.fixture(scope="module")
def watch(tmp_path_factory: pytest.TempPathFactory) -> Watch:
    return Watch(tmp_path_factory.mktemp("fuzz"))


@pytest.fixture(autouse=True)
def place(watch: Watch, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder that this test's cases may write to, where caches are too."""
    watch.folder = str(tmp_path.resolve())
    for name in ("HOME", "XDG_CACHE_HOME", "TMPDIR"):
        monkeypatch.setenv(name, str(tmp_path))
    return tmp_path


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.long) if name in SLOW else name for name in FORMATS]
)
def test_damaged_files_are_read_or_refused(watch: Watch, place: Path, name: str):
    bench = Bench(FORMATS[name], 0, place / "bench", watch)
    assert bench.run({})[0] == "read"
    tally = run_block(bench, 1, 0, CASES, lambda case: True, lambda case: None)
    assert tally.found == []
    assert tally.read + tally.refused == CASES
    assert tally.refused > 0


def test_a_case_is_the_same_alone_and_among_others(watch: Watch, place: Path):
    bench = Bench(FORMATS["small-files"], 0, place / "bench", watch)
    laid: list[list[dict]] = []
    run = bench.run
    for wanted in ((2, 7, 9), (9, 7)):
        laid.append([])
        bench.run = lambda changes: laid[-1].append(changes) or run(changes)  # type: ignore[func-returns-value,method-assign]
        run_block(bench, 1, 0, 12, lambda case, wanted=wanted: case in wanted, lambda case: None)
    assert laid[0][1:] == laid[1]
    assert len(laid[0]) == 3


def misbehaving(act: object, sealed: bool = True) -> Format:
    """A format of one file whose reader does something."""

    def seed(folder: Path) -> Path:
        (folder / "a.txt").write_text("1")
        return folder / "a.txt"

    return Format("wrong", (seed,), ("*",), lambda path, out, changed: act(path, out), (), sealed=sealed)  # type: ignore[operator]


def loop(path: Path, out: Path) -> None:
    while True:
        pass


def refuse_something_else(path: Path, out: Path) -> None:
    raise InputError("/etc/hosts", "a", "b")


@pytest.mark.parametrize(
    ("act", "told"),
    [
        (lambda path, out: 1 / 0, "ZeroDivisionError"),
        (lambda path, out: int("a"), "ValueError"),
        (lambda path, out: (out.parent.parent.parent / "x").write_text("a"), "writes "),
        (lambda path, out: (out / "../../../y").mkdir(), "os.mkdir "),
        (lambda path, out: (path.parent.parent / SECRET).read_bytes(), "reads "),
        (
            lambda path, out: subprocess.run([sys.executable, "-V"], check=True, capture_output=True),
            "runs subprocess.Popen",
        ),
        (lambda path, out: socket.socket().connect_ex(("127.0.0.1", 9)), "runs socket.connect"),
        (lambda path, out: bytes(2 << 30), "more than 1 GB"),
        (refuse_something_else, "a message that does not name the file"),
    ],
)
def test_what_a_case_may_not_do_is_found(watch: Watch, place: Path, act: object, told: str):
    bench = Bench(misbehaving(act), 0, place / "a/bench", watch)
    watch.folder = str((place / "a").resolve())
    assert bench.run({})[0].startswith(told)


def test_what_a_case_may_do_is_no_find(watch: Watch, place: Path):
    bench = Bench(misbehaving(lambda path, out: (out / "x").write_text(path.read_text())), 0, place / "bench", watch)
    assert bench.run({}) == ("read", "", "")
    assert list(bench.out.iterdir()) == []


def test_a_hang_is_ended(watch: Watch, place: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("fuzz.watch.SECONDS", 0.2)
    told, where, _ = Bench(misbehaving(loop), 0, place / "bench", watch).run({})
    assert told.startswith(TooLong.__name__)
    assert "loop" in where

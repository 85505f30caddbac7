"""Worker processes that work, fail and are killed."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from semgs.batch.local_workers import run_locally
from semgs.batch.records import Record, left_to_do, read_record, write_failures, write_record
from semgs.batch.tasks import Task

pytest.importorskip("pebble")


def begin() -> None:
    pass


def work(task: Task) -> Record:
    """What the first argument says: an exit code, or the file that counts tries before the process kills itself."""
    word, *more = task.arguments
    if word == "kill":
        file, times = Path(more[0]), int(more[1])
        tried = len(file.read_text()) if file.exists() else 0
        file.write_text("x" * (tried + 1))
        if tried < times:
            os.kill(os.getpid(), signal.SIGKILL)
        word = "0"
    return Record(task.name, task.fingerprint, int(word), "no photos" if int(word) else "", 0.5)


def test_a_killed_worker_costs_its_scene_a_try_and_others_go_on(tmp_path: Path):
    tasks = [
        Task("good", ("0",), "a"), Task("bad", ("2",), "b"), Task("once", ("kill", str(tmp_path / "tries_once"), "1"), "c"),
        Task("always", ("kill", str(tmp_path / "tries_always"), "9"), "d"), Task("last", ("0",), "e"),
    ]  # fmt: skip
    records = {record.name: record for record in run_locally(work, tasks, 2, begin)}
    assert {name: record.code for name, record in records.items()} == {
        "good": 0, "bad": 2, "once": 0, "last": 0, "always": -9,
    }  # fmt: skip
    assert "killed 2 times (SIGKILL), probably for lack of memory" in records["always"].why
    assert (tmp_path / "tries_always").read_text() == "xx"
    for record in records.values():
        write_record(tmp_path, record)
        if record.succeeded:
            (tmp_path / record.name).mkdir()
    assert read_record(tmp_path, "bad") == records["bad"]
    assert left_to_do(tmp_path, tasks, False) == []
    assert [task.name for task in left_to_do(tmp_path, tasks, True)] == ["bad", "always"]
    changed = [Task("good", ("0",), "other"), *tasks[1:]]
    assert [task.name for task in left_to_do(tmp_path, changed, False)] == ["good"]
    assert write_failures(tmp_path, tasks) == 2
    assert (tmp_path / "failures.jsonl").read_text().splitlines()[
        0
    ] == '{"scene": "bad", "code": 2, "error": "no photos"}'

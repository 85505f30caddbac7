"""A few kills of one command, and that the checks after a kill see what they must."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from faults.cases import CASES, wrong

EXPORT = CASES["export"]
TESTS = Path(__file__).resolve().parents[1]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="forks, mounts and /proc are Linux's here")
@pytest.mark.parametrize("count", ["1", pytest.param("6", marks=pytest.mark.long)])
def test_an_export_survives_a_few_faults_of_every_kind_and_a_second_call_has_nothing_to_do(tmp_path: Path, count: str):
    command = [
        sys.executable,
        "-m",
        "faults",
        "--only",
        "export",
        "--count",
        count,
        "--jobs",
        "1",
        "--folder",
        str(tmp_path),
    ]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, (TESTS.parent, TESTS, TESTS / "support"))),
        "OMP_NUM_THREADS": "1",
    }
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    kinds = {file.name.rsplit("_export", 1)[0] for file in tmp_path.glob("*_export*.json")}
    assert {
        "kill",
        "disk_full",
        "read-only",
        "no_permission",
        "two_at_once",
        "SIGINT",
        "SIGTERM",
        "shrinking_.safetensors_of",
    } <= kinds
    assert " 0 found" in done.stdout.splitlines()[-1]


OLD = {"a.ply": b"old", "export.json": b"{}"}
NEW = {"a.ply": b"new", "b.ply": b"new", "export.json": b"{}"}


@pytest.mark.parametrize("found", [OLD, NEW])
def test_the_old_folder_and_the_new_one_are_right(found: dict[str, bytes]):
    assert wrong(EXPORT, OLD, found, NEW) == []


@pytest.mark.parametrize(
    ("found", "told"),
    [
        ({**NEW, "b.ply": b"ne"}, "b.ply is neither the old nor the new file (2 bytes)"),
        ({"a.ply": b"new", "export.json": b"{}", "c": b""}, "c is unknown"),
        ({"a.ply": b"new"}, ". is incomplete: ['a.ply']"),
    ],
)
def test_cut_files_and_incomplete_folders_are_found(found: dict[str, bytes], told: str):
    assert told in wrong(EXPORT, OLD, found, NEW)


def test_a_lost_scene_is_found():
    scenes = {f"scene_0000{k}/room.json": b"{}" for k in range(2)}
    first = dict(list(scenes.items())[:1])
    assert wrong(CASES["rooms"], first, {}, scenes) == ["scene_00000/room.json is lost"]


@pytest.mark.parametrize(("data", "said"), [(b'{"a": 1', "JSONDecodeError"), (b"", "JSONDecodeError")])
def test_cut_files_of_unknown_bytes_are_found(data: bytes, said: str):
    assert said in wrong(CASES["train"], {}, {"network.json": data}, {})[0]

"""Memory of a process and of what it started."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from semgs.runtime.free_memory import _listed_bytes, group_bytes

HOLD = """
import os, sys
child = os.fork() if len(sys.argv) > 1 else 1
held = b"x" * 40_000_000
print("ready", flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="Linux lists processes in /proc")
@pytest.mark.parametrize(("arguments", "least"), [([], 40e6), (["forked"], 80e6)])
def test_memory_of_a_group_is_that_of_its_processes_and_none_when_they_have_ended(arguments: list[str], least: float):
    process = subprocess.Popen(
        [sys.executable, "-S", "-c", HOLD, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    with process:
        assert process.stdin is not None
        assert process.stdout is not None
        for _ in range(1 + len(arguments)):
            process.stdout.readline()
        assert least < (group_bytes(process.pid) or 0) < least + 30e6
        assert least < (_listed_bytes(process.pid) or 0) < least + 60e6
    end = time.monotonic() + 60
    while group_bytes(process.pid) and time.monotonic() < end:  # the forked one may end later
        time.sleep(0.02)
    assert group_bytes(process.pid) == 0


def test_shared_pages_count_once_and_names_of_programs_may_have_brackets(tmp_path: Path):
    for number, (group, resident, share) in {
        "self": (7, 1, 1),
        "11": (5, 10, 4),
        "12": (5, 10, 6),
        "13": (6, 99, 99),
    }.items():
        folder = tmp_path / "proc" / number
        folder.mkdir(parents=True)
        (folder / "stat").write_text(f"{number} (a ) 5 (b) S 1 {group} {group} 0")
        (folder / "statm").write_text(f"20 {resident} 3 0 0 0 0")
        (folder / "smaps_rollup").write_text(
            f"0-1 [rollup]\nRss: {4 * resident} kB\nPss: {4 * share} kB\nPss_Dirty: 1 kB\n"
        )
    assert group_bytes(5, tmp_path) == 10 * 4096
    assert group_bytes(6, tmp_path) == 99 * 4096
    assert group_bytes(8, tmp_path) == 0
    (tmp_path / "proc/11/smaps_rollup").unlink()  # not permitted, or ended meanwhile
    assert group_bytes(5, tmp_path) == (10 + 6) * 4096

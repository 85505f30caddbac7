"""Cores that may be used, and those that other programs leave free: from files of the system, which are written here."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from semgs.runtime import cores
from semgs.runtime.cores import CoreMeter, usable_cores

FOUR = {0, 1, 4, 5}
"""Cores that this process may use, of eight."""


@pytest.fixture(autouse=True)
def four_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: FOUR, raising=False)


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def write_times(root: Path, seconds: float, busy: dict[int, float], column: int = 0) -> None:
    """What the system counts after some seconds, of which each core was busy for some."""
    lines = ["cpu  0 0 0 0 0 0 0 0 0 0"]
    for core in range(8):
        ticks = [0] * 10
        ticks[column] = round(100 * busy.get(core, 0.0))
        ticks[cores.IDLE] += round(100 * seconds) - ticks[column]
        lines.append(f"cpu{core} " + " ".join(map(str, ticks)))
    write(root / "proc/stat", "\n".join([*lines, "intr 5"]))


def test_without_a_container_all_cores_of_the_affinity_may_be_used(tmp_path: Path) -> None:
    assert usable_cores(tmp_path) == 4


@pytest.mark.parametrize(("limit", "expected"), [("max 100000", 4), ("250000 100000", 2), ("50000 100000", 1), ("900000 100000", 4), ("", 4)])  # fmt: skip
def test_a_container_of_version_2_allows_whole_cores_of_its_quota(tmp_path: Path, limit: str, expected: int) -> None:
    write(tmp_path / "proc/self/mountinfo", "31 23 0:28 / /sys/fs/cgroup rw,relatime shared:9 - cgroup2 cgroup2 rw\n")
    write(tmp_path / "proc/self/cgroup", "0::/pod/job\n")
    write(tmp_path / "sys/fs/cgroup/pod/job/cpu.max", "max 100000\n")
    write(tmp_path / "sys/fs/cgroup/pod/cpu.max", f"{limit}\n")
    assert usable_cores(tmp_path) == expected


@pytest.mark.parametrize(("quota", "expected"), [(300_000, 3), (-1, 4)])
def test_a_container_of_version_1_has_quota_and_period_in_two_files(tmp_path: Path, quota: int, expected: int) -> None:
    mounted = "31 23 0:28 / /sys/fs/cgroup/cpu,cpuacct rw,relatime shared:9 - cgroup cgroup rw,cpu,cpuacct\n"
    write(tmp_path / "proc/self/mountinfo", mounted)
    write(tmp_path / "proc/self/cgroup", "4:cpu,cpuacct:/job\n")
    folder = tmp_path / "sys/fs/cgroup/cpu,cpuacct/job"
    write(folder / "cpu.cfs_quota_us", f"{quota}\n")
    write(folder / "cpu.cfs_period_us", "100000\n")
    assert usable_cores(tmp_path) == expected


@pytest.mark.parametrize(
    ("busy", "own", "expected"),
    [
        ({}, 0.0, 4),
        ({0: 10.0, 1: 5.0}, 0.0, 2),  # 1.5 of 4 cores are taken; 2.5 are rounded to an even number
        ({0: 10.0, 1: 5.0}, 5.0, 3),  # of these, half a core was our own
        ({2: 10.0, 3: 10.0}, 0.0, 4),  # cores of others
        (dict.fromkeys(FOUR, 10.0), 0.0, 1),
        ({0: 10.0}, 20.0, 4),
    ],
)
def test_free_is_what_other_programs_left_since_the_last_answer(
    tmp_path: Path, busy: dict[int, float], own: float, expected: int
) -> None:
    write_times(tmp_path, 100, dict.fromkeys(FOUR, 90.0))
    times = iter([7.0, 7.0 + own])
    meter = CoreMeter(tmp_path, lambda: next(times))
    write_times(tmp_path, 110, {core: 90.0 + busy.get(core, 0.0) for core in range(8)})
    assert meter.free_cores() == expected


def test_programs_of_low_priority_give_way_and_waiting_for_disks_takes_no_core(tmp_path: Path) -> None:
    for column in (cores.NICE, cores.IO_WAIT):
        write_times(tmp_path, 0, {})
        meter = CoreMeter(tmp_path, lambda: 0.0)
        write_times(tmp_path, 10, dict.fromkeys(FOUR, 10.0), column)
        assert meter.free_cores() == 4


def test_too_short_a_time_says_nothing_and_the_next_answer_is_of_all_of_it(tmp_path: Path) -> None:
    write_times(tmp_path, 0, {})
    meter = CoreMeter(tmp_path, lambda: 0.0)
    write_times(tmp_path, 0.1, dict.fromkeys(FOUR, 0.1))
    assert meter.free_cores() is None
    write_times(tmp_path, 1, dict.fromkeys(FOUR, 0.5))
    assert meter.free_cores() == 2


def test_a_system_that_does_not_say_is_asked_in_vain(tmp_path: Path) -> None:
    assert CoreMeter(tmp_path).free_cores() is None

"""What is free, as the system, containers and limits tell it: in files, which are written here."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest

from semgs.runtime.control_groups import control_groups
from semgs.runtime.free_memory import free_bytes, held_bytes, process_bytes

GIB = 2**30


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A system with 8 GiB available, of which this process has 1, and no containers."""
    write(tmp_path / "proc/meminfo", f"MemTotal: {16 * 2**20} kB\nMemAvailable: {8 * 2**20} kB\n")
    write(tmp_path / "proc/self/status", f"Name:\tpython\nVmSize:\t {3 * 2**20} kB\nVmRSS:\t {2**20} kB\n")
    return tmp_path


def write(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def mount(root: Path, kind: str, top: str, options: str) -> None:
    at = "/sys/fs/cgroup" if kind == "cgroup2" else "/sys/fs/cgroup/memory"
    write(root / "proc/self/mountinfo", f"31 23 0:28 {top} {at} rw,relatime shared:9 - {kind} {kind} rw,{options}\n")


def version_2(folder: Path, limit: str, used: int, files: int = 0) -> None:
    write(folder / "memory.max", f"{limit}\n")
    write(folder / "memory.current", f"{used}\n")
    write(folder / "memory.stat", f"anon 5\nactive_file 7\ninactive_file {files}\n")


def version_1(folder: Path, limit: int, used: int, files: int = 0) -> None:
    write(folder / "memory.limit_in_bytes", f"{limit}\n")
    write(folder / "memory.usage_in_bytes", f"{used}\n")
    write(folder / "memory.stat", f"cache 9\ninactive_file 1\ntotal_inactive_file {files}\n")


def test_without_containers_it_is_what_the_system_has_available(root: Path) -> None:
    assert free_bytes(root) == 8 * GIB
    assert held_bytes(root) == GIB
    assert process_bytes("VmSize", root) == 3 * GIB
    assert process_bytes("VmHWM", root) is None


def test_a_container_of_version_2_leaves_its_limit_less_its_use_files_not_counted(root: Path) -> None:
    mount(root, "cgroup2", "/", "nsdelegate")
    write(root / "proc/self/cgroup", "0::/job\n")
    version_2(root / "sys/fs/cgroup/job", str(4 * GIB), 3 * GIB, GIB // 2)
    assert free_bytes(root) == 1.5 * GIB


def test_the_outer_container_counts_where_it_has_less_left(root: Path) -> None:
    mount(root, "cgroup2", "/", "nsdelegate")
    write(root / "proc/self/cgroup", "0::/pod/job\n")
    top = root / "sys/fs/cgroup"
    version_2(top / "pod/job", "max", GIB)
    version_2(top / "pod", str(6 * GIB), 4 * GIB)
    assert free_bytes(root) == 2 * GIB
    version_2(top / "pod/job", str(GIB), GIB // 4)
    assert free_bytes(root) == 0.75 * GIB
    assert list(control_groups("memory", root)) == [top / "pod/job", top / "pod", top]


def test_what_slows_a_container_down_is_a_limit_too(root: Path) -> None:
    mount(root, "cgroup2", "/", "nsdelegate")
    write(root / "proc/self/cgroup", "0::/job\n")
    version_2(root / "sys/fs/cgroup/job", str(4 * GIB), GIB)
    write(root / "sys/fs/cgroup/job/memory.high", f"{3 * GIB}\n")
    assert free_bytes(root) == 2 * GIB


def test_a_container_of_version_1_is_respected_and_so_is_the_one_around_it(root: Path) -> None:
    mount(root, "cgroup", "/", "memory")
    write(root / "proc/self/cgroup", "5:cpu,cpuacct:/elsewhere\n4:memory:/pod/job\n0::/\n")
    top = root / "sys/fs/cgroup/memory"
    version_1(top / "pod/job", 2**63 - 4096, GIB)
    version_1(top / "pod", 5 * GIB, 3 * GIB, GIB)
    assert free_bytes(root) == 3 * GIB


def test_seen_from_inside_a_container_its_top_is_its_own_group(root: Path) -> None:
    mount(root, "cgroup", "/docker/1234", "memory")
    version_1(root / "sys/fs/cgroup/memory", 3 * GIB, GIB)
    for own in ("/docker/1234", "/docker/1234/lost", "/elsewhere"):
        write(root / "proc/self/cgroup", f"4:memory:{own}\n")
        assert free_bytes(root) == 2 * GIB


def test_more_in_use_than_the_limit_leaves_nothing(root: Path) -> None:
    mount(root, "cgroup2", "/", "nsdelegate")
    write(root / "proc/self/cgroup", "0::/\n")
    version_2(root / "sys/fs/cgroup", str(GIB), 2 * GIB)
    assert free_bytes(root) == 0


def test_where_nothing_says_nothing_is_a_limit(tmp_path: Path) -> None:
    assert free_bytes(tmp_path) == math.inf
    assert held_bytes(tmp_path) == 0


def test_a_limit_on_the_address_space_leaves_what_is_not_mapped(root: Path) -> None:
    program = (
        "import resource, sys; from pathlib import Path; from semgs.runtime.free_memory import free_bytes; "
        f"resource.setrlimit(resource.RLIMIT_AS, ({5 * GIB}, {5 * GIB})); print(free_bytes(Path(sys.argv[1])))"
    )
    told = subprocess.run([sys.executable, "-c", program, str(root)], capture_output=True, text=True, check=True)
    assert float(told.stdout) == 2 * GIB


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="there is no /proc")
def test_this_process_holds_something_and_has_something_left() -> None:
    assert 1e7 < held_bytes() < 1e12
    assert free_bytes() > 0


def test_what_was_freed_and_is_kept_is_told() -> None:
    # Fifty blocks of a megabyte, and one after them, so that they are not at the end.
    program = (
        "from semgs.runtime.free_memory import keep_freed_memory, kept_bytes; kept = keep_freed_memory(); "
        "blocks = [bytes(10**6) for _ in range(50)]; last = bytes(10**6); before = kept_bytes(); del blocks; "
        "print(kept, kept_bytes() - before)"
    )
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    if told[0] == "False":
        pytest.skip("the C library cannot keep freed memory")
    assert 50e6 <= float(told[1]) < 51e6

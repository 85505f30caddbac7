"""Freed memory is kept: in a process of its own, because what is set there holds until it ends."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

PROGRAM = """
import ctypes, json, resource, sys
from semgs.runtime.free_memory import LARGE, keep_freed_memory

can = keep_freed_memory() if sys.argv[1] == "kept" else hasattr(ctypes.CDLL(None), "mallopt")
libc = ctypes.CDLL(None)
libc.malloc.restype, libc.free.argtypes = ctypes.c_void_p, [ctypes.c_void_p]

def taken_again(size):
    faults = []
    for _ in range(3):
        blocks = [libc.malloc(ctypes.c_size_t(size)) for _ in range(4)]
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        for block in blocks:
            ctypes.memset(block, 1, size)
        faults.append(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
        for block in blocks:
            libc.free(block)
    return faults[-1]

print(json.dumps([can, taken_again(LARGE // 2), taken_again(2 * LARGE)]))
"""


def told(mode: str) -> tuple[bool, int, int]:
    done = subprocess.run([sys.executable, "-c", PROGRAM, mode], capture_output=True, text=True, check=True)
    return tuple(json.loads(done.stdout))


def test_what_is_freed_is_taken_again_without_asking_the_system_but_for_large_blocks() -> None:
    can, again, large = told("kept")
    if not can:
        pytest.skip("the C library has no such parameters")
    assert again < 10
    assert large > 1000
    assert told("as usual")[1] > 1000

import subprocess
import sys
import threading

import pytest
import torch

from semgs.runtime.kernels import in_threads


@pytest.fixture
def three_threads():
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    yield
    torch.set_num_threads(before)


def add_part(found: list[tuple[int, int]], part: int, parts: int) -> None:
    found.append((part, parts))


@pytest.mark.usefixtures("three_threads")
def test_each_part_is_called_once_and_all_at_the_same_time() -> None:
    together = threading.Barrier(3, timeout=20)  # passed by three threads at once or by none
    found: list[tuple[int, int]] = []

    def kernel(found: list[tuple[int, int]], part: int, parts: int) -> None:
        together.wait()
        add_part(found, part, parts)

    in_threads(kernel, found)
    assert sorted(found) == [(0, 3), (1, 3), (2, 3)]


@pytest.mark.usefixtures("three_threads")
def test_an_error_of_one_part_is_raised() -> None:
    def kernel(part: int, parts: int) -> None:
        if part == 1:
            raise ValueError("the second part")

    with pytest.raises(ValueError, match="the second part"):
        in_threads(kernel)


FORKED = """
import os
import torch
from semgs.runtime.kernels import in_threads

def add_part(found, part, parts):
    found.append((part, parts))

torch.set_num_threads(3)
if {first!r}:
    in_threads(add_part, [])
if os.fork() == 0:
    found = []
    try:
        in_threads(add_part, found)
        print(sorted(found), flush=True)
    except RuntimeError as error:
        print(error, flush=True)
    os._exit(0)
os.wait()
"""
"""Calls `in_threads` in a forked process, after its parent has or has not. In an interpreter of its own: a test's process has threads, whose locks a fork copies."""


def outcome_in_a_forked_process(first: bool) -> str:
    """What the forked process prints: the parts that it called, or its error."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", FORKED.format(first=first)],
        capture_output=True, text=True, check=True, timeout=120,
    )  # fmt: skip
    return done.stdout


@pytest.mark.long
def test_a_process_forked_before_the_first_call_has_threads_of_its_own() -> None:
    assert outcome_in_a_forked_process(first=False) == "[(0, 3), (1, 3), (2, 3)]\n"


def test_a_process_forked_after_the_first_call_is_refused_and_told_to_spawn() -> None:
    told = outcome_in_a_forked_process(first=True)
    assert "was forked from one that has already rendered" in told
    assert "get_context('spawn')" in told

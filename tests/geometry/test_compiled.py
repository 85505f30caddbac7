import multiprocessing
import threading

import pytest
import torch

from semgs.geometry import compiled
from semgs.geometry.compiled import in_threads


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


def outcome_in_a_forked_process() -> object:
    """What `in_threads` does in a process forked from this one: the parts that it called, or its error."""
    parent, child = multiprocessing.Pipe()

    def work() -> None:
        found: list[tuple[int, int]] = []
        try:
            in_threads(add_part, found)
            child.send(sorted(found))
        except RuntimeError as error:
            child.send(str(error))

    process = multiprocessing.get_context("fork").Process(target=work)
    process.start()
    assert parent.poll(20)
    process.join(20)
    assert process.exitcode == 0
    return parent.recv()


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.usefixtures("three_threads")
def test_a_process_forked_before_the_first_call_has_threads_of_its_own() -> None:
    compiled._first_to_compute.cache_clear()
    compiled._threads.cache_clear()
    assert outcome_in_a_forked_process() == [(0, 3), (1, 3), (2, 3)]


@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
@pytest.mark.usefixtures("three_threads")
def test_a_process_forked_after_the_first_call_is_refused_and_told_to_spawn() -> None:
    in_threads(add_part, [])
    told = outcome_in_a_forked_process()
    assert "was forked from one that has already rendered" in str(told)
    assert "get_context('spawn')" in str(told)

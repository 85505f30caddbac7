"""Worker processes that are killed: their item gets another try, and the others are not disturbed."""

from __future__ import annotations

import os
import pickle
import signal
from functools import partial
from pathlib import Path

from semgs.runtime.workers import WorkerKilledError, _Worker, finished, outcomes


def no_set_up() -> None:
    pass


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def kill_itself(folder: Path, item: tuple[str, int]) -> str:
    """The name of an item, after this process has killed itself as often as it says."""
    name, times = item
    tries = folder / name
    tries.write_text(f"{tries.read_text() if tries.exists() else ''}x")
    if len(tries.read_text()) <= times:
        os.kill(os.getpid(), signal.SIGKILL)
    return name


def test_a_killed_worker_costs_its_item_a_try_and_no_other(tmp_path: Path):
    items = [("good", 0), ("once", 1), ("always", 9), ("last", 0)]
    found = dict(finished(partial(kill_itself, tmp_path), items, 2, no_set_up))
    assert {found[position] for position in (0, 1, 3)} == {"good", "once", "last"}
    assert isinstance(found[2], WorkerKilledError)
    assert found[2].code == -signal.SIGKILL
    assert "killed 2 times (SIGKILL), probably for lack of memory: use fewer --workers" in str(found[2])
    assert (tmp_path / "always").read_text() == "xx"
    assert str(pickle.loads(pickle.dumps(found[2]))) == str(found[2])


def test_workers_that_die_before_they_take_an_item_cost_it_its_tries():
    larger_than_a_pipe = bytes(1 << 22)  # so it cannot be sent to a dead worker
    ((place, outcome),) = finished(len, [larger_than_a_pipe], 1, die)
    assert place == 0
    assert isinstance(outcome, WorkerKilledError)


def test_outcomes_come_in_order_though_the_first_is_tried_again(tmp_path: Path):
    assert list(outcomes(partial(kill_itself, tmp_path), [("first", 1), ("second", 0)], 2)) == ["first", "second"]


def test_a_worker_that_was_killed_while_idle_takes_no_item(tmp_path: Path):
    worker = _Worker(no_set_up, partial(kill_itself, tmp_path))
    worker.process.kill()
    worker.process.join()
    assert not worker.give(("good", 0))

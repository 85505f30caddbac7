import os
import time
from contextlib import closing
from functools import partial

import pytest

from semgs.runtime.workers import outcomes


def divided(number: int, by: int) -> int:
    return number // by


def process(item: int) -> int:
    return os.getpid()


def test_results_come_in_order_and_errors_as_values_with_the_place_where_they_were_raised():
    first, second, third = outcomes(partial(divided, 12), [3, 0, 4], 0)
    assert (first, third) == (4, 3)
    assert isinstance(second, ZeroDivisionError)
    (note,) = second.__notes__
    assert "while working on 0" in note
    assert "return number // by" in note


def test_nothing_to_do_is_nothing():
    assert list(outcomes(partial(divided, 1), [], 2)) == []


def test_workers_are_other_processes_that_end_with_the_block_though_its_error_is_kept():
    seen = []

    def interrupted() -> None:
        with closing(outcomes(process, [1, 2, 3], 1)) as found:
            seen.append(next(found))
            raise KeyError

    with pytest.raises(KeyError) as kept:
        interrupted()
    assert seen[0] != os.getpid()
    for _ in range(2000):  # until the fork server has heard of it
        try:
            os.kill(seen[0], 0)
        except ProcessLookupError:
            break
        time.sleep(0.05)
    else:
        pytest.fail(f"worker {seen[0]} outlived {kept.type}")

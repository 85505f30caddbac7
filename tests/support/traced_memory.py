"""How much memory a piece of work holds."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable


def most_memory(work: Callable[[], object]) -> int:
    """Bytes that Python and NumPy hold together while `work` runs, at most; the smallest of three runs.

    The count is of the whole process: threads that earlier tests left behind, and garbage that is collected meanwhile, add to it.
    """
    return min(_traced(work) for _ in range(3))


def _traced(work: Callable[[], object]) -> int:
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()

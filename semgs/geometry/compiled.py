"""The one way into compiled kernels: as operations of torch, and Numba with torch's number of threads, which is left as it was.

Numba and torch share one OpenMP runtime, and Numba's pool sets that runtime's number of threads when it starts, which
would silently undo `OMP_NUM_THREADS` or `torch.set_num_threads`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import torch

_ONE_AT_A_TIME = threading.RLock()
"""Numba's own threading layer, the only one on some systems, ends the process when two Python threads use it at once."""

OPERATIONS = torch.library.Library("semgs", "FRAGMENT")
"""Where `torch.ops.semgs` comes from."""


def operation(function: Callable) -> torch._ops.OpOverload:
    """`torch.ops.semgs.NAME` of a function of CPU tensors that changes none of them; NAME is its own, without the leading underscore.

    What `torch.library.custom_op` makes imports torch's compiler when it is first called, which takes seconds and is not used.
    """
    name = function.__name__.lstrip("_")
    OPERATIONS.define(name + torch.library.infer_schema(function, mutates_args=()))
    OPERATIONS.impl(name, function, "CPU")
    return getattr(torch.ops.semgs, name).default


@contextmanager
def numba_threads() -> Iterator[None]:
    """Numba with as many threads as torch uses here (or fewer, where its own limit is lower), one call at a time."""
    import numba

    with _ONE_AT_A_TIME:
        wanted = torch.get_num_threads()
        before = numba.get_num_threads()
        numba.set_num_threads(min(wanted, numba.config.NUMBA_NUM_THREADS))  # type: ignore[attr-defined]
        try:
            yield
        finally:
            numba.set_num_threads(before)
            if torch.get_num_threads() != wanted:
                torch.set_num_threads(wanted)

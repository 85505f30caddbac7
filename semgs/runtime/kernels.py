"""Calls of compiled kernels: as operations of torch, in as many threads as torch uses."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import torch

OPERATIONS = torch.library.Library("semgs", "FRAGMENT")
"""The library behind `torch.ops.semgs`."""


def operation(function: Callable) -> torch._ops.OpOverload:
    """Register a function as `torch.ops.semgs.NAME`. It takes CPU tensors and changes none; NAME is its name without leading underscore.

    `torch.library.custom_op` would do the same, but its first call imports torch's compiler, which takes seconds and is not needed.
    """
    name = function.__name__.lstrip("_")
    OPERATIONS.define(name + torch.library.infer_schema(function, mutates_args=()))
    OPERATIONS.impl(name, function, "CPU")
    return getattr(torch.ops.semgs, name).default


def check_not_forked() -> None:
    """Check that no other process computed first, which this one was forked from: threads of OpenMP do not survive a fork.

    Without this check, the next parallel operation of torch waits forever or ends the process.

    Raises:
        RuntimeError: this process was forked from one that had already rendered or encoded.
    """
    if _first_to_compute() != os.getpid():
        raise RuntimeError(
            "this process was forked from one that has already rendered or encoded, and OpenMP's threads do not survive a fork; "
            "start it with multiprocessing.get_context('spawn'), or fork before the first call"
        )


def has_computed() -> bool:
    """Whether this process has rendered or encoded."""
    return _first_to_compute.cache_info().currsize > 0


@cache
def _first_to_compute() -> int:
    """The process that called this first: this one or, after a fork, one that it was forked from."""
    return os.getpid()


def in_threads(kernel: Callable[..., None], *arguments: Any) -> None:
    """Call `kernel(*arguments, part, parts)` for each part, in parallel, in as many threads as torch uses.

    Kernels release Python's lock (`nogil`). Numba's own threads (`parallel`) would double their compile time.

    Raises:
        RuntimeError: as `check_not_forked`.
    """
    check_not_forked()
    parts = torch.get_num_threads()
    if parts == 1:
        kernel(*arguments, 0, 1)
        return
    calls = [_threads(parts).submit(kernel, *arguments, part, parts) for part in range(parts)]
    for call in calls:
        call.result()


@cache
def _threads(count: int) -> ThreadPoolExecutor:
    """Worker threads."""
    return ThreadPoolExecutor(count, "semgs")

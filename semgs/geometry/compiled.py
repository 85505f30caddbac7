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


def in_threads(kernel: Callable[..., None], *arguments: Any) -> None:
    """Call `kernel(*arguments, part, parts)` for each part, in parallel, in as many threads as torch uses.

    Kernels release Python's lock (`nogil`). Numba's own threads (`parallel`) would double their compile time.
    """
    parts = torch.get_num_threads()
    if parts == 1:
        kernel(*arguments, 0, 1)
        return
    calls = [_threads(os.getpid(), parts).submit(kernel, *arguments, part, parts) for part in range(parts)]
    for call in calls:
        call.result()


@cache
def _threads(process: int, count: int) -> ThreadPoolExecutor:
    """Worker threads. Each process has its own, because a forked process does not inherit those of its parent."""
    return ThreadPoolExecutor(count, f"semgs-{process}")

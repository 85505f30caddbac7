"""The one way into compiled kernels: as operations of torch, in as many threads as torch uses."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Any

import torch

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


def in_threads(kernel: Callable[..., None], *arguments: Any) -> None:
    """Call `kernel(*arguments, part, parts)` for each part, side by side in as many threads as torch uses here.

    Kernels release Python's lock (`nogil`). Numba's own threads (`parallel`) would double the time it takes to compile them.
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
    """Threads that wait for work. A forked process has none of its parent's, so each process has its own."""
    return ThreadPoolExecutor(count, f"semgs-{process}")

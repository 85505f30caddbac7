"""Worker processes that prepare data: each on one thread, and none outlives the run that started it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections.abc import Callable, Generator, Sequence
from typing import Generic, TypeVar

import cv2
import torch
from torch.utils.data import DataLoader, Dataset

Item = TypeVar("Item")
Result = TypeVar("Result")


def outcomes(
    work: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Generator[Result | Exception, None, None]:
    """What a function makes of each item, in their order, by worker processes that end when the generator is closed.

    Args:
        work: what to do; with workers, something that can be pickled.
        items: for each call.
        workers: processes, at most one an item; 0 works in this one.

    Yields:
        For each item the result, or the exception that it raised, with the worker's traceback as a note.
    """
    crew = min(workers, len(items))
    found = iter(
        DataLoader(
            _Work(work, items),
            batch_size=None,
            num_workers=crew,
            # A forked process in which numba has run its threads dies at its next kernel.
            multiprocessing_context="forkserver" if crew else None,
            worker_init_fn=settle_worker,
        )
    )
    try:
        yield from found
    finally:
        del found  # ends the workers now, even if an error is kept for long, and this generator with it


class _Work(Dataset, Generic[Item, Result]):
    """Calls for a loader. An error is handed over as a value because a loader would keep no more than its type and text."""

    def __init__(self, work: Callable[[Item], Result], items: Sequence[Item]) -> None:
        self._work, self._items = work, items

    def __len__(self) -> int:
        return len(self._items)

    def __getitem__(self, k: int) -> Result | Exception:
        try:
            return self._work(self._items[k])
        except Exception as error:
            error.add_note(f"while {self._items[k]} was worked on:\n{traceback.format_exc()}")
            return error


def settle_worker(index: int = 0) -> None:
    """Settle a worker process: one thread, no signals that are meant for the run, and no life after it."""
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    threading.Thread(target=_end_with_the_run, daemon=True).start()


def _end_with_the_run() -> None:
    """Wait until the process that started it all is gone, then be gone.

    The parent of a worker is the fork server, which stays for as long as it has a child: after a `kill -9` of the run
    both would wait for each other for ever.
    """
    run = multiprocessing.parent_process()
    if run is not None:
        run.join()
        os._exit(0)

"""Worker processes that prepare data: each uses one thread, and ends with the run that started it."""

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
    """The results of a function for each item, in order, from worker processes that end when the generator is closed.

    Args:
        work: the function; with workers, it must be picklable.
        items: its arguments, one for each call.
        workers: number of processes, at most one per item; 0 runs in this process.

    Yields:
        For each item the result, or the exception raised, with the worker's traceback as a note.
    """
    crew = min(workers, len(items))
    found = iter(
        DataLoader(
            _Work(work, items),
            batch_size=None,
            num_workers=crew,
            # A process forked after numba has started threads would die at its next kernel.
            multiprocessing_context="forkserver" if crew else None,
            worker_init_fn=settle_worker,
        )
    )
    try:
        yield from found
    finally:
        del found  # ends the workers now, even if an exception keeps this generator alive


class _Work(Dataset, Generic[Item, Result]):
    """Calls for a loader. Errors are returned as values, because a loader keeps only their type and text."""

    def __init__(self, work: Callable[[Item], Result], items: Sequence[Item]) -> None:
        self._work, self._items = work, items

    def __len__(self) -> int:
        return len(self._items)

    def __getitem__(self, k: int) -> Result | Exception:
        try:
            return self._work(self._items[k])
        except Exception as error:
            error.add_note(f"while working on {self._items[k]}:\n{traceback.format_exc()}")
            return error


def settle_worker(index: int = 0) -> None:
    """Set up a worker process: one thread, ignore signals meant for the run, and end with the run."""
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    threading.Thread(target=end_with_the_run, daemon=True).start()


def end_with_the_run() -> None:
    """Wait until the run's process has ended, then exit.

    The parent of a worker is the fork server, which lives as long as it has a child: after a `kill -9` of the run, both would wait for
    each other forever.
    """
    run = multiprocessing.parent_process()
    if run is not None:
        run.join()
        os._exit(0)

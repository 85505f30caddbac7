"""Worker processes of this machine. One that is killed costs its scene a second try, and then a record."""

from __future__ import annotations

import signal
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from multiprocessing import get_context

from semgs.batch.records import Record
from semgs.batch.tasks import Task
from semgs.files.extras import needs_extra

TRIES = 2
"""How often a scene is tried whose worker is killed."""


def run_locally(
    work: Callable[[Task], Record], tasks: Sequence[Task], workers: int, begin: Callable[[], None]
) -> Generator[Record, None, None]:
    """Run tasks in worker processes. They end when the generator is closed.

    Args:
        work: runs a task in a worker; picklable.
        tasks: to run.
        workers: number of processes.
        begin: runs in each worker when it starts; picklable.

    Yields:
        A record for each task, in the order in which they end.

    Raises:
        ImportError: Pebble is not installed; the message names the extra.
    """
    with needs_extra("batch", "semgs batch runs scenes in worker processes, which needs Pebble", "pebble"):
        from pebble import ProcessExpired, ProcessPool
    # A process forked after numba has started threads would die at its next kernel.
    pool = ProcessPool(min(workers, len(tasks)), initializer=begin, context=get_context("forkserver"))
    try:
        waiting: dict[Future, tuple[Task, int]] = {pool.schedule(work, [task]): (task, 1) for task in tasks}
        while waiting:
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                task, tries = waiting.pop(future)
                try:
                    yield future.result()
                except ProcessExpired as error:
                    if tries < TRIES:
                        waiting[pool.schedule(work, [task])] = task, tries + 1
                    else:
                        yield _killed(task, int(error.exitcode or 0))
    finally:
        pool.stop()
        pool.join()


def _killed(task: Task, code: int) -> Record:
    """The record of a task whose workers were killed."""
    how = signal.Signals(-code).name if -code in {one.value for one in signal.Signals} else f"exit code {code}"
    hint = ", probably for lack of memory: use fewer --workers" if code == -signal.SIGKILL else ""
    return Record(task.name, task.fingerprint, code or -1, f"its process was killed {TRIES} times ({how}){hint}")

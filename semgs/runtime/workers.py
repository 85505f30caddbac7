"""Worker processes: each uses one thread, and ends with the run that started it. One that is killed costs its item a try, not the run.

Python's own pool ends as a whole if one of its processes is killed.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections import deque
from collections.abc import Callable, Generator, Sequence
from contextlib import closing, suppress
from multiprocessing.connection import Connection, wait
from time import monotonic
from typing import Generic, TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")

TRIES = 2
"""How often an item is tried whose worker is killed."""

PATIENCE = 5.0
"""Workers that do not end by themselves are killed after this time [s]."""


class WorkerKilledError(ChildProcessError):
    """Every worker that tried an item was killed.

    Attributes:
        code: exit code of the last one; negative for the signal that killed it.
    """

    def __init__(self, code: int) -> None:
        self.code = code
        named = signal.Signals(-code).name if -code in set(signal.Signals) else f"exit code {code}"
        hint = ", probably for lack of memory: use fewer --workers" if code == -signal.SIGKILL else ""
        super().__init__(f"its process was killed {TRIES} times ({named}){hint}")

    def __reduce__(self) -> tuple[type[WorkerKilledError], tuple[int]]:
        return type(self), (self.code,)


def outcomes(
    work: Callable[[Item], Result], items: Sequence[Item], workers: int
) -> Generator[Result | Exception, None, None]:
    """As `finished`, without the positions and in the order of the items."""
    early: dict[int, Result | Exception] = {}
    following = 0
    with closing(finished(work, items, workers)) as found:
        for place, outcome in found:
            early[place] = outcome
            while following in early:
                yield early.pop(following)
                following += 1


def settle_worker(index: int = 0) -> None:
    """Set up a worker process: one thread, ignore signals meant for the run, and end with the run."""
    use_one_thread()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    threading.Thread(target=end_with_the_run, daemon=True).start()


def use_one_thread() -> None:
    """Let this process compute with one thread."""
    import cv2
    import torch  # takes seconds, which the run may not need

    torch.set_num_threads(1)
    cv2.setNumThreads(1)


def finished(
    work: Callable[[Item], Result],
    items: Sequence[Item],
    workers: int,
    begin: Callable[[], None] = settle_worker,
) -> Generator[tuple[int, Result | Exception], None, None]:
    """The results of a function for each item, as they come, from worker processes that end when the generator is closed.

    Args:
        work: the function; with workers, it must be picklable.
        items: its arguments, one for each call.
        workers: number of processes, at most one per item; 0 runs in this process.
        begin: sets up a worker when it starts; picklable.

    Yields:
        The position of each item, and its result or the exception raised, with the worker's traceback as a note. That is a `WorkerKilledError`
        if a worker was killed, and the one that tried again was as well.
    """
    if not workers:
        yield from ((place, _outcome(work, item)) for place, item in enumerate(items))
        return
    left = deque((place, 1) for place in range(len(items)))
    idle: list[_Worker] = []
    busy: dict[Connection, tuple[_Worker, int, int]] = {}
    try:
        while left or busy:
            while left and len(busy) < workers:
                new = not idle
                worker = _Worker(begin, work) if new else idle.pop()
                if worker.give(items[left[0][0]]) or new:  # a new one that is dead already costs its item a try
                    busy[worker.connection] = worker, *left.popleft()
                else:
                    worker.end()
            for connection in wait(list(busy)):
                worker, place, tries = busy.pop(connection)  # type: ignore[call-overload]
                try:
                    outcome = worker.connection.recv()
                except (EOFError, OSError):
                    code = worker.end()
                    if tries < TRIES:
                        left.appendleft((place, tries + 1))
                        continue
                    outcome = WorkerKilledError(code)
                else:
                    idle.append(worker)
                yield place, outcome
    finally:
        crew = [*idle, *(worker for worker, _, _ in busy.values())]
        for worker in crew:
            worker.connection.close()
            worker.process.terminate()
        patience = monotonic() + PATIENCE
        for worker in crew:
            worker.end(patience - monotonic())


class _Worker(Generic[Item, Result]):
    """A process that calls a function with each item that it is given, and sends what became of it.

    Each has a connection of its own: a lock that workers share would stay locked if its owner is killed.

    Attributes:
        process: the process.
        connection: to give items and to receive outcomes; it ends with the process.
    """

    def __init__(self, begin: Callable[[], None], work: Callable[[Item], Result]) -> None:
        # A process forked after numba has started threads would die at its next kernel.
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(["cv2", "torch"])  # so that workers start at once and share its memory
        self.connection, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(theirs, begin, work), daemon=True)
        self.process.start()
        theirs.close()

    def give(self, item: Item) -> bool:
        """Give it an item; False if it has been killed."""
        try:
            self.connection.send(item)
        except OSError:
            return False
        return True

    def end(self, patience: float = PATIENCE) -> int:
        """Wait until the process has ended, kill it if it has not after so many seconds, and return its exit code."""
        self.connection.close()
        self.process.join(max(0.0, patience))
        if self.process.is_alive():
            self.process.kill()
            self.process.join()
        return self.process.exitcode or 0


def _serve(connection: Connection, begin: Callable[[], None], work: Callable[[Item], Result]) -> None:
    """What a worker does, until the run closes the connection."""
    begin()
    while True:
        try:
            item = connection.recv()
        except EOFError:
            return
        with suppress(BrokenPipeError):  # the run has ended meanwhile
            connection.send(_outcome(work, item))


def _outcome(work: Callable[[Item], Result], item: Item) -> Result | Exception:
    """What the function returns, or the exception that it raises."""
    try:
        return work(item)
    except Exception as error:
        error.add_note(f"while working on {item}:\n{traceback.format_exc()}")
        return error


def end_with_the_run() -> None:
    """Wait until the run's process has ended, then exit.

    The parent of a worker is the fork server, which lives as long as it has a child: after a `kill -9` of the run, both would wait for
    each other forever.
    """
    run = multiprocessing.parent_process()
    if run is not None:
        run.join()
        os._exit(0)

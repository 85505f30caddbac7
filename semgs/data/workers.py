"""Worker processes that prepare data: each on one thread, and none outlives the run that started it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading

import cv2
import torch


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

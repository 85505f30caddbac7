"""Steps per second of a training whose scenes come from disk, or are drawn meanwhile, against the same with samples that stay in memory.

    python scripts/time_loading.py SCENES [--size HxW] [--batch B] [--steps K] [--workers W]
    python scripts/time_loading.py rooms --reuse 8 ...    rooms are drawn beside the training, each for eight samples

Blocks of ten steps take turns, so that whatever disturbs the machine disturbs both; what is printed are the medians of the blocks, and
the share of the CPU that went to the workers.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import statistics
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path

from semgs.rooms.sets.pool import WINDOW
from semgs.training.batches import Portion, surveyed, training_batches
from semgs.training.engine import launched
from semgs.training.presets import small
from semgs.training.state import TrainingState
from semgs.training.step import training_step
from semgs.training.supervision import supervision_of
from semgs.weights.load import load

BLOCK = 10
"""Steps that are timed together."""


def seconds(portions: Iterator[Portion], step: Callable[[Portion], object]) -> float:
    """The time of a block, the waiting for its samples included."""
    start = time.perf_counter()
    for portion in islice(portions, BLOCK):
        step(portion)
    return time.perf_counter() - start


def spent(pids: Iterable[int]) -> float:
    """CPU seconds of processes."""
    times = [Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13] for pid in pids]
    return sum(int(ticks) for pair in times for ticks in pair) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes")
    parser.add_argument("--size", default="240x320")
    parser.add_argument("--batch", type=int, default=1)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--reuse", type=int, default=1)
    given = parser.parse_args()
    height, width = map(int, given.size.split("x"))
    settings = replace(
        small(),
        data=(given.scenes,),
        size=(height, width),
        batch=given.batch,
        contexts=(2, 2),
        scene_reuse=given.reuse,
        steps=10**6,
        init="small",
    )
    with tempfile.TemporaryDirectory() as folder:
        fabric = launched("cpu", 1, 1, "32")
        state = TrainingState.begin(
            load("small"), supervision_of(settings), settings.learning_rate, settings.average_decay, fabric
        )
        data = surveyed(settings, Path(folder))
        stream = iter(training_batches(settings, data, 0, given.workers, Path(folder)))
        filling = 4 * WINDOW * (given.reuse > 1)
        deque(islice(stream, filling // given.batch), maxlen=0)  # till the pool is as full as it stays
        held = cycle(list(islice(stream, BLOCK)))

        def step(portion: Portion) -> object:
            """One training step."""
            return training_step(state, portion.pieces, settings)

        seconds(held, step)  # warms up
        workers = [process.pid for process in multiprocessing.active_children()]
        before = spent(workers), time.process_time()
        pairs = [(seconds(stream, step), seconds(held, step)) for _ in range(given.steps // BLOCK)]
        aside, here = (now - then for now, then in zip((spent(workers), time.process_time()), before, strict=True))
    disk, memory = (BLOCK / statistics.median(times) for times in zip(*pairs, strict=True))
    print(f"{disk:.2f} steps/s from {given.scenes}, {memory:.2f} from memory: {disk / memory:.0%}")
    print(
        f"{len(workers)} workers took {aside / given.steps:.2f} CPU s a step and the step {here / 2 / given.steps:.2f}"
    )

"""Threads of a command: in processes of their own, because what is set there holds until they end."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from paper.bench.workloads import competitors

SET = """
import json, os
from semgs.runtime import cores
cores.prepare_threads()
print(json.dumps([os.environ.get("GOMP_SPINCOUNT"), cores._meter is not None]))
"""

FRAME = """
import json, sys, time
from semgs.runtime.cores import adapt_threads, prepare_threads
if sys.argv[1] == "command":
    prepare_threads()
import torch
from paper.bench.bench_inputs import context_views, load_network, target_camera
model, views, camera = load_network("small"), context_views(2, (120, 160)), target_camera((120, 160))
adapt_threads()
with torch.no_grad():
    model(views).render(camera)
    start = time.process_time()
    for _ in range(3):
        model(views).render(camera)
print(json.dumps([torch.get_num_threads(), (time.process_time() - start) / 3]))
"""


def told(program: str, *arguments: str, **settings: str) -> list[float | str | bool | None]:
    """What a program prints, started without settings of threads but those given."""
    others = {name: value for name, value in os.environ.items() if not name.startswith(("OMP_", "GOMP_"))}
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments], env=others | settings, capture_output=True, text=True, check=True
    )
    return list(json.loads(done.stdout))


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({}, ["3000", True]),
        ({"GOMP_SPINCOUNT": "7"}, ["7", True]),
        ({"OMP_WAIT_POLICY": "active"}, [None, True]),
        ({"OMP_NUM_THREADS": "2"}, ["3000", False]),
    ],
)
def test_what_the_user_has_set_stays(settings: dict[str, str], expected: list[object]) -> None:
    assert told(SET, **settings) == expected


@pytest.mark.long
def test_beside_other_programs_a_command_uses_one_thread_and_little_time_of_the_processor() -> None:
    if not hasattr(os, "sched_getaffinity"):
        pytest.skip("how busy the machine is, is read from /proc, which is not here")
    cores = len(os.sched_getaffinity(0))
    with competitors(4 * cores):
        _, alone = told(FRAME, "usual", OMP_NUM_THREADS="1")
        threads, seconds = told(FRAME, "command")
    print(f"{seconds:.2f} s of the processor a frame, {alone:.2f} s with one thread")
    assert threads == 1
    assert isinstance(seconds, float)
    assert isinstance(alone, float)
    assert seconds < 1.5 * alone

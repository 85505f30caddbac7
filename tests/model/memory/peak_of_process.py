"""Reconstruct frames of the embedded room and tell what was planned and what the process held at most,
libraries included.

    python tests/model/memory/peak_of_process.py NETWORK VIEWS HEIGHT WIDTH [FREE_GB]

With FREE_GB the plan believes that so much is free.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, replace

from paper.bench.bench_inputs import load_network
from paper.bench.peak_memory import peak_mb
from semgs.data.choosing.choice import choose_named
from semgs.data.demo_scene import demo_scene
from semgs.data.scenes import open_scene
from semgs.model.memory import memory_plan
from semgs.run.steps.pipeline import reconstruct
from semgs.runtime.free_memory import keep_freed_memory, process_bytes


def main(name: str, views: str, height: str, width: str, free_gb: str = "") -> None:
    keep_freed_memory()  # as the command does
    if free_gb:
        memory_plan.free_bytes = lambda: 1e9 * float(free_gb)
    scene, count = open_scene(demo_scene()), int(views)
    choice = choose_named(scene, list(range(count)))
    result = reconstruct(scene, replace(choice, size=(int(height), int(width))), load_network(name))
    assert result.plan is not None
    told = asdict(result.plan) | {"measured_bytes": 1e6 * peak_mb(), "mapped_bytes": process_bytes("RssFile")}
    print(json.dumps({key: value for key, value in told.items() if key != "available_bytes"}))


if __name__ == "__main__":
    main(*sys.argv[1:])

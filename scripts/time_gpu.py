"""Milliseconds to encode, render and train with 2, 3 and 4 views of the embedded room at 240x320, on CUDA or the CPU."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace

import torch

from semgs import load, open_scene, render
from semgs.data.views import Batch, stack
from semgs.model.semgs import SemGS
from semgs.rooms.sets.demo import demo_scene
from semgs.training import presets
from semgs.training.settings import TrainingSettings
from semgs.training.state import TrainingState
from semgs.training.step import training_step
from semgs.training.supervision import supervision_of

TARGETS = (5, 6)
"""Frames that are rendered."""


def milliseconds(run: Callable[[], object], device: str, rounds: int) -> float:
    """The median of some rounds, after one that warms up [ms]."""
    times = []
    for _ in range(rounds + 1):
        began = time.perf_counter()
        run()
        if device == "cuda":
            torch.cuda.synchronize()
        times.append(1000 * (time.perf_counter() - began))
    return sorted(times[1:])[rounds // 2]


def measured(model: SemGS, settings: TrainingSettings, batch: Batch, device: str, rounds: int) -> list[float]:
    """Milliseconds to encode a batch, to render its targets, and for a training step on it."""
    cameras = batch.target.cameras
    with torch.no_grad():
        gaussians = model(batch.context).gaussians
        encode = milliseconds(lambda: model(batch.context), device, rounds)
        draw = milliseconds(lambda: render(gaussians, cameras, near=0.5), device, rounds)
    state = TrainingState.begin(model, supervision_of(settings), 1e-6, 0.99)
    return [encode, draw, milliseconds(lambda: training_step(state, [batch], settings), device, rounds)]


def main() -> None:
    """Print a table: network, views, precision, milliseconds and the most GPU memory."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cuda", choices=("cuda", "cpu"))
    parser.add_argument("--models", nargs="+", default=["small", "base"])
    parser.add_argument("--views", nargs="+", type=int, default=[2, 3, 4])
    parser.add_argument("--rounds", type=int, default=5)
    given = parser.parse_args()
    scene = open_scene(demo_scene())
    target = stack([scene.read(list(TARGETS))])
    print("| network | views | layers in | encode [ms] | render 2 views [ms] | training step [ms] | memory [GiB] |")
    print("|---|---|---|---|---|---|---|")
    for name in given.models:
        settings = replace(presets.PRESETS[name](), depth_weight=0.0)
        for count in given.views:
            batch = Batch(stack([scene.read(list(range(count)))]), target, ("demo",))
            for half in (False, True) if given.device == "cuda" else (False,):
                model = load(name, "random").to(given.device)
                if given.device == "cuda":
                    torch.cuda.reset_peak_memory_stats()
                with torch.autocast(given.device, torch.bfloat16, enabled=half):
                    times = measured(model, settings, batch, given.device, given.rounds)
                memory = torch.cuda.max_memory_allocated() / 2**30 if given.device == "cuda" else 0.0
                cells = [name, count, "bfloat16" if half else "float32", *(f"{one:.1f}" for one in times)]
                print("| " + " | ".join(map(str, cells)) + f" | {memory:.1f} |", flush=True)


if __name__ == "__main__":
    main()

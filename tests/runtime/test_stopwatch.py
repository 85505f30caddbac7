"""What a stopwatch says when Numba compiles inside a stage."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from numba.core.event import trigger_event
from recorded_progress import RecordedProgress

from semgs.runtime import stopwatch as module
from semgs.runtime.stopwatch import Stages


class Clock:
    """A clock that goes on when it is told to."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(module, "perf_counter", clock)
    return clock


def test_compiling_is_said_once_and_kept_out_of_its_stage(clock: Clock) -> None:
    progress = RecordedProgress()
    stages = Stages(progress)
    with stages("encode", "Encoding"):
        clock.now += 1.0
        with trigger_event("numba:compile"):
            clock.now += 4.0
            with trigger_event("numba:compile"):  # a function that the kernel calls
                clock.now += 2.0
        clock.now += 0.5
    with stages("render", "Rendering"):
        with trigger_event("numba:compile"):
            clock.now += 3.0
        clock.now += 0.25
    assert stages.seconds == {"compile": 4 + 2 + 3, "encode": 1 + 0.5, "render": 0.25}
    assert next(iter(stages.seconds)) == "compile"
    assert progress.compilations == 1


def test_a_stage_that_compiles_nothing_says_nothing(clock: Clock) -> None:
    progress = RecordedProgress()
    stages = Stages(progress)
    with stages("encode", "Encoding"):
        clock.now += 1.0
    with trigger_event("numba:compile"):  # of no stage
        clock.now += 1.0
    assert stages.seconds == {"encode": 1.0}
    assert progress.compilations == 0


def test_a_kernel_from_disk_is_not_compiled(tmp_path: Path) -> None:
    """Numba's own event means what `Stages` takes it to mean."""
    path = tmp_path / "doubled.py"
    path.write_text("from numba import njit\n\n\n@njit(cache=True)\ndef kernel(x):\n    return 2 * x\n")

    def as_a_new_process_finds_it() -> Callable[[int], int]:
        space: dict = {"__name__": "doubled"}
        exec(compile(path.read_text(), str(path), "exec"), space)
        return space["kernel"]

    found = []
    for _ in range(2):
        stages = Stages()
        with stages("draw", "Drawing"):
            assert as_a_new_process_finds_it()(4) == 8
        found.append(list(stages.seconds))
    assert found == [["compile", "draw"], ["draw"]]

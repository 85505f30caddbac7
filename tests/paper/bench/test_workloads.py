"""What the rows run, on pictures so small that it takes milliseconds."""

from __future__ import annotations

import gc
import mmap
import os
import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from paper.bench.bench_inputs import context_views, generated_scene, load_network
from paper.bench.measure import WHOLE, CannotMeasureError
from paper.bench.peak_memory import PeakWatch, forget_peak, peak_mb
from paper.bench.rows import STAGES, BenchRow, every_row
from paper.bench.watches import Stopwatch
from paper.bench.workloads import command, competitors, prepare
from semgs.geometry.cameras import project
from semgs.model.gaussians.placing import SIGMA_UNIT

TINY = (32, 48)
ROWS = {row.name: row for row in every_row()}


def tiny(name: str, **changes) -> BenchRow:
    return replace(ROWS[name], size=TINY, threads=1, **changes)


def test_a_frame_tells_of_all_its_parts_and_they_fill_it() -> None:
    watch = Stopwatch()
    prepare(tiny("total_small_n2_float32"))(watch)
    assert set(watch.seconds) == {WHOLE, *STAGES}
    assert sum(watch.seconds[stage] for stage in STAGES) <= watch.seconds[WHOLE]


@pytest.mark.parametrize(
    "name",
    [
        "render_n2",
        "render_n2_colour",
        pytest.param("render_n2_backward", marks=pytest.mark.long),
        pytest.param("refine_small_n2", marks=pytest.mark.long),
        pytest.param("train_small_n2", marks=pytest.mark.long),
    ],
)
def test_the_other_rows_run(name: str) -> None:
    watch = Stopwatch()
    prepare(tiny(name))(watch)
    assert watch.seconds[WHOLE] > 0


def test_other_processes_compute_during_a_row_of_a_busy_machine_and_none_afterwards() -> None:
    others = _children()  # what earlier tests started for the whole session
    with competitors(3):
        first = _children() - others
        assert len(first) == 3
        begun = {process: _ticks(process) for process in first}
        until = time.monotonic() + 120
        while any(_ticks(process) == ticks for process, ticks in begun.items()):
            assert time.monotonic() < until
            time.sleep(0.05)
    assert not _children() & first
    watch = Stopwatch()
    prepare(tiny("total_small_n2_busy", beside=1))(watch)
    assert watch.seconds[WHOLE] > 0


def _children() -> set[int]:
    """Processes that this one started."""
    listed = Path("/proc/self/task", str(os.getpid()), "children")
    if not listed.exists():
        pytest.skip("processes are read from /proc, which is not here")
    return set(map(int, listed.read_text().split()))


def _ticks(process: int) -> int:
    """Time that a process has computed, in ticks of 10 ms."""
    return int(Path(f"/proc/{process}/stat").read_text().split()[13])


def test_a_row_that_needs_more_threads_than_there_are_says_so() -> None:
    with pytest.raises(CannotMeasureError, match="4096 threads needed"):
        prepare(replace(tiny("render_n2"), threads=4096))


def test_a_row_on_cuda_says_what_is_missing() -> None:
    if torch.cuda.is_available():
        pytest.skip("there is a CUDA device here")
    with pytest.raises(CannotMeasureError, match="no CUDA device"):
        prepare(ROWS["total_base_n2_bf16_b8_cuda"])


def test_the_generated_scene_is_what_its_row_says() -> None:
    gaussians, camera = generated_scene()
    assert len(gaussians) == 2 * 240 * 320
    assert 0.3 <= gaussians.opacities.min() < 0.31
    assert 0.94 < gaussians.opacities.max() <= 0.95
    assert gaussians.semantic is not None
    focal = float(camera.intrinsics[0, 0, 0])
    depths = gaussians.means[:, 2]  # the cameras look along z from z = 0
    assert torch.allclose(gaussians.colour.scales[:, 0] * focal / depths, torch.tensor(0.6))
    assert torch.allclose(gaussians.semantic.scales[:, 2] * focal / depths, torch.tensor(1.0))
    seen = project(gaussians.means[None], camera)[0]
    inside = (seen[:, 0] > 0) & (seen[:, 0] < 320) & (seen[:, 1] > 0) & (seen[:, 1] < 240)
    assert inside.float().mean() > 0.9


def test_the_generated_scene_follows_from_its_seed() -> None:
    one, again, other = (generated_scene(1, TINY, seed=seed)[0] for seed in (1, 1, 2))
    assert torch.equal(one.means, again.means)
    assert torch.equal(one.colour.features, again.colour.features)
    assert not torch.equal(one.opacities, other.opacities)


def test_the_random_weights_of_base_give_gaussians_of_one_pixel() -> None:
    views = context_views(2, (64, 80))
    with torch.no_grad():
        encoding = load_network("base")(views)
    pixel = (1 / views.cameras.focal_px).sum(-1)[:, None, None].float()
    unit = (pixel * encoding.depths).reshape(-1, 1) / 2  # what a pixel is at a Gaussian's depth [m]
    for one in (encoding.gaussians.colour, encoding.gaussians.semantic):
        assert float((one.scales / unit).median()) == pytest.approx(1.0, rel=0.1)
    assert SIGMA_UNIT == 0.1


def test_the_program_is_called_with_the_rows_network(tmp_path) -> None:
    assert command(ROWS["command_help"], tmp_path) == ["--help"]
    arguments = command(ROWS["command_small_n2"], tmp_path / "out")
    assert arguments[0] == "reconstruct"
    assert arguments[-4:] == ["--model", "small", "--views", "2"]


def test_the_peak_of_a_part_is_its_own() -> None:
    gc.collect()  # what other tests left would go meanwhile
    if not forget_peak():
        pytest.skip("this system does not let the peak start anew")
    watch = PeakWatch()
    start = peak_mb()
    with watch("whole"):
        with watch("large"):
            # From the system, because the heap may still have room that other tests have left.
            held = mmap.mmap(-1, 160_000_000, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
            held[:: mmap.PAGESIZE] = bytes(len(range(0, len(held), mmap.PAGESIZE)))
            held.close()
        with watch("little"):
            pass
    assert watch.peaks["large"] > start + 120
    assert watch.peaks["whole"] == watch.peaks["large"]
    assert watch.peaks["little"] < watch.peaks["large"] - 100


def test_a_watch_of_nothing_will_do() -> None:
    prepare(tiny("render_n2_colour"))(lambda part: nullcontext())

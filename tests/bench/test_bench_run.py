from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from time import sleep

import pytest
import torch

from semgs.bench.measure import WHOLE, CannotMeasureError
from semgs.bench.results import is_bench, numbers, read_bench
from semgs.bench.rows import Row, chosen_rows
from semgs.bench.run import run_bench, steps
from semgs.bench.targets import verdicts
from semgs.bench.workloads import Watch, Workload
from semgs.files.atomic import write_json
from semgs.files.errors import InputError

SIDE = 8


def product() -> None:
    """2 * 8^3 operations."""
    matrix = torch.ones(SIDE, SIDE)
    torch.mm(matrix, matrix)


def stand_in(row: Row, half: int = 50) -> Workload:
    """Two milliseconds of sleep and two products in place of what a row runs; bfloat16 ceilings do `half` times as many."""
    if row.device == "cuda":
        raise CannotMeasureError("no CUDA device")

    def run(watch: Watch) -> None:
        with watch(WHOLE):
            for part in ("cnn", "render"):
                with watch(part):
                    for _ in range(half if row.kind == "ceiling" and row.precision == "bfloat16" else 1):
                        product()
                    sleep(0.001)

    return Workload(run, details=lambda: {"pairs_colour": 7.0} if row.kind == "render" else {})


def found(*names: str, **options):
    given = {"prepared": stand_in, "begin": lambda: None, "peaks": lambda name: {WHOLE: 100.0, "cnn": 40.0}} | options
    return run_bench(chosen_rows(names), {"cores": 2}, **given)


def test_a_row_holds_its_least_and_median_seconds_its_operations_and_its_peak() -> None:
    bench = found("total_small_n2_float32", "cnn_small_n2")
    total, cnn = bench.results
    assert 0.002 <= total.seconds <= total.seconds_median
    assert 0.001 <= cnn.seconds < total.seconds
    assert total.repeats == cnn.repeats == 5
    assert total.gflop == pytest.approx(2 * 2 * SIDE**3 / 1e9)
    assert cnn.gflop == pytest.approx(2 * SIDE**3 / 1e9)
    assert cnn.gflop_per_second == pytest.approx(cnn.gflop / cnn.seconds)
    assert (total.peak_memory_mb, cnn.peak_memory_mb) == (100.0, 40.0)
    assert total.details["frames_per_second"] == pytest.approx(1 / total.seconds)


def test_the_share_of_the_ceiling_is_the_time_at_the_ceiling_over_the_time() -> None:
    bench = found("total_small_n2_float32")
    (total,) = bench.results
    ideal = total.gflop / bench.ceilings["ceiling_matmul_float32"]
    assert total.share_of_ceiling == pytest.approx(ideal / total.seconds, rel=1e-4)


def test_ceilings_are_measured_in_every_run_but_shown_where_they_are_asked_for() -> None:
    bench = found("render_n2")
    assert set(bench.ceilings) == {f"ceiling_{what}_float32" for what in ("conv", "matmul", "attention")}
    assert [result.name for result in bench.results] == ["render_n2"]
    shown = found("ceiling_matmul_float32").results[0]
    assert shown.share_of_ceiling == pytest.approx(1.0, rel=1e-4)


def test_ceilings_are_measured_in_turns_with_what_is_compared_with_them() -> None:
    order: list[str] = []

    def noted(row: Row) -> Workload:
        work = stand_in(row)

        def run(watch: Watch) -> None:
            order.append(row.kind)
            work.run(watch)

        return Workload(run)

    found("total_small_n2_float32", prepared=noted)
    assert order[-20:] == ["ceiling", "ceiling", "ceiling", "network"] * 5


def test_drawing_counts_pairs_and_no_operations() -> None:
    (drawn,) = found("render_n2").results
    assert drawn.gflop is None
    assert drawn.details == {"pairs_colour": 7.0}


def test_what_cannot_be_measured_stays_with_its_reason() -> None:
    bench = found("total_base_n2_float32_cuda", "total_small_n2_float32")
    absent, present = bench.results
    assert absent.seconds is None
    assert absent.reason == "no CUDA device"
    assert present.seconds is not None


@pytest.mark.parametrize(("half", "there"), [(50, True), (0, False)])
def test_bfloat16_is_measured_where_there_is_hardware_for_it(half: int, there: bool) -> None:
    bench = found("total_base_n2_bfloat16", prepared=partial(stand_in, half=half))
    (row,) = bench.results
    assert (row.seconds is not None) is there
    assert (verdicts(bench)["total_base_n2_bfloat16"][0].text == "no bf16 hardware") is not there


def test_as_many_steps_are_told_as_were_announced() -> None:
    rows = chosen_rows(["total_small_n2_float32", "cnn_small_n2", "render_n2"])
    told: list[int] = []
    run_bench(rows, {}, prepared=stand_in, begin=lambda: None, peaks=lambda name: None, done=lambda: told.append(1))
    assert len(told) == steps(rows)


def test_the_file_holds_what_was_found(tmp_path: Path) -> None:
    bench = found("total_small_n2_float32", "render_n2", "render_n2_cuda")
    path = tmp_path / "bench.json"
    write_json(path, numbers(bench))
    assert is_bench(path)
    again = read_bench(path)
    assert [result.name for result in again.results] == [result.name for result in bench.results]
    assert again.results[0].seconds == pytest.approx(bench.results[0].seconds, rel=1e-5)
    assert again.results[1].details == {"pairs_colour": 7.0}
    content = json.loads(path.read_text())
    assert content["machine"]["cores"] == 2
    keys = {
        "name",
        "seconds",
        "seconds_median",
        "repeats",
        "gflop",
        "gflop_per_second",
        "share_of_ceiling",
        "peak_memory_mb",
    }
    assert all(keys <= entry.keys() for entry in content["results"])
    assert content["results"][2]["seconds"] is None
    assert content["results"][2]["reason"] == "no CUDA device"
    assert "reason" not in content["results"][0]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "JSON file of semgs bench"),
        ('{"format": "semgs.report.evaluate", "version": 1}', "semgs.bench, version 1"),
        ('{"format": "semgs.bench", "version": 1, "machine": {}}', "whole file"),
        ('{"format": "semgs.bench", "version": 1, "machine": {}, "results": [{"name": "a"}]}', "whole file"),
    ],
)
def test_another_file_is_refused(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(InputError, match=told):
        read_bench(path)

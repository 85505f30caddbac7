from __future__ import annotations

import json
from pathlib import Path
from time import sleep

import pytest

from paper.bench.bench_file import BenchResult, numbers, read_bench
from paper.bench.measure import WHOLE, CannotMeasureError
from paper.bench.rows import BenchRow, chosen_rows
from paper.bench.run_bench import count_steps, run_bench
from paper.bench.workloads import Run, Watch
from semgs.files.atomic import write_json
from semgs.files.errors import InputError


def stand_in(row: BenchRow) -> Run:
    """Two milliseconds of sleep in place of what a row runs."""
    if row.device == "cuda":
        raise CannotMeasureError("no CUDA device")

    def run(watch: Watch) -> None:
        with watch(WHOLE):
            for part in ("cnn", "render"):
                with watch(part):
                    sleep(0.001)

    return run


def found(*names: str, **options):
    given = {"prepared": stand_in, "begin": lambda: None, "peaks": lambda name: {WHOLE: 100.0, "cnn": 40.0}} | options
    return run_bench(chosen_rows(names), {"cores": 2}, **given)


def test_a_row_holds_its_least_and_median_seconds_and_its_peak() -> None:
    bench = found("total_small_n2_float32", "cnn_small_n2")
    total, cnn = bench.results
    assert 0.002 <= total.seconds <= total.seconds_median
    assert 0.001 <= cnn.seconds < total.seconds
    assert total.repeats == cnn.repeats == 5
    assert (total.peak_memory_mb, cnn.peak_memory_mb) == (100.0, 40.0)


def test_what_cannot_be_measured_stays_with_its_reason() -> None:
    bench = found("total_base_n2_float32_cuda", "total_small_n2_float32")
    absent, present = bench.results
    assert absent.seconds is None
    assert absent.reason == "no CUDA device"
    assert present.seconds is not None


def test_as_many_steps_are_told_as_were_announced() -> None:
    rows = chosen_rows(["total_small_n2_float32", "cnn_small_n2", "render_n2"])
    told: list[int] = []
    run_bench(rows, {}, prepared=stand_in, begin=lambda: None, peaks=lambda name: None, done=lambda: told.append(1))
    assert len(told) == count_steps(rows)


def test_the_file_holds_what_was_found(tmp_path: Path) -> None:
    bench = found("total_small_n2_float32", "render_n2", "render_n2_cuda")
    path = tmp_path / "bench.json"
    write_json(path, numbers(bench))
    again = read_bench(path)
    assert [result.name for result in again.results] == [result.name for result in bench.results]
    assert again.results[0].seconds == pytest.approx(bench.results[0].seconds, rel=1e-5)
    content = json.loads(path.read_text())
    assert content["machine"]["cores"] == 2
    keys = {"name", "seconds", "seconds_median", "repeats", "peak_memory_mb"}
    assert all(keys <= entry.keys() for entry in content["results"])
    assert content["results"][2]["seconds"] is None
    assert content["results"][2]["reason"] == "no CUDA device"
    assert "reason" not in content["results"][0]


def test_rows_are_measured_in_turns() -> None:
    order: list[str] = []

    def noted(row: BenchRow) -> Run:
        return lambda watch: (order.append(row.kind), stand_in(row)(watch))[1]

    found("total_small_n2_float32", "render_n2", prepared=noted)
    assert order == ["network"] * 2 + ["render"] * 2 + ["network", "render"] * 5


def test_a_file_of_an_older_version_is_read_without_what_is_no_longer_measured(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    entry = {"name": "cnn_base_n2", "seconds": 0.2, "seconds_median": 0.25, "repeats": 5, "peak_memory_mb": 498.0}
    older = {"gflop": 29.2, "gflop_per_second": 143.0, "share_of_ceiling": 0.63, "details": {"pairs_colour": 7.0}}
    content = {"format": "semgs.bench", "version": 1, "machine": {"ceilings": {}}, "results": [entry | older]}
    path.write_text(json.dumps(content))
    assert read_bench(path).results == (BenchResult("cnn_base_n2", 0.2, 0.25, 5, 498.0),)
    content["results"][0]["name"] = "total_small_n2_bfloat16"
    path.write_text(json.dumps(content))
    assert read_bench(path).results[0].name == "total_small_n2_bf16"


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("{", "JSON file of a bench"),
        ('{"format": "semgs.report.evaluate", "version": 1}', "semgs.bench, version 1"),
        ('{"format": "semgs.bench", "version": 1, "machine": {}}', "complete file"),
        ('{"format": "semgs.bench", "version": 1, "machine": {}, "results": [{"name": "a"}]}', "complete file"),
        (
            '{"format": "semgs.bench", "version": 1, "machine": {}, "results": [{"name": "a", "repeats": Infinity}]}',
            "complete file",
        ),
    ],
)
def test_another_file_is_refused(tmp_path: Path, text: str, told: str) -> None:
    path = tmp_path / "other.json"
    path.write_text(text)
    with pytest.raises(InputError, match=told):
        read_bench(path)

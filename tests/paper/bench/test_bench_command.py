from __future__ import annotations

import json
from pathlib import Path

import pytest
from paper_commands import main

from paper.bench.bench_file import BenchReport, BenchResult, numbers
from paper.bench.bench_tables import bench_table
from paper.bench.rows import chosen_rows


def write(path: Path, *results: BenchResult) -> Path:
    path.write_text(json.dumps(numbers(BenchReport({}, results))))
    return path


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--only", "total_smal_n2_float32"], "did you mean total_small_n2_float32"),
        (["--only", "x"], "there is no such row"),
        (["--json", "nowhere/bench.json"], "no such folder"),
        (["--json", "."], "a folder"),
    ],
)
def test_what_cannot_be_done_is_told_in_one_line(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bench", *arguments]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert len(error.splitlines()) == 1


def test_a_row_that_cannot_be_measured_here_is_no_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    torch = pytest.importorskip("torch")
    if torch.cuda.is_available():
        pytest.skip("there is a CUDA device here")
    assert main(["bench", "--only", "total_small_n2_float32_cuda", "--json", str(tmp_path / "bench.json")]) == 0
    assert "no CUDA device" in capsys.readouterr().out
    (entry,) = json.loads((tmp_path / "bench.json").read_text())["results"]
    assert (entry["name"], entry["seconds"]) == ("total_small_n2_float32_cuda", None)
    assert entry["reason"] == "no CUDA device"


def test_the_table_has_seconds_and_memory_and_says_what_was_not_measured() -> None:
    absent = [BenchResult(row.name, None, reason="no CUDA device") for row in chosen_rows() if row.device == "cuda"]
    measured = (
        BenchResult("total_base_n2_float32", 3.9, 4.0, 5, 1300.4),
        BenchResult("train_small_n2", None, reason="no room"),
        BenchResult("cnn_base_n2", 0.2, 0.2, 5),
    )
    table = bench_table(BenchReport({}, (*measured, *absent)))
    lines = {line.split()[0]: line for line in table.splitlines() if line}
    assert lines["total_base_n2_float32"].split()[1:] == ["3.900", "4.000", "1,300"]
    assert lines["cnn_base_n2"].split()[1:] == ["0.2000", "0.2000", "–"]
    assert "Not measured (no room): train_small_n2." in table
    assert f"Not measured (no CUDA device): {len(absent)} rows" in table
    assert "total_small_n4_float32_cuda" not in table


def test_two_files_are_compared_row_by_row(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = write(
        tmp_path / "before.json", BenchResult("render_n2", 0.2, peak_memory_mb=500.0), BenchResult("cnn_base_n2", 1.0)
    )
    after = write(
        tmp_path / "after.json", BenchResult("render_n2", 0.1, peak_memory_mb=450.0), BenchResult("depth_base_n2", 1.0)
    )
    assert main(["bench", "--compare", str(before), str(after)]) == 0
    told = capsys.readouterr().out
    row = next(line for line in told.splitlines() if line.startswith("render_n2"))
    assert row.split() == ["render_n2", "0.2000", "0.1000", "0.500", "500", "450"]
    assert "cnn_base_n2" not in told
    # The table has no title, so it begins with its rows.
    for form, first in (("text", "─"), ("markdown", "| row |"), ("latex", r"\begin{table*}")):
        assert main(["bench", "--compare", str(before), str(after), "--format", form]) == 0
        written = capsys.readouterr().out
        assert written.startswith(first)
        assert r"\caption{ratio: seconds" in written or form != "latex"


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("before.json",), "expected two files, found 1"),
        (("before.json", "other.json"), "semgs.bench"),
        (("before.json", "nothing.json"), "nothing there"),
        (("before.json", "unmeasured.json"), "before and unmeasured have no measured row in common"),
        (("no_time.json", "before.json"), "no_time and before have no measured row in common"),
    ],
)
def test_what_cannot_be_compared_is_told(
    tmp_path: Path, names: tuple[str, ...], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "before.json", BenchResult("render_n2", 0.2))
    write(tmp_path / "unmeasured.json", BenchResult("render_n2", None, reason="no CUDA device"))
    write(tmp_path / "no_time.json", BenchResult("render_n2", 0.0))
    (tmp_path / "other.json").write_text("{}")
    assert main(["bench", "--compare", *(str(tmp_path / name) for name in names)]) == 2
    assert told in capsys.readouterr().err

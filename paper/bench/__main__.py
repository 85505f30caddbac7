"""The bench: measures time and memory on this machine, or compares two measurements."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Literal

from paper.bench.rows import BenchRow, chosen_rows, every_row
from paper.program import run
from semgs.cli.progress import show_progress, show_stage
from semgs.files.atomic import check_file
from semgs.files.errors import InputError
from semgs.run.options.words import optional
from semgs.run.usage_errors import UsageError, what_the_user_gave


@dataclass(frozen=True)
class Bench:
    """Measure time and memory on this machine.

    Each row of the table is one measurement, and its name describes it:
    - total_small_n2_float32: two 240x320 views to Gaussians, and one target rendered with colour, classes and depth
    - total_small_n2_busy: the same while eight other programs compute
    - cnn_base_n2, transformer_colour_base_n2, ...: the parts of that
    - render_n2, render_n2_colour, render_n2_backward: a generated scene of 153,600 Gaussians
    - train_small_n2, command_small_n2, command_help: a training step, and the program itself

    All rows use two threads, at 240x320. Batch size and CUDA are at the end of the name (_b8_cuda). Each time is the best of
    five, taken in turns after two warm-up runs; anything over 20 s is measured once. Do not use the machine meanwhile.
    docs/benchmarks.md has results from other machines.

    Examples
    - python -m paper.bench --quick
    - python -m paper.bench --json before.json
    - python -m paper.bench --only total_small_n2_float32 cost_volume_small_n2
    - python -m paper.bench --compare before.json after.json
    """

    json: Annotated[Path | None, optional("FILE")] = None
    """Write the numbers to this file."""
    only: Annotated[tuple[str, ...], optional("NAME [NAME ...]")] = ()
    """Only measure these."""
    quick: bool = False
    """Only the quick measurements, in under a minute."""
    compare: Annotated[tuple[Path, ...], optional("BEFORE AFTER")] = ()
    """Measure nothing: compare two files of earlier benches row by row."""
    format: Literal["text", "markdown", "latex"] = "text"
    """With --compare: for a terminal, a page or a paper (LaTeX with booktabs)."""

    def run(self) -> None:
        """Measure, write the file, and print the table.

        Raises:
            InputError: the output file cannot be written.
            UsageError: there is no row of a given name, or there are not two files to compare.
        """
        if self.compare:
            print(self._comparison())
            return
        rows = self._rows()
        if self.json is not None:
            check_file(self.json)
        with show_stage("Starting"):
            import torch

            from paper.bench.bench_file import numbers
            from paper.bench.bench_tables import bench_table
            from paper.bench.run_bench import count_steps, run_bench
            from semgs.evaluation.tables.environment import hardware, versions
            from semgs.files.atomic import write_json

        machine = {**hardware("cuda" if torch.cuda.is_available() else "cpu"), "versions": versions()}
        count = 0
        with show_progress(f"Measuring {len(rows)} rows", count_steps(rows)) as shown:

            def done() -> None:
                nonlocal count
                count += 1
                shown(count)

            bench = run_bench(rows, machine, done=done)
        if self.json is not None:
            write_json(self.json, numbers(bench))
        print(bench_table(bench))

    def _comparison(self) -> str:
        """The table of two files."""
        if len(self.compare) != 2:
            raise UsageError(f"--compare: expected two files, found {len(self.compare)}")
        from paper.bench.bench_file import read_bench
        from paper.bench.bench_tables import comparison_table

        for path in self.compare:
            if not path.exists():
                raise InputError(path, "a file of the bench", "nothing there")
        names = [path.stem for path in self.compare]
        if names[0] == names[1]:
            names = [str(path) for path in self.compare]
        before, after = map(read_bench, self.compare)
        with what_the_user_gave():
            return comparison_table(before, after, names, self.format)

    def _rows(self) -> tuple[BenchRow, ...]:
        """The rows to measure."""
        try:
            return chosen_rows(self.only, self.quick)
        except KeyError as error:
            name = str(error.args[0])
            names = [row.name for row in every_row()]
            near = get_close_matches(name, names, n=3)
            hint = f"did you mean {' or '.join(near)}?" if near else f"such as {', '.join(names[:3])}"
            raise UsageError(f"--only {name}: there is no such row; {hint}") from None


if __name__ == "__main__":
    sys.exit(run(Bench, "bench"))

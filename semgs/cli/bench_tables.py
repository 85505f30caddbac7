"""Tables of the bench: what was found beside what was aimed at, and two of them side by side."""

from __future__ import annotations

from collections.abc import Sequence

from semgs.bench.results import Bench, Result
from semgs.bench.targets import REFERENCE_GFLOPS, Verdict, slowness, verdicts
from semgs.evaluation.tables.grid import Cell, Format, Grid, printed

HEAD = ("row", "seconds", "median", "GFLOP", "GFLOP/s", "of ceiling", "MB", "target")


def bench_table(bench: Bench, form: Format = "text") -> str:
    """What a bench found, and for rows with targets whether they are met."""
    judged = verdicts(bench)
    shown = [result for result in bench.results if result.seconds is not None or result.name in judged]
    rows = [
        tuple(Cell(text) for text in (*_cells(result), "; ".join(_told(judged.get(result.name, [])))))
        for result in shown
    ]
    return printed(Grid("", (), HEAD, tuple(rows), notes=tuple(_notes(bench, shown))), form).lstrip("\n")


def comparison_table(first: Bench, second: Bench, names: Sequence[str], form: Format = "text") -> str:
    """The rows of two benches that both measured, and how the second stands to the first."""
    rows = []
    for name, before in first.by_name.items():
        after = second.by_name.get(name)
        if after is None or before.seconds is None or after.seconds is None:
            continue
        texts = (
            name,
            seconds(before.seconds),
            seconds(after.seconds),
            f"{after.seconds / before.seconds:.3f}",
            number(before.peak_memory_mb),
            number(after.peak_memory_mb),
        )
        rows.append(tuple(Cell(text) for text in texts))
    head = ("row", f"{names[0]} [s]", f"{names[1]} [s]", "ratio", f"{names[0]} [MB]", f"{names[1]} [MB]")
    factor = slowness(first.ceilings), slowness(second.ceilings)
    notes = ["ratio: the second's seconds over the first's."]
    if max(factor) > 1.1 * min(factor):
        notes.append(
            f"The machines differ: targets of whole frames are for {factor[0]:.2f} and {factor[1]:.2f} times the seconds."
        )
    return printed(Grid("", (), head, tuple(rows), notes=tuple(notes)), form).lstrip("\n")


def seconds(value: float | None) -> str:
    """Seconds as text."""
    return "–" if value is None else f"{value:.4f}" if value < 1 else f"{value:.3f}"


def number(value: float | None) -> str:
    """A number as text, to whole ones or three digits."""
    return "–" if value is None else f"{value:,.0f}" if value >= 100 else f"{value:.3g}"


def _cells(result: Result) -> list[str]:
    """The cells of a row but its target."""
    share = result.share_of_ceiling
    return [
        result.name,
        seconds(result.seconds),
        seconds(result.seconds_median),
        number(result.gflop),
        number(result.gflop_per_second),
        "–" if share is None else f"{100 * share:.0f} %",
        number(result.peak_memory_mb),
    ]


def _told(found: Sequence[Verdict]) -> list[str]:
    """The texts of the verdicts on a row, each once."""
    return list(dict.fromkeys(one.text for one in found))


def _notes(bench: Bench, shown: Sequence[Result]) -> list[str]:
    """What stands below the table."""
    notes = ["Seconds are the least of the repeats; MB is the most memory of the whole process (on CUDA: of the GPU)."]
    factor = slowness(bench.ceilings)
    if factor > 1:
        notes.append(
            f"Targets of whole frames and of drawing are for {REFERENCE_GFLOPS:g} GFLOP/s of float32 convolutions; "
            f"this machine does {REFERENCE_GFLOPS / factor:.0f}, so they are multiplied by {factor:.2f}."
        )
    left_out: dict[str, list[str]] = {}
    for result in bench.results:
        if result not in shown:
            left_out.setdefault(result.reason or "not measured", []).append(result.name)
    for reason, names in left_out.items():
        few = ", ".join(names) if len(names) <= 3 else f"{len(names)} rows, from {names[0]} to {names[-1]}"
        notes.append(f"Not measured ({reason}): {few}.")
    return notes

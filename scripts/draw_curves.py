"""Draw how cost grows with views, pixels and threads: docs/images/curves.png and the part "How cost grows" of docs/benchmarks.md.

    semgs bench --curves --json curves.json
    python scripts/draw_curves.py curves.json

Where a row stands in several files (parts of the curves, measured one after the other with --only), the first one that has its time counts.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from pathlib import Path

from semgs.bench.results import Result, read_bench
from semgs.bench.rows import CURVE_SIZES, CURVE_THREADS, CURVE_VIEWS, NETWORKS, Row, every_row
from semgs.evaluation.tables.card import between
from semgs.files.atomic import write_bytes, write_text
from semgs.files.errors import InputError

DOCS = Path(__file__).resolve().parent.parent / "docs"
PICTURE = DOCS / "images" / "curves.png"
PAGE = DOCS / "benchmarks.md"
BEGIN, END = "<!-- curves -->", "<!-- end of curves -->"

COLOURS = ("#4c78a8", "#f58518", "#54a24b")
STYLES = {1: "--", 2: "-"}
"""Of the sizes, and of the numbers of threads."""

Curve = tuple[str, tuple[int, int], int]
"""A network, a size and a number of threads."""


def curves(files: Sequence[Path]) -> dict[Curve, dict[int, Result]]:
    """What was measured, by curve and by N; what was not is left out.

    Raises:
        InputError: one of them is not a file of the bench.
    """
    measured: dict[str, Result] = {}
    for file in files:
        for result in read_bench(file).results:
            if result.seconds is not None:
                measured.setdefault(result.name, result)
    found: dict[Curve, dict[int, Result]] = {
        (network, size, threads): {} for network in NETWORKS for size in CURVE_SIZES for threads in CURVE_THREADS
    }
    for row in every_row():
        if _is_frame(row) and row.name in measured:
            found[row.network, row.size, row.threads][row.views] = measured[row.name]
    return found


def table(found: dict[Curve, dict[int, Result]], network: str) -> str:
    """Seconds (and GB) of a network: N down, sizes and threads across."""
    across = [(size, threads) for size in CURVE_SIZES for threads in CURVE_THREADS]
    head = [f"{_size(size)}, {threads} thread" + ("s" if threads > 1 else "") for size, threads in across]
    lines = [["N", *head], ["---:"] * (len(across) + 1)]
    for views in CURVE_VIEWS:
        lines.append([str(views), *(_cell(found[network, *place].get(views)) for place in across)])
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def picture(found: dict[Curve, dict[int, Result]]) -> bytes:
    """Seconds over N as PNG, a plot for each network."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter

    figure = Figure(figsize=(8, 3.6), layout="constrained")
    FigureCanvasAgg(figure)
    plots = figure.subplots(1, len(NETWORKS), sharey=True)
    for plot, network in zip(plots, NETWORKS, strict=True):
        for size, colour in zip(CURVE_SIZES, COLOURS, strict=True):
            for threads in CURVE_THREADS:
                points = found[network, size, threads]
                label = _size(size) if threads == max(CURVE_THREADS) else None
                plot.plot(
                    list(points), [result.seconds for result in points.values()], STYLES[threads], color=colour,
                    marker="o", markersize=3, linewidth=1.2, label=label,
                )  # fmt: skip
        plot.set_yscale("log")
        plot.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        plot.set_title(f"{network}", fontsize=10)
        plot.set_xlabel("views (N)", fontsize=9)
        plot.grid(True, which="major", linewidth=0.4, color="0.85")
        plot.tick_params(labelsize=8)
    plots[0].set_ylabel("seconds a frame", fontsize=9)
    plots[0].legend(fontsize=8, frameon=False, title="2 threads; dashed: 1", title_fontsize=8)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=130, metadata={"Software": None})
    return buffer.getvalue()


def main(arguments: Sequence[str]) -> int:
    """Write picture and tables."""
    if not arguments:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        found = curves([Path(argument) for argument in arguments])
    except InputError as error:
        print(f"semgs: error: {error}", file=sys.stderr)
        return 2
    text = "\n\n".join(f"`{network}`, seconds (GB):\n\n{table(found, network)}" for network in NETWORKS)
    write_bytes(PICTURE, picture(found))
    write_text(PAGE, between(PAGE.read_text(encoding="utf-8"), text, BEGIN, END))
    return 0


def _is_frame(row: Row) -> bool:
    """Whether a row is a point of a curve: a whole frame on the CPU in float32."""
    return (row.kind, row.part, row.precision, row.device, row.batch) == ("network", "total", "float32", "cpu", 1)


def _size(size: tuple[int, int]) -> str:
    """A size as rows are named."""
    return f"{size[0]}x{size[1]}"


def _cell(result: Result | None) -> str:
    """A time, and the memory if it is known."""
    if result is None or result.seconds is None:
        return "–"
    memory = "" if result.peak_memory_mb is None else f" ({result.peak_memory_mb / 1000:.1f})"
    return f"{result.seconds:.3g}{memory}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""Prints tables as text, Markdown or LaTeX, and metrics as their cells, with or without intervals. No torch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from semgs.objectives.measures import shown_number

Format = Literal["text", "markdown", "latex"]


@dataclass(frozen=True)
class Cell:
    """A cell: its text, whether it is the best in its column, and whether it is marked."""

    text: str
    best: bool = False
    marked: bool = False


@dataclass(frozen=True)
class Grid:
    """A table.

    Attributes:
        title: of the table; "" for none.
        head: column headings; the first is for the names.
        rows: of equal length; the first cell is the name.
        groups: headings above columns, each with the number of columns that it spans; the first column has none.
        rules: rows that have a line above them.
        mark: suffix of marked cells.
        notes: below the table, a sentence each.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    groups: tuple[tuple[str, int], ...] = ()
    rules: tuple[int, ...] = ()
    mark: str = "†"
    notes: tuple[str, ...] = ()


def printed(grid: Grid, form: Format) -> str:
    """The table in a format, without a final line end."""
    return {"text": _text, "markdown": _markdown, "latex": _latex}[form](grid)


def _text(grid: Grid) -> str:
    """For a terminal: columns aligned, numbers right-aligned, groups below each other."""
    blocks, start = [], 1
    for heading, span in grid.groups or (("", len(grid.head) - 1),):
        columns = [0, *range(start, start + span)]
        blocks.append(_block(grid, heading, columns))
        start += span
    return "\n".join([*([grid.title] if grid.title else []), "\n\n".join(blocks), *grid.notes])


def _block(grid: Grid, heading: str, columns: list[int]) -> str:
    """Some columns of a table, with lines around them."""
    head = [heading or grid.head[0], *[grid.head[column] for column in columns[1:]]]
    rows = [[row[column].text + (grid.mark if row[column].marked else "") for column in columns] for row in grid.rows]
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]

    def line(cells: list[str]) -> str:
        numbers = [text.rjust(width) for text, width in zip(cells[1:], widths[1:], strict=True)]
        return "  ".join([cells[0].ljust(widths[0]), *numbers]).rstrip()

    rule = "─" * (sum(widths) + 2 * (len(widths) - 1))
    lines = [rule, line(head), rule]
    for number, row in enumerate(rows):
        lines += [rule] if number in grid.rules else []
        lines.append(line(row))
    return "\n".join([*lines, rule])


def _markdown(grid: Grid) -> str:
    """For Markdown. It has no spanning cells, so groups become part of each column's heading."""
    head = list(grid.head)
    start = 1
    for heading, span in grid.groups:
        for column in range(start, start + span):
            head[column] = f"{heading}: {head[column]}"
        start += span

    def escaped(text: str) -> str:
        return text.replace("|", "\\|").replace("*", "\\*")

    def shown(cell: Cell) -> str:
        text = escaped(cell.text + (grid.mark if cell.marked else ""))
        return f"**{text}**" if cell.best else text

    above = [f"**{escaped(grid.title)}**", ""] if grid.title else []
    lines = [*above, "| " + " | ".join(map(escaped, head)) + " |"]
    lines.append("|" + "|".join(["---", *["---:"] * (len(head) - 1)]) + "|")
    lines += ["| " + " | ".join(map(shown, row)) + " |" for row in grid.rows]
    if notes := [*map(escaped, grid.notes)]:
        lines += ["", *[f"{note}  " for note in notes[:-1]], notes[-1]]
    return "\n".join(lines)


def _latex(grid: Grid) -> str:
    """For a paper that loads booktabs."""

    def shown(cell: Cell) -> str:
        text = _escaped(cell.text + (grid.mark if cell.marked else ""))
        return rf"\textbf{{{text}}}" if cell.best else text

    spans = [span for _, span in grid.groups] or [len(grid.head) - 1]
    titles = [f"{grid.title.rstrip('.')}."] if grid.title else []
    lines = [
        r"\begin{table*}[t]",
        r"\centering",
        rf"\caption{{{_escaped(' '.join([*titles, *grid.notes]))}}}",
        rf"\begin{{tabular}}{{l{''.join('|' + 'c' * span for span in spans)}}}",
        r"\toprule",
    ]
    if grid.groups:
        last = len(grid.groups) - 1
        cells = [
            rf"\multicolumn{{{span}}}{{{'c' if number == last else 'c|'}}}{{{_escaped(heading)}}}"
            for number, (heading, span) in enumerate(grid.groups)
        ]
        lines.append(" & ".join(["", *cells]).strip() + r" \\")
    lines += [" & ".join(map(_escaped, grid.head)) + r" \\", r"\midrule"]
    for number, row in enumerate(grid.rows):
        lines += [r"\midrule"] if number in grid.rules else []
        lines.append(" & ".join(map(shown, row)) + r" \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table*}"])


_LATEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "–": "--", "−": "$-$", "†": r"$^\dagger$", "‡": r"$^\ddagger$", "δ": r"$\delta$",
    "<": "$<$", ">": "$>$", "↑": r"$\uparrow$", "↓": r"$\downarrow$", "±": r"$\pm$",
}  # fmt: skip


def _escaped(text: str) -> str:
    """Text escaped for LaTeX."""
    return "".join(_LATEX.get(letter, letter) for letter in text)


def with_interval(metric: str, value: float | None, low: float | None, high: float | None) -> str:
    """A metric as text, followed by its interval in brackets if it has one."""
    text = shown_number(metric, value)
    if low is None or high is None:
        return text
    return f"{text} [{shown_number(metric, low)}, {shown_number(metric, high)}]"


def score_cells(numbers: Mapping[str, Any], metrics: Sequence[str], worse: Sequence[str] = ()) -> list[Cell]:
    """A cell for each metric.

    Args:
        numbers: by metric, as in a report.
        metrics: to show.
        worse: the metrics to mark.
    """
    return [Cell(shown_number(metric, numbers.get(metric)), marked=metric in worse) for metric in metrics]


def interval_cells(numbers: Mapping[str, Any], metrics: Sequence[str], worse: Sequence[str] = ()) -> list[Cell]:
    """As `score_cells`, with the intervals in `numbers`."""
    ends = {metric: numbers.get("intervals", {}).get(metric, (None, None)) for metric in metrics}
    return [
        Cell(with_interval(metric, numbers.get(metric), *ends[metric]), marked=metric in worse) for metric in metrics
    ]

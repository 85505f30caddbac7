from __future__ import annotations

from dataclasses import replace

from semgs.evaluation.tables.table_grid import Cell, Grid, printed

GRID = Grid(
    title="Two targets_of 50 %",
    groups=(("2 views", 2), ("3 views", 1)),
    head=("method", "mIoU", "acc.", "mIoU"),
    rows=(
        (Cell("a|b"), Cell("0.5"), Cell("0.25", best=True, marked=True), Cell("–")),
        (Cell("copy & paste"), Cell("0.75"), Cell("1"), Cell("12.125")),
    ),
    rules=(1,),
    notes=("† worse.",),
)


def test_text_is_aligned_with_numbers_at_the_right_and_a_block_for_each_group():
    assert printed(GRID, "text").splitlines() == [
        "Two targets_of 50 %",
        "─────────────────────────",
        "2 views       mIoU   acc.",
        "─────────────────────────",
        "a|b            0.5  0.25†",
        "─────────────────────────",
        "copy & paste  0.75      1",
        "─────────────────────────",
        "",
        "────────────────────",
        "3 views         mIoU",
        "────────────────────",
        "a|b                –",
        "────────────────────",
        "copy & paste  12.125",
        "────────────────────",
        "† worse.",
    ]


def test_markdown_names_the_group_in_each_heading_and_escapes_bars():
    assert printed(GRID, "markdown").splitlines() == [
        "**Two targets_of 50 %**",
        "",
        "| method | 2 views: mIoU | 2 views: acc. | 3 views: mIoU |",
        "|---|---:|---:|---:|",
        "| a\\|b | 0.5 | **0.25†** | – |",
        "| copy & paste | 0.75 | 1 | 12.125 |",
        "",
        "† worse.",
    ]


def test_latex_is_a_booktabs_table_with_every_special_letter_escaped():
    assert printed(GRID, "latex").splitlines() == [
        r"\begin{table*}[t]",
        r"\centering",
        r"\caption{Two targets\_of 50 \%. $^\dagger$ worse.}",
        r"\begin{tabular}{l|cc|c}",
        r"\toprule",
        r"& \multicolumn{2}{c|}{2 views} & \multicolumn{1}{c}{3 views} \\",
        r"method & mIoU & acc. & mIoU \\",
        r"\midrule",
        r"a|b & 0.5 & \textbf{0.25$^\dagger$} & -- \\",
        r"\midrule",
        r"copy \& paste & 0.75 & 1 & 12.125 \\",
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table*}",
    ]


def test_a_marked_cell_has_the_mark_that_the_note_explains_in_every_format():
    """A star is literal in LaTeX. In Markdown it is escaped, because a line that begins with a star is an item of a list."""
    starred = replace(GRID, mark=" *", notes=("* clear.",))
    text, markdown, latex = (printed(starred, form) for form in ("text", "markdown", "latex"))
    assert "0.25 *" in text
    assert "| a\\|b | 0.5 | **0.25 \\*** | – |" in markdown
    assert markdown.endswith("\n\\* clear.")
    assert r"a|b & 0.5 & \textbf{0.25 *} & -- \\" in latex
    assert r"50 \%. * clear.}" in latex

"""The paper's numbers beside ours: they are those that it prints, marked, and never the best of a column."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from paper.ablate.ablation_rows import ROWS
from semgs.evaluation.tables.comparison_tables import PAPER
from semgs.evaluation.tables.published_results import PUBLISHED


def printed(paper: str, label: str) -> list[list[float]]:
    """The numbers of each row of a table in the paper's text."""
    end = paper.index(f"\\label{{{label}}}")
    table = paper[paper.rindex("\\begin{tabular}", 0, end) : end]
    body = table[table.index("\\midrule") : table.index("\\bottomrule")]
    rows = [
        re.findall(r"(?<![\w.])\d+\.\d+", re.sub(r"\\rule\{[^}]*\}\{[^}]*\}", "", line)) for line in body.split("\\\\")
    ]
    return [[float(number) for number in row] for row in rows if row]


@pytest.mark.parametrize(
    ("name", "label"), [("scannet", "tab:scannet"), ("scannetpp", "tab:scannet++"), ("ablation", "tab:ablation")]
)
def test_every_published_number_is_the_papers(shared: Path, name: str, label: str):
    paper = (shared / "paper" / "semgs.tex").read_text()
    ours = [
        [row.numbers[views][one] for views in row.numbers for one in PAPER if one in row.numbers[views]]
        for row in PUBLISHED[name].rows
    ]
    assert ours == printed(paper, label)
    assert len(ours) in (3, 5)


def test_the_rows_of_the_ablation_have_the_names_of_ours():
    assert [row.name for row in PUBLISHED["ablation"].rows] == [row.title for row in ROWS]
    assert [set(row.numbers) for row in PUBLISHED["ablation"].rows] == [{4}] * len(ROWS)


def test_what_cannot_be_known_is_told_below_every_table():
    for table in PUBLISHED.values():
        told = " ".join(table.notes)
        assert "ten test scenes" in told
        assert "kind of mIoU" in told

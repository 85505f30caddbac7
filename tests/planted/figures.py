"""Errors planted in `semgs/figures`."""

from __future__ import annotations

from planted.mutant import Mutant

FIGURES = (
    Mutant(
        "a class of one percent counts as rare", "semgs/figures/html_page.py",
        "if entry.share < RARE)", "if entry.share <= RARE)", ("tests/figures/test_page.py",),
    ),
    Mutant(
        "a percentage is a share", "semgs/files/text.py",
        'f"{100 * share:.0f} %"', 'f"{share:.0f} %"', ("tests/figures/test_numbers.py",),
    ),
)  # fmt: skip

"""The pages that a release updates, and how to replace sections in them."""

from __future__ import annotations

from pathlib import Path

from semgs.files.atomic import write_text

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
CARD = DOCS / "model_card.md"
RISKS = DOCS / "images" / "plot_risk_coverage.png"
SCORES = DOCS / "scores"
"""Reports reduced to what the tables of the card need."""


def replace_between(page: str, text: str, first: str, last: str) -> str:
    """A page with the text between two markers replaced.

    Raises:
        ValueError: the page does not have each marker once, in order.
    """
    before, begin, rest = page.partition(first)
    _, end, after = rest.partition(last)
    if not begin or not end or first in rest or last in after:
        raise ValueError(f"expected {first} and, below it, {last}, once each")
    return f"{before}{first}\n\n{text}\n\n{last}{after}"


def write_between(path: Path, text: str, first: str, last: str) -> None:
    """Replace the text between two markers of a file. Raises what `replace_between` raises."""
    write_text(path, replace_between(path.read_text(encoding="utf-8"), text, first, last))

"""The pages that a release rewrites, and the places in them."""

from __future__ import annotations

from pathlib import Path

from semgs.files.atomic import write_text

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
CARD = DOCS / "model_card.md"
SCORES = DOCS / "scores"
"""Reports, reduced to what the tables of the card need."""


def between(page: str, text: str, first: str, last: str) -> str:
    """A page with a text between two lines that mark its place, in place of what was there.

    Raises:
        ValueError: the page has not one of each mark, in order.
    """
    before, begin, rest = page.partition(first)
    _, end, after = rest.partition(last)
    if not begin or not end or first in rest or last in after:
        raise ValueError(f"expected {first} and, below it, {last}, once each")
    return f"{before}{first}\n\n{text}\n\n{last}{after}"


def write_between(path: Path, text: str, first: str, last: str) -> None:
    """Put a text between two lines of a file; errors as `between`."""
    write_text(path, between(path.read_text(encoding="utf-8"), text, first, last))

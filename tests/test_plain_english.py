"""Docstrings, error messages and pages of the docs are free of phrases that read as if translated (CONTRIBUTING.md)."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

PHRASES = (
    "found out", "goes on", "go on with", "is told", "are told", "asked for", "nobody", "anybody", "peers'", "sitting", "trivial row", "trivial rows",
    "beforehand", "what ships", "where there is none", "where there is one", "where there are none", "one's own", "as it stands", "mended",
    "none needs nothing", "stands beside", "of its own accord", "in the manner of", "shall",
)  # fmt: skip
"""What to say instead: detected, resumes, reported, requested, "if there is none", fixed ..."""


PAGES = (
    "README.md", "CHANGELOG.md",
    *(str(path.relative_to(ROOT)) for folder in ("docs", "docs/examples", "docs/lab") for path in sorted((ROOT / folder).glob("*.md"))),
    *(str(path.relative_to(ROOT)) for path in sorted((ROOT / "docs/lab").glob("*.json"))),
)  # fmt: skip
"""All pages of the docs."""


def written(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of each docstring in a module, of attributes too, and of each string that is raised."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.lineno, node.value.value
        elif isinstance(node, ast.Raise):
            texts = (one for one in ast.walk(node) if isinstance(one, ast.Constant) and isinstance(one.value, str))
            yield from ((one.lineno, str(one.value)) for one in texts)


def banned_in(text: str) -> list[str]:
    """The phrases that occur in a text as whole words."""
    plain = " ".join(text.lower().split())
    return [phrase for phrase in PHRASES if re.search(rf"(?<!\w){re.escape(phrase)}(?!\w)", plain)]


def test_phrases_are_found_across_lines_and_only_as_whole_words():
    assert banned_in("It goes\n    on. Shallow water.") == ["goes on"]


def test_docstrings_and_errors_are_free_of_them():
    found = [
        f"{path.relative_to(ROOT)}:{line}: {', '.join(phrases)}"
        for folder in ("semgs", "packages", "paper", "scripts")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for line, text in written(path)
        if (phrases := banned_in(text))
    ]
    assert found == []


@pytest.mark.parametrize("page", PAGES)
def test_pages_are_free_of_them(page: str):
    assert banned_in((ROOT / page).read_text()) == []

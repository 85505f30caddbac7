"""The documentation site: every page is in a table of contents, and the Python reference has every public name."""

from __future__ import annotations

import re
from pathlib import Path

import semgs

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def listed() -> list[str]:
    """The pages of all tables of contents, in order; an entry is a page, or `title <page>`."""
    found = []
    for index in (DOCS / "index.md", *sorted(DOCS.glob("*/index.md"))):
        trees = re.findall(r"```\{toctree\}\n(.*?)```", index.read_text(), re.DOTALL)
        names = [line.partition("<")[2].rstrip(">") or line for tree in trees for line in tree.splitlines() if line]
        pages = [name for name in names if not name.startswith(":") and name != "self"]
        found += [(index.parent / page).relative_to(DOCS).as_posix() for page in pages]
    return found


def test_every_page_is_listed_once():
    pages = {
        path.relative_to(DOCS).with_suffix("").as_posix() for path in DOCS.rglob("*.md") if "_build" not in path.parts
    }
    assert sorted(listed()) == sorted(pages - {"index"})


def test_the_reference_has_every_public_name():
    documented = re.findall(
        r"^\.\. auto(?:function|class):: semgs\.(\w+)$", (DOCS / "api.md").read_text(), re.MULTILINE
    )
    assert sorted(documented) == sorted(semgs.__all__)

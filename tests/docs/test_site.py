"""The documentation site: every page is in a table of contents, the Python reference has every public name, equations are shown."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

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
    lab = {page for page in pages if page.startswith("lab/")}
    assert sorted(listed()) == sorted(pages - {"index"} - lab)


def test_pages_of_the_laboratory_are_in_no_menu_but_a_listed_page_links_to_each():
    linked = "".join((DOCS / f"{page}.md").read_text() for page in listed())
    for path in (DOCS / "lab").glob("*.md"):
        assert path.read_text().startswith("---\norphan: true\n---\n")
        assert f"](lab/{path.name}" in linked, path


def test_the_reference_has_every_public_name():
    documented = re.findall(
        r"^\.\. auto(?:function|class):: semgs\.(\w+)$", (DOCS / "api.md").read_text(), re.MULTILINE
    )
    assert sorted(documented) == sorted(semgs.__all__)


@pytest.mark.long
def test_an_equation_is_shown_without_scripts_and_without_a_network(tmp_path: Path):
    build = pytest.importorskip("sphinx.cmd.build").build_main
    (tmp_path / "page.md").write_text("# Page\n\n$$\\tilde{P}_i = 2$$\n\nand $x^2$\n")
    given = ["-q", "-W", "-c", str(DOCS), "-D", "root_doc=page", str(tmp_path), str(tmp_path / "out")]
    assert build(given) == 0
    page = (tmp_path / "out" / "page.html").read_text()
    equation, inline = re.findall(r"<math.*?</math>", page)
    assert 'display="block"' in equation
    tilde, index = '<mover><mrow><mi>P</mi></mrow><mo stretchy="false">&#x0007E;</mo></mover>', "<mi>i</mi>"
    assert f"<msub>{tilde}{index}</msub>" in equation
    assert "<msup><mi>x</mi><mn>2</mn></msup>" in inline
    assert "$" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert "mathjax" not in re.sub(r'class="[^"]*"', "", page).lower()

"""docs/architecture.md, its figures and CONTRIBUTING: every module and command that they name exists, and the figures are those of the script."""

from __future__ import annotations

import re
import runpy
from html import unescape
from pathlib import Path

from semgs.cli.main import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
FIGURES = runpy.run_path(str(DOCS / "architecture_figures.py"))["figures"]()
PAGE = (DOCS / "architecture.md").read_text("utf-8")


def texts() -> list[str]:
    """The code on the page, and the lines of text in the figures."""
    lines = [line for figure in FIGURES.values() for line in re.findall(r"<text [^>]*>([^<]*)</text>", figure)]
    return [*re.findall(r"`([^`]+)`", PAGE), *map(unescape, lines)]


def test_the_figures_are_those_that_the_script_writes_and_the_page_shows():
    for name, text in FIGURES.items():
        assert (DOCS / "images" / name).read_text("utf-8") == text
        assert f"](images/{name})" in PAGE


def test_every_module_exists():
    paths = [path for text in texts() for path in re.findall(r"[a-z_0-9]+/(?:[a-z_0-9]+/)*(?:[a-z_0-9]+\.py)?", text)]
    assert len(paths) > 30
    assert [path for path in paths if path != "semgs/" and not (ROOT / "semgs" / path).exists()] == []


def test_every_module_that_contributing_sends_to_exists():
    text = (DOCS / "CONTRIBUTING.md").read_text("utf-8")
    paths = re.findall(r"`((?:semgs|tests|scripts|packages|paper)/[^`]*)`", text)
    assert len(paths) > 10
    assert [path for path in paths if not (ROOT / path).exists()] == []


def test_every_command_exists():
    named = [command for text in texts() for command in re.findall(r"^semgs ([a-z]+)", text)]
    assert {"reconstruct", "train", "evaluate"} <= set(named) <= {name.partition(" ")[0] for name in COMMANDS}

"""Settings of the documentation. `make docs` builds docs/_build/html; it needs no network."""

import json
import os
import re
import sys
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

import mutants  # noqa: E402

from semgs import __version__  # noqa: E402
from semgs.cli.command_help import help_of  # noqa: E402
from semgs.cli.main import COMMANDS  # noqa: E402

project = "SemGS"
author = "the SemGS contributors"
copyright = f"{author}. Apache-2.0"
version = release = __version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
exclude_patterns = ["_build"]
default_role = "py:obj"
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
napoleon_use_ivar = True
napoleon_attr_annotations = False
python_use_unqualified_type_names = True

html_math_renderer = "mathml"
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_title = f"SemGS {version}"
html_theme_options = {}
if repository := os.environ.get(
    "GITHUB_REPOSITORY"
):  # "owner/name", set by the workflow: only then there is a page to edit
    html_theme_options = {
        "source_repository": f"https://github.com/{repository}",
        "source_branch": "main",
        "source_directory": "docs/",
    }


def from_root(name: str) -> str:
    """A page of the repository's root, with links that lead from docs/."""
    text = (ROOT / name).read_text()
    text = re.sub(r"\]\((?!docs/|https?:|#)", "](../", text)
    return text.replace("](docs/", "](")


def in_code(prose: str) -> str:
    """A text with its options and metavars as code, so that two dashes stay two and brackets stay brackets."""
    return re.sub(r"(?<![\w-])--[a-z][\w.-]*\b|<[^>]*>", r"`\g<0>`", prose)


def commands() -> str:
    """The help of every command, as `semgs COMMAND --help` prints it: prose as prose, examples as code, options as lists of definitions."""
    parts = []
    for name, command in COMMANDS.items():
        shown = help_of(command.load(), f"semgs {name}")
        prose, _, examples = shown.about.partition("Examples\n")
        examples, _, more = examples.partition("\n\n")
        lines = [line.removeprefix("- ") for line in examples.strip().splitlines()]
        parts += [f"## semgs {name}", f"```text\n{shown.usage}\n```", in_code(prose.strip())]
        parts += ["```sh\n" + "\n".join(lines) + "\n```"] if lines else []
        parts += [in_code(more.strip())] if more else []
        for title, options in shown.groups.items():
            parts += [f"**{title}**", *(f"`{typed}`\n: {in_code(text)}" for typed, text in options)]
    return "\n\n".join(parts)


def table(columns: list[str], rows: list[list[str | float | None]]) -> str:
    """A table in Markdown; numbers are on the right."""
    texts = [
        ["" if cell is None else f"{cell:,}" if isinstance(cell, int) else str(cell) for cell in row] for row in rows
    ]
    rules = ["---" if any(isinstance(cell, str) for cell in column) else "---:" for column in zip(*rows, strict=True)]
    return "\n".join(f"| {' | '.join(row)} |" for row in (columns, rules, *texts))


def measurements() -> str:
    """The files of measurements in docs/lab, a section each."""
    parts = []
    for path in sorted((ROOT / "docs" / "lab").glob("*.json")):
        measured = json.loads(path.read_text())
        parts.append(f"## {measured['title']}")
        for part in measured["parts"]:
            if "commands" in part:
                parts.append("```sh\n" + "\n".join(part["commands"]) + "\n```")
            elif "columns" in part:
                parts.append(table(part["columns"], part["rows"]))
            else:
                parts.append(part["text"])
    return "\n\n".join(parts)


def written_at_build(app: object, page: str, source: list[str]) -> None:
    """Fill the pages whose text exists elsewhere, and link files of the repository that are no pages as downloads."""
    if page == "index":
        source[0] = from_root("README.md") + source[0]
    elif page == "changelog":
        source[0] = from_root("CHANGELOG.md")
    elif page == "commands":
        source[0] += commands()
    elif page == "lab/measurements":
        source[0] += "\n" + measurements()
    elif page == "planted_errors":
        source[0] = mutants.page()
    source[0] = source[0].replace("](../CHANGELOG.md)", "](changelog.md)")
    if "/" not in page:
        source[0] = re.sub(r"\]\((\.\./[^)#]+\.md)\)", r"](path:\1)", source[0])


def without_markup(app: object, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Keep the stars of shapes such as [*v h w] from starting emphasis."""
    lines[:] = [line.replace("*", "\\*") for line in lines]


def write_math(writer: object, node: nodes.math | nodes.math_block) -> None:
    """Write an equation as MathML, which browsers show without a network and without scripts."""
    display = "block" if isinstance(node, nodes.math_block) else "inline"
    writer.body.append(convert(node.astext(), display=display))  # type: ignore[attr-defined]
    raise nodes.SkipNode


def setup(app: object) -> None:
    """Called by Sphinx."""
    app.add_html_math_renderer("mathml", (write_math, None), (write_math, None))  # type: ignore[attr-defined]
    app.connect("source-read", written_at_build)  # type: ignore[attr-defined]
    app.connect("autodoc-process-docstring", without_markup, priority=400)  # type: ignore[attr-defined]  # before napoleon

"""Settings of the documentation. `make docs` builds docs/_build/html; it needs no network."""

import contextlib
import io
import json
import os
import re
import sys
from pathlib import Path

from docutils import nodes
from latex2mathml.converter import convert

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]
os.environ["COLUMNS"] = "100"

import mutants  # noqa: E402

from semgs import __version__  # noqa: E402
from semgs.cli.main import COMMANDS, main  # noqa: E402

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


def defined(box: str) -> str:
    """The options in a box of a help as a list of definitions. An entry is indented by 2, its text by more; a rule follows a title."""
    found: list[list[str]] = []
    title, *lines = (line.rstrip() for line in box.splitlines())
    for line in lines:
        if not line or set(line.strip()) == {"-"}:
            continue
        entry = re.match(r" {2,4}(?:• )?(\S.*?)(?:  +(\S.*))?$", line)
        if entry and len(line) - len(line.lstrip()) <= 4:
            found.append([entry[1], *filter(None, entry.groups()[1:])])
        else:
            found[-1].append(line.strip())
    text = [f"**{title.strip().capitalize()}**"]
    for name, *words in found:
        if words and name != "-h, --help":
            text.append(f"`{name}`\n: {in_code(' '.join(words))}")
        elif not words and name != "(required)":
            text.append(in_code(name))
    return "\n\n".join(text)


def help_page(name: str, printed: str) -> str:
    """The help of a command as a section: prose as prose, examples as code, options as a list of definitions."""
    usage, _, rest = re.sub(r" +$", "", printed.strip(), flags=re.MULTILINE).partition("\n\n")
    prose, *boxes = re.split(r"\n(?= [a-z][\w. ]*\n -{9})", rest)
    prose, _, examples = prose.partition("Examples\n")
    examples = "\n".join(line.removeprefix("- ") for line in examples.strip().splitlines())
    shell = f"```sh\n{examples}\n```\n\n" if examples else ""
    options = "\n\n".join(map(defined, boxes))
    return f"## semgs {name}\n\n```text\n{usage}\n```\n\n{in_code(prose.strip())}\n\n{shell}{options}\n"


def commands() -> str:
    """The help of every command, as `semgs COMMAND --help` prints it."""
    parts = []
    for name in COMMANDS:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            main([*name.split(), "--help"])
        parts.append(help_page(name, printed.getvalue()))
    return "\n".join(parts)


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

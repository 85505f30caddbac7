"""Every command line and every block of Python and JSON in README, docs and files of measurements does what the page says, on the disk of a reader."""

from __future__ import annotations

import ast
import re
import subprocess
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest
import reader_disk
from asset_folders import asset_folder, box_mesh, write_mesh
from doc_examples import (
    MEASUREMENTS,
    PAGES,
    SKIPPED,
    SLOW,
    SMALLER_IN_PYTHON,
    SMALLER_LISTS,
    name,
    parse_semgs,
    python,
    quick,
    read,
    shell,
    skipped,
    slow,
    words_of,
)
from paper_commands import COMMANDS as WORKSHOP
from sybil import Example

from semgs.files.errors import InputError
from semgs.run.usage_errors import UsageError

__all__ = ["asset_folder", "box_mesh", "write_mesh"]

LANGUAGES = {"sh", "python", "json", "text"}
"""Of the blocks in pages; `text` is for drawings, formulas and listings of folders."""
MOST_SKIPPED = 5
PUBLISHED = ("re10k.ckpt", "deeplabv3plus", "mosaic_ade32")
"""Words of examples that need files of others."""
LONG = [pytest.mark.long, pytest.mark.timeout(900)]

EXAMPLES = [example for page in (*PAGES, *MEASUREMENTS) for example in read(page)]
CHECKED = [example for example in EXAMPLES if not skipped(example)]
QUICK = {name(example) for example in quick(CHECKED)}
RUN = [pytest.param(example, id=name(example), marks=[] if name(example) in QUICK else LONG) for example in CHECKED]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The reader's disk."""
    disk = tmp_path_factory.mktemp("reader")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(disk)
        reader_disk.build(disk)
    return disk


@pytest.fixture(scope="module")
def full(built: Path, asset_folder: Path) -> Path:
    """The same with what takes long to make."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(built)
        reader_disk.add_what_long_tests_need(built, asset_folder)
    return built


@pytest.fixture(scope="module")
def published(full: Path, shared: Path) -> Path:
    """The same with files that others have published."""
    reader_disk.add_published_files(full, shared)
    return full


@pytest.fixture
def disk(built: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The reader's disk as the current folder, for an example with what it needs, and without a network."""
    example = request.node.callspec.params.get("example") if hasattr(request.node, "callspec") else None
    if example is not None and slow(example):
        from huggingface_hub import constants

        request.getfixturevalue("published" if any(file in example.parsed for file in PUBLISHED) else "full")
        monkeypatch.setattr(constants, "HF_HUB_OFFLINE", True)
        monkeypatch.setattr(constants, "HF_HUB_CACHE", str(built / "hub"))
    monkeypatch.setenv("PYTHONPATH", str(reader_disk.ROOT))
    monkeypatch.chdir(built)
    return built


@pytest.mark.filterwarnings("ignore::semgs.data.origin.terms.TermsWarning")  # of the checkpoint that a page names
@pytest.mark.parametrize("example", RUN)
def test_it_runs(example: Example, disk: Path):
    example.evaluate()


def test_the_options_of_what_runs_only_in_make_long_are_right(disk: Path):
    for example in CHECKED:
        if example.region.evaluator is shell and name(example) not in QUICK:
            words = words_of(example)
            if words[:2] == ["python", "-m"] and words[2].removeprefix("paper.") in WORKSHOP:
                words = ["semgs", words[2].removeprefix("paper."), *words[3:]]
            if words[0] == "semgs" and "--help" not in words:
                parse_semgs(words[1:])


def imported(source: str) -> set[tuple[str, str]]:
    """The names that a program imports from semgs, with their modules."""
    statements = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom) and node.module]
    return {
        (node.module, one.name) for node in statements for one in node.names if node.module.split(".")[0] == "semgs"
    }


def python_of(text: str) -> list[str]:
    """The programs that a shell script gives to Python as here-documents."""
    return re.findall(r"<<'PYTHON'\n(.*?)^PYTHON$", text, re.MULTILINE | re.DOTALL)


def test_every_name_that_an_example_a_script_or_a_test_imports_exists():
    programs = [example.parsed for page in PAGES for example in read(page) if example.region.evaluator is python]
    programs += [
        file.read_text()
        for folder in ("examples", "docs", "scripts", "tests", "packages", "paper")
        for file in (reader_disk.ROOT / folder).rglob("*.py")
    ]
    shells = [file.read_text() for file in (reader_disk.ROOT / "scripts").glob("*.sh")]
    embedded = [program for text in shells for program in python_of(text)]
    assert len(embedded) == 2
    programs += embedded
    names = set.union(*map(imported, programs))
    assert len(names) > 100
    lost = [
        (module, name)
        for module, name in sorted(names)
        if not hasattr(import_module(module), name) and not find_spec(f"{module}.{name}")
    ]
    assert lost == []
    assert imported("from semgs.files.text import printable, lost") == {
        ("semgs.files.text", "printable"),
        ("semgs.files.text", "lost"),
    }


def test_at_most_five_lines_are_skipped_each_for_a_reason():
    assert len(SKIPPED) <= MOST_SKIPPED
    found = [skipped(example) for example in EXAMPLES]
    assert set(found) == {None, *SKIPPED}


def test_each_rule_that_makes_an_example_smaller_or_slow_is_used():
    text = "".join(example.parsed for example in EXAMPLES)
    assert [word for word in (*SLOW, *SMALLER_IN_PYTHON, *SMALLER_LISTS) if word not in text] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_block_of_a_page_has_a_language_and_is_read(page: Path):
    fences = re.findall(r"^[ ]*```(.*)\n(?:.*\n)*?[ ]*```[ ]*$", page.read_text(), re.MULTILINE)
    directives = [fence for fence in fences if fence.startswith("{")]
    assert set(fences) - set(directives) <= LANGUAGES
    blocks = {example.document.text.rindex("```", 0, example.start + 3) for example in read(page)}
    assert len(blocks) == sum(fence in LANGUAGES - {"text"} for fence in fences)


PLANTED = {
    "a wrong option": ("viewer.md", "--html office.html", "--htlm office.html"),
    "a wrong value": ("evaluate.md", "--views 2 3 4", "--views two"),
    "an option of another command": ("data.md", "--every 2", "--steps 2"),
    "a file that is not there": (
        "evaluate.md",
        "semgs compare eval/*/report.json\n",
        "semgs compare evil/*/report.json\n",
    ),
    "a target that make lacks": ("testing.md", "make gpu    ", "make gup    "),
    "a name that semgs lacks": (
        "segmenters.md",
        "from semgs import load, open_scene",
        "from semgs import laod, open_scene",
    ),
    "an argument that a function lacks": (
        "export.md",
        'save_gltf("room.glb", scene)',
        'save_gltf("room.glb", scene, up="y")',
    ),
}
"""Mistakes: the page, what is there, and what is planted."""


@pytest.mark.parametrize("mistake", PLANTED)
def test_a_planted_mistake_is_found(mistake: str, disk: Path, tmp_path: Path):
    name, right, wrong = PLANTED[mistake]
    original, copy = reader_disk.ROOT / "docs" / name, tmp_path / name
    text = original.read_text()
    assert text.count(right) == 1
    copy.write_text(text.replace(right, wrong))
    known = {example.parsed for example in read(original)}
    (changed,) = (example for example in read(copy) if example.parsed not in known)
    with pytest.raises((AssertionError, ImportError, TypeError, InputError, UsageError, subprocess.CalledProcessError)):
        changed.evaluate()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("```sh\npip install '.[triain]'\n```\n", "there is no extra triain"),
        ("```sh\npip install left-pad\n```\n", "left-pad is not in constraints.txt"),
        ("```sh\nssh robot semgs view out --prot 80\n```\n", "--prot"),
        ("```sh\nfrobnicate out\n```\n", "no rule says how to check"),
        ("```sh\npython scripts/nowhere.py\n```\n", "there is no scripts/nowhere.py"),
        ('```json\n{"classes": [{"nmae": "wall"}]}\n```\n', "expected an object with a name"),
        ('```json\n{"some": 1}\n```\n', "no reader of ours"),
    ],
)
def test_a_mistake_in_other_blocks_is_found(text: str, found: str, disk: Path, tmp_path: Path):
    (tmp_path / "page.md").write_text(text)
    (example,) = read(tmp_path / "page.md")
    with pytest.raises(Exception, match=re.escape(found)):
        example.evaluate()

"""Help texts: no empty defaults, and none of the phrases that we keep out of them (CONTRIBUTING.md)."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import pytest
from paper_commands import COMMANDS as WORKSHOP
from paper_commands import main

from semgs.cli.command_help import paragraphs
from semgs.cli.main import COMMANDS
from semgs.training.presets import PRESETS

ROOT = Path(__file__).resolve().parents[2]

BANNED = (
    "found out", "goes on", "go on with", "told", "tells", "asked for", "nobody", "anybody", "peers'", "sitting", "torn",
    "trivial", "beforehand", "what ships", "lend", "stands in", "a name a line", "shall", "of it.", "one's own", "drawn live",
    "beside what", "again for another", "none needs nothing", "where there is one", "which else",
)  # fmt: skip
"""Phrases that read as if translated, with a better one for each in use: detected, resumes, reported, requested, repeatable ..."""

LONGEST_README = 120


def text_of(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What a help prints, without colours, frames and line breaks."""
    assert main([*arguments, "--help"]) == 0
    plain = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out)
    return " ".join(re.sub(r"[│╭╰─╮╯]", " ", plain).split())


def banned_in(text: str) -> list[str]:
    """The banned phrases in a text, as whole words."""
    return [phrase for phrase in BANNED if re.search(rf"(?<!\w){re.escape(phrase)}(?!\w)", text.lower())]


HELPS = [
    [],
    *([name] for name in (*COMMANDS, *WORKSHOP)),
    *([name, preset] for name in ("train", "ablate") for preset in PRESETS),
]


@pytest.mark.parametrize("arguments", HELPS, ids=" ".join)
def test_no_help_shows_an_empty_default_or_a_banned_phrase(arguments: list[str], capsys: pytest.CaptureFixture[str]):
    text = text_of([word for name in arguments for word in name.split()], capsys)
    assert [found for found in ("default: None)", "default: )", "{None,") if found in text] == []
    assert banned_in(text) == []


@pytest.mark.parametrize("arguments", HELPS, ids=" ".join)
def test_a_flag_that_switches_off_stands_below_the_one_whose_help_it_has(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
):
    """Alone, --no-x would have the help of what x does, as if it switched that on."""
    assert main([*(word for name in arguments for word in name.split()), "--help"]) == 0
    flags = re.findall(r"^[│| ]+(--[\w.-]+)", capsys.readouterr().out, re.MULTILINE)
    negative = [(before, flag) for before, flag in pairwise(flags) if re.search(r"(^--|\.)no-", flag)]
    assert [(before, flag) for before, flag in negative if before != flag.replace("no-", "", 1)] == []
    assert bool(negative) == (len(arguments) == 2)


def test_paragraphs_and_items_of_a_list_keep_their_lines_and_nothing_else():
    text = "Two\n    views.\n\n    - One\n      item.\n    - Another."
    assert paragraphs(text) == "Two views.\n\n    - One item.\n    - Another."


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["reconstruct"], "Of four or more frames, every eighth is held out for comparison."),
        (["rooms"], "a larger --scenes adds scenes. Without --assets,"),
        (["train", "small"], "inverse_root_frequency counts how often each class occurs in the data"),  # inherited
    ],
    ids=["an option", "the description", "an inherited one"],
)
def test_a_line_of_a_help_ends_where_the_terminal_does(
    arguments: list[str], sentence: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setenv("COLUMNS", "1000")
    assert main([*arguments, "--help"]) == 0
    assert any(sentence in line for line in capsys.readouterr().out.splitlines())


def test_the_readme_fits_on_two_screens_and_is_free_of_those_phrases():
    text = (ROOT / "README.md").read_text()
    assert len(text.splitlines()) <= LONGEST_README
    assert banned_in(" ".join(text.split())) == []

"""The table of planted errors still fits the code: a moment here, so that `make mutants` does not find out at night."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from mutants import page, planted
from planted import MUTANTS, Mutant

ROOT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda one: one.name)
def test_each_replacement_fits_once_and_leaves_a_program(mutant: Mutant) -> None:
    assert mutant.before != mutant.after
    ast.parse(planted(mutant, ROOT))
    for test in mutant.tests:
        path, _, name = test.partition("::")
        assert f"def {name}" in (ROOT / path).read_text(encoding="utf-8")


def test_names_tell_the_errors_apart_and_there_are_enough() -> None:
    assert len({one.name for one in MUTANTS}) == len(MUTANTS) >= 30


def test_a_text_that_is_not_there_once_is_told() -> None:
    gone = Mutant("nothing", "README.md", "no such text in there", "", ())
    with pytest.raises(ValueError, match=r"'nothing': README.md holds 'no such text in there' 0 times; expected once"):
        planted(gone, ROOT)


def test_the_page_that_the_site_shows_has_every_error_once() -> None:
    text = page()
    for one in MUTANTS:
        assert text.count(f"| {one.name} | `{one.file.split('/', 2)[2]}` | `") == 1

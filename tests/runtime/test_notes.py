"""Notes: what they say to people with a command line, and to people without."""

from __future__ import annotations

import pickle
import re
from importlib import import_module

import pytest
from test_imports import ROOT, modules

from semgs.runtime.notes import Kind, Note, for_page

FAR = Kind("It is {metres:.1f} m away; see --unit {unit}.", "It is {metres:.1f} m away.")
KNOWN = Kind("All of {count:,} are known.", "")
PLAIN = Kind("Nothing moves.")

OPTION = re.compile(r"(^|[\s(\[])--[a-z]|semgs [a-z]")


def every_kind() -> dict[str, Kind]:
    """The kinds of all notes and stages, by where they are."""
    return {
        f"{name}.{key}": value
        for name, path in modules(ROOT).items()
        if name.startswith("semgs.") and "Kind(" in path.read_text()
        for key, value in vars(import_module(name)).items()
        if isinstance(value, Kind)
    }


def test_a_note_is_its_text_for_the_command_line_and_has_one_for_a_page():
    note = FAR(metres=2.345, unit="metric")
    assert note == "It is 2.3 m away; see --unit metric."
    assert note.on_page == "It is 2.3 m away."
    assert f"{note} {PLAIN()}" == "It is 2.3 m away; see --unit metric. Nothing moves."


def test_on_a_page_stands_what_is_news_there_in_its_words():
    notes = [FAR(metres=1, unit="x"), KNOWN(count=1200), PLAIN(), "As it is."]
    assert for_page(notes) == ["It is 1.0 m away.", "Nothing moves.", "As it is."]
    assert str(notes[1]) == "All of 1,200 are known."


def test_a_note_that_is_pickled_keeps_what_it_says():
    note = pickle.loads(pickle.dumps(FAR(metres=2, unit="metric")))
    assert isinstance(note, Note)
    assert (note.kind, note.values, note.on_page) == (FAR, {"metres": 2, "unit": "metric"}, "It is 2.0 m away.")


def test_words_for_a_page_need_no_value_that_the_others_lack():
    with pytest.raises(ValueError, match=r"'It is {far} away.' has \['far'\]"):
        Kind("It is away.", "It is {far} away.")


def test_every_kind_has_words_for_a_page_and_none_of_them_names_an_option():
    found = every_kind()
    assert len(found) >= 50
    shown = {name: kind.words if kind.page is None else kind.page for name, kind in found.items()}
    assert {name: words for name, words in shown.items() if OPTION.search(words)} == {}

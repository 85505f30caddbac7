"""What others wrote, shown and not obeyed."""

from __future__ import annotations

import os

import pytest

from semgs.files.errors import InputError
from semgs.files.text import counted, listed, natural_order, printable


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Küche 3 – ‘Åse’, 椅子", "Küche 3 – ‘Åse’, 椅子"),
        ("two\nlines", "two\nlines"),
        ("\x1b[31mred\x1b[0m", "\\x1b[31mred\\x1b[0m"),
        ("bell\a, tab\t, return\r, delete\x7f", "bell\\x07, tab\\t, return\\r, delete\\x7f"),
        ("\x9b2J", "\\x9b2J"),  # the one-byte form of ESC [
        ("gpj.\u202egnp", "gpj.\\u202egnp"),  # right to left from here
        (os.fsdecode(b"caf\xe9"), "caf\\udce9"),  # Latin-1, which is no UTF-8
    ],
)
def test_letters_of_any_script_stay_and_what_a_terminal_obeys_is_escaped(text: str, shown: str) -> None:
    assert printable(text) == shown


def test_an_error_about_a_hostile_name_can_be_printed_anywhere() -> None:
    error = InputError(os.fsdecode(b"\xff/\x1b]0;title\x07.png"), "a picture", "nothing\nthere")
    assert str(error) == "\\udcff/\\x1b]0;title\\x07.png: expected a picture, found nothing there"


def test_a_list_names_the_first_ones_and_counts_the_rest():
    assert listed(["a", "b", "c"], 3) == "a, b, c"
    assert listed(["a", "b", "c", "d"], 2) == "a, b and 2 more"
    assert listed([]) == ""


def test_numbers_in_names_are_sorted_by_value_and_letters_of_any_case_alike() -> None:
    names = ["b2", "B10", "a1²3", "a1", "10", "9", "b2.png", "a\u0661"]
    assert sorted(names, key=natural_order) == ["9", "10", "a1", "a1²3", "a\u0661", "b2", "b2.png", "B10"]


def test_a_count_is_followed_by_the_singular_or_the_plural():
    assert [counted(n, "scene") for n in (0, 1, 2, 1200)] == ["0 scenes", "1 scene", "2 scenes", "1,200 scenes"]
    assert [counted(n, "class", "classes") for n in (1, 2)] == ["1 class", "2 classes"]


def test_numbers_in_names_count_by_value_however_long_they_are():
    names = [f"a{'9' * 5000}", "a10", "a2", f"a1{'0' * 5000}", "a02"]
    assert sorted(names, key=natural_order) == ["a02", "a2", "a10", f"a{'9' * 5000}", f"a1{'0' * 5000}"]

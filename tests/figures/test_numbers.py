"""One rule for numbers: two digits after the point, percentages whole."""

from __future__ import annotations

from semgs.files.text import decibels, duration, length, percent


def test_numbers_have_two_digits_after_the_point() -> None:
    assert decibels(21.234) == "21.23 dB"
    assert duration(1.5) == "1.50 s"
    assert length(10.0, metric=True) == "10.00 m"


def test_a_percentage_is_whole_and_little_is_not_called_nothing() -> None:
    assert percent(0.1267) == "13 %"
    assert percent(0.01) == "1 %"
    assert percent(0.0099) == "under 1 %"
    assert percent(0.0) == "0 %"


def test_an_unknown_unit_may_be_of_any_size() -> None:
    assert length(0.00123, metric=False) == "0.00123"
    assert length(0.5, metric=False) == "0.5"


def test_what_is_unknown_is_a_dash_and_equal_pictures_are_called_equal() -> None:
    assert decibels(None) == percent(None) == "–"
    nan = float("nan")
    assert decibels(nan) == percent(nan) == length(nan, metric=True) == length(nan, metric=False) == "–"
    assert decibels(float("inf")) == "equal"

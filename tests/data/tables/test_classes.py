"""Class tables."""

from __future__ import annotations

from dataclasses import replace

import pytest

from semgs.data.tables.classes import SCANNET20, class_table


def test_the_scannet_table_has_its_twenty_classes_in_the_benchmarks_order():
    assert len(SCANNET20) == 20
    assert SCANNET20.index("wall") == 0
    assert SCANNET20.index("otherfurniture") == 19
    assert SCANNET20.raw_ids == (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 16, 24, 28, 33, 34, 36, 39)
    assert len(set(SCANNET20.colours)) == 20


def test_tables_are_found_by_name_and_others_are_refused_with_the_known_ones():
    assert class_table("scannet20") is SCANNET20
    with pytest.raises(ValueError, match="unknown class table 'ade20k'; known: scannet20"):
        class_table("ade20k")


@pytest.mark.parametrize(
    "change",
    [
        {"names": SCANNET20.names[:-1]},
        {"names": ("wall", *SCANNET20.names[:-1])},
        {"names": (), "colours": (), "raw_ids": ()},
    ],
)
def test_tables_that_cannot_be_are_refused(change):
    with pytest.raises(ValueError, match="class table scannet20"):
        replace(SCANNET20, **change)


def test_help_of_a_function_with_a_table_as_default_does_not_print_the_table():
    import pydoc

    from semgs.robotics.occupancy import occupancy

    text = pydoc.render_doc(occupancy)
    assert "<class table scannet20, 20 classes>" in text
    assert "shower curtain" not in text

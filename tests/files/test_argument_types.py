"""Arguments of another type; `tests/test_wrong_types.py` tries every public function."""

from __future__ import annotations

import pytest

from semgs.files.errors import check_type


def test_what_was_given_and_what_was_expected_are_one_sentence() -> None:
    check_type("a name is", "room", str, "text")
    check_type("a side is", 3, (int, float), "a number")
    with pytest.raises(TypeError, match=r"^a name is list; expected text$"):
        check_type("a name is", ["room"], str, "text")

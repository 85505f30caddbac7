"""What `make mutants-auto` does, in small: which places it draws from, and that a change dies if and only if a test can tell."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import pytest
from mutants import ended
from mutants_auto import Mutant, Place, Run, chosen, drawn, measure, places, sensible, summary, tried
from mutants_equivalent import EQUIVALENT

ROOT = Path(__file__).resolve().parent.parent

AREA = '''
if TYPE_CHECKING:
    LIMIT = 1

@cache(maxsize=2)
def area(width: int | None, *, height: float = 2.5) -> float | None:
    """3 + 4."""
    if width is None:
        raise ValueError(f"{1 + 1} numbers")
    return width * height
'''

SIZE = """def size(x):
    return (
        -x
        if x < 0
        else x
    )


def nothing(x):
    return x + 0
"""

TESTS = """from semgs.geometry.size import nothing, size

def test_nothing():
    assert nothing(7) == 7

def test_size():
    assert [size(x) for x in (-3, 0, 5)] == [3, 0, 5]
"""


def place(operator: str, function: str = "size", lines: tuple[int, int] = (2, 6)) -> Place:
    return Place("semgs/geometry/size.py", function, lines, f"core/{operator}", 0, operator)


def test_a_place_is_a_token_outside_of_annotations_decorators_and_messages():
    found = [(one.function, one.lines, one.operator.removeprefix("core/").split("_")[0]) for one in places("area.py", AREA, 0)]  # fmt: skip
    assert sorted(found) == [
        ("", (6, 6), "NumberReplacer"),  # 2.5
        ("area", (8, 8), "AddNot"),
        ("area", (8, 8), "ReplaceComparisonOperator"),
        ("area", (10, 10), "ReplaceBinaryOperator"),
    ]


def test_what_is_added_elsewhere_leaves_the_draw_as_it_is():
    def keys(text: str) -> set[tuple[str, str]]:
        return {(one.key, one.operator) for one in places("area.py", text, 0)}

    more = keys("def half(x):\n    return x / 2\n" + AREA)
    assert len(more - keys(AREA)) == 2  # the / and the 2
    assert keys(AREA) < more
    assert not keys(AREA) & {(one.key, one.operator) for one in places("area.py", AREA, 1)}


def test_arithmetic_becomes_arithmetic_and_equality_an_order():
    names = ("Add_Sub", "Add_RShift", "BitOr_BitAnd", "BitOr_Add")
    assert [sensible(f"core/ReplaceBinaryOperator_{name}") for name in names] == [True, False, True, False]
    names = ("Eq_LtE", "Eq_Is", "Is_IsNot")
    assert [sensible(f"core/ReplaceComparisonOperator_{name}") for name in names] == [True, False, True]
    assert not sensible("core/RemoveDecorator")


def test_a_seed_draws_the_same_changes_of_the_package_and_each_is_a_program():
    mutants = drawn(ROOT, 5, seed=3, packages=("objectives",))
    assert mutants == drawn(ROOT, 5, seed=3, packages=("objectives",))
    assert len(mutants) == 5
    for one in mutants:
        text = (ROOT / one.place.file).read_text("utf-8")
        changed = one.place.changed(text)
        ast.parse(changed)
        assert one.before in text
        assert one.after in changed
        assert one.before != one.after


def test_a_test_meets_what_it_runs_first_and_then_its_neighbours_up_to_a_limit():
    lines = {"semgs/geometry/size.py": {"3": ["tests/model/test_a.py::fast", "tests/geometry/test_b.py::slow"]}}
    run = Run({"tests/model/test_a.py::fast": 1, "tests/geometry/test_b.py::slow": 3, "tests/model/test_a.py::other": 2}, lines)  # fmt: skip
    other_file = Run(
        {"tests/geometry/test_c.py::c": 1}, {"semgs/geometry/size.py": {"9": ["tests/geometry/test_c.py::c"]}}
    )
    found = ["tests/geometry/test_b.py::slow", "tests/model/test_a.py::fast", "tests/model/test_a.py::other"]
    assert chosen(place("AddNot"), [run, other_file], 6) == found
    assert chosen(place("AddNot"), [run, other_file], 5) == found[:2]
    # What runs at import is met by all that run something of the file.
    assert len(chosen(place("AddNot", function=""), [run, other_file], 60)) == 4


@pytest.mark.long
def test_a_change_that_shows_dies_and_an_equivalent_one_survives(tmp_path, capsys):
    copy = tmp_path / "semgs"
    files = {"semgs/__init__.py": "", "semgs/geometry/size.py": SIZE, "tests/geometry/test_size.py": TESTS}
    for name, text in files.items():
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).write_text(text)
    assert ended(60, measure, copy, True, 60, "tests/geometry/test_size.py", tmp_path / "run.json")[0] == 0
    run = Run(**json.loads((tmp_path / "run.json").read_text()))
    test_size, test_nothing = (f"tests/geometry/test_size.py::test_{name}" for name in ("size", "nothing"))
    assert run.of(place("AddNot")) == {test_size}
    assert run.of(place("AddNot", "nothing", (10, 10))) == {test_nothing}

    # -0 is 0, so <= for < changes nothing; > for < makes -3 of -3.
    dies, lives = (Mutant(place(f"ReplaceComparisonOperator_Lt_{name}"), "if x < 0", "") for name in ("Gt", "LtE"))
    verdicts = [tried(copy, one, chosen(one.place, [run], 30), 30) for one in (dies, lives)]
    assert [(one.by, one.tests) for one in verdicts] == [(test_size, 2), ("", 2)]
    assert (copy / "semgs/geometry/size.py").read_text() == SIZE
    assert summary(list(zip((dies, lives), verdicts, strict=True))) == 1
    assert "2 changes: 1 killed (50.0%), 0 equivalent, 1 survived" in capsys.readouterr().out


@pytest.mark.parametrize(("file", "before", "after", "reason"), EQUIVALENT)
def test_a_change_that_is_recorded_as_equivalent_is_one_of_a_line_that_is_there(file, before, after, reason):
    assert before in [line.strip() for line in (ROOT / file).read_text("utf-8").splitlines()]
    assert before != after
    assert reason

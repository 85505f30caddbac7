"""docs/method.md: every name, file, test, argument and count on it is real."""

from __future__ import annotations

import ast
import importlib
import re
from dataclasses import fields
from pathlib import Path

import pytest
from networks import network, preset

from semgs.model.settings import (
    ColourSettings,
    Conventions,
    DepthSettings,
    MVSplatHeads,
    NetworkSettings,
    PaperHeads,
    SemanticSettings,
    TransformerSettings,
)  # fmt: skip
from semgs.model.switches import Switches
from semgs.objectives.loss_weights import LossWeights

SETTINGS = (
    NetworkSettings,
    ColourSettings,
    SemanticSettings,
    TransformerSettings,
    DepthSettings,
    MVSplatHeads,
    PaperHeads,
)

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "method.md").read_text()
NAMES = sorted(set(re.findall(r"`(semgs(?:\.\w+)+)`", PAGE)))
TESTS = sorted(set(re.findall(r"tests/[\w/]+\.py(?:::\w+)?", PAGE)))


def resolved(name: str) -> object:
    """What a dotted name stands for: a module, or an attribute of one, however deep."""
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found: object = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            declared = getattr(found, "__dataclass_fields__", {})
            found = declared[part] if part in declared else getattr(found, part)
        return found
    raise ModuleNotFoundError(name)


@pytest.mark.parametrize("name", NAMES)
def test_every_name_on_the_page_exists(name: str):
    assert resolved(name) is not None


@pytest.mark.parametrize("path", TESTS)
def test_every_test_on_the_page_exists(path: str):
    file, _, function = path.partition("::")
    text = (ROOT / file).read_text()
    functions = {node.name for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef)}
    assert any(name.startswith("test_") for name in functions)
    assert not function or function in functions


def test_no_name_is_written_so_that_it_escapes_the_check():
    written = set(re.findall(r"\bsemgs\.[\w.]+\w", PAGE))
    assert written == set(NAMES)
    assert len(NAMES) > 50
    assert len(TESTS) > 15


@pytest.mark.parametrize(
    "name", ["semgs.model.attention.transformer.Windowz", "semgs.modle.swin", "semgs.geometry.cameras.Cameras.centers"]
)
def test_a_name_that_does_not_exist_is_noticed(name: str):
    with pytest.raises((AttributeError, ModuleNotFoundError)):
        resolved(name)


def test_every_equation_of_the_page_has_a_row():
    """The rows are named: F features, A attention, C cost and depth, G Gaussians, R rasteriser, L losses, M metrics, D."""
    rows = re.findall(r"^\| ([FACGRLMD]\d) \|", PAGE, re.MULTILINE)
    expected = [
        f"{letter}{n}"
        for letter, count in zip("FACGRLMD", (7, 5, 6, 6, 7, 7, 3, 8), strict=True)
        for n in range(1, count + 1)
    ]
    assert rows == expected


def test_every_difference_from_mvsplat_is_in_its_table():
    table = PAGE.split("## Where MVSplat's code differs")[1].split("\n## ")[0]
    named = set(re.findall(r"`(\w+)` \|$", table, re.MULTILINE))
    assert named == {field.name for field in fields(Conventions)}


def arguments(text: str) -> dict[str, object]:
    return {key: ast.literal_eval(value) for key, value in re.findall(r"(\w+)=([\w\".]+)", text)}


def switches() -> list[tuple[dict[str, object], int]]:
    """The rows of the ablation's table: arguments of the network, and the parameters it should have."""
    table = PAGE.split("## Switches of the ablation")[1].split("\n## ")[0]
    rows, everything = [], {}
    for off, count in re.findall(r"^\| \S.*? \| (.*?) \| ([\d,]+) \|", table, re.MULTILINE):
        changed = {} if "LossWeights" in off else arguments(off)
        if off == "all of the above":
            changed = dict(everything)
        everything |= changed
        rows.append((changed, int(count.replace(",", ""))))
    return rows


def test_every_switch_of_the_ablation_has_the_parameters_that_the_page_says():
    rows = switches()
    assert len(rows) == 8
    for changed, count in rows:
        assert sum(p.numel() for p in network(**changed).parameters()) == count
    assert {"shared_layers": False, "windows": 1, "camera_aware_colour": False, "camera_aware_semantic": False} in [
        changed for changed, _ in rows
    ]


def test_every_argument_on_the_page_is_one():
    known = {
        *(f.name for kind in (*SETTINGS, Switches, Conventions, LossWeights) for f in fields(kind)),
    }
    assert set(arguments(PAGE)) <= known


def test_the_networks_have_the_parameters_that_the_page_says():
    (row,) = re.findall(r"^\| parameters \| ([\d,]+) \| ([\d,]+) \| .*: ([\d,]+) \|$", PAGE, re.MULTILINE)
    (whole,) = re.findall(r"^`small` is .*: ([\d,]+) parameters", PAGE, re.MULTILINE)
    built = [preset(name) for name in ("base", "small_plain", "mvsplat", "small")]
    assert [int(one.replace(",", "")) for one in (*row, whole)] == [
        sum(p.numel() for p in m.parameters()) for m in built
    ]

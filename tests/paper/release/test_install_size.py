"""What an install costs stays what docs/benchmarks.md says."""

from __future__ import annotations

import importlib.metadata
import platform
import re
import sys
from pathlib import Path

import pytest

from paper.release.audit import base_set

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs" / "benchmarks.md"


def stated(row: str) -> float:
    """A number of the table."""
    (number,) = re.findall(rf"^\| {re.escape(row)} \| ([\d.]+)", PAGE.read_text(), re.MULTILINE)
    return float(number)


NAMES = base_set() - base_set("torch") - {"torch"}
"""The base set without torch, whose own requirements depend on the build."""

PINS = {line.lower().replace("_", "-") for line in (ROOT / "constraints.txt").read_text().split()}

pytestmark = pytest.mark.skipif(
    any(f"{name}=={importlib.metadata.version(name)}" not in PINS for name in NAMES),
    reason="the page has the cost of the versions in constraints.txt",
)


def test_the_base_set_has_as_many_packages_as_the_page_says():
    assert len(NAMES) == stated("packages of the base installation, without torch and its requirements")


@pytest.mark.skipif(
    (sys.version_info[:2], platform.system(), platform.machine()) != ((3, 11), "Linux", "x86_64"),
    reason="sizes are of Python 3.11 on Linux x86-64",
)
def test_the_base_set_is_as_large_as_the_page_says_within_2_percent():
    files = [Path(file.locate()) for name in NAMES for file in importlib.metadata.files(name) or []]
    sizes = {file: file.stat().st_size / 1e6 for file in files if file.exists()}
    bytecode = {file: size for file, size in sizes.items() if file.suffix == ".pyc"}
    plain = sum(sizes.values()) - sum(bytecode.values())
    assert plain == pytest.approx(stated("the same without the bytecode that Python compiles"), rel=0.02)
    sources = {file for file in sizes if file.suffix == ".py"}
    # pip compiles all of them by default, `make setup` none; of packages that were added later, perhaps some.
    if len(bytecode) > 0.95 * len(sources):
        assert plain + sum(bytecode.values()) == pytest.approx(stated("their size on disk"), rel=0.02)

"""Every command line and every block of Python and JSON in README and docs does what the page says, on the disk of a reader."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import reader_disk
from doc_examples import PAGES, name, read, skipped, slow
from sybil import Example

LANGUAGES = {"sh", "python", "json"}
EXAMPLES = [example for page in PAGES for example in read(page)]
RUN = [
    pytest.param(example, id=name(example), marks=[pytest.mark.long] if slow(example) else [])
    for example in EXAMPLES
    if not skipped(example)
]


@pytest.fixture(scope="module")
def full_disk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The reader's disk."""
    disk = tmp_path_factory.mktemp("reader")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(disk)
        reader_disk.build(disk)
    return disk


@pytest.fixture
def disk(full_disk: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The same, as the current folder."""
    monkeypatch.chdir(full_disk)
    return full_disk


@pytest.mark.parametrize("example", RUN)
def test_it_runs(example: Example, disk: Path):
    example.evaluate()

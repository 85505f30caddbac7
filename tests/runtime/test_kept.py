"""Networks that stay loaded."""

from __future__ import annotations

from pathlib import Path

import pytest

from semgs.runtime import kept as module
from semgs.runtime.kept import keep_loaded, kept


def load(path: Path) -> list[bytes]:
    return [path.read_bytes()]


def test_a_thing_is_loaded_once_until_its_file_changes_and_only_if_that_is_wanted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(module, "_kept", None)
    weights = tmp_path / "weights"
    weights.write_bytes(b"1")
    assert kept(load, weights) is not kept(load, weights)
    keep_loaded()
    first = kept(load, weights)
    keep_loaded()
    assert kept(load, weights) is first
    weights.write_bytes(b"12")
    assert kept(load, weights) == [b"12"]

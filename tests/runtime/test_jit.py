"""Kernels compile where their code can be saved and where it cannot."""

from __future__ import annotations

import pytest
from numba.core import caching

from semgs.runtime.jit import njit


def twice(x: int) -> int:
    return 2 * x


def test_kernels_are_compiled_where_nothing_can_be_saved(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(caching._CacheLocator, "ensure_cache_path", refuse)
    for locator in caching.CacheImpl._locator_classes:
        monkeypatch.setattr(locator, "ensure_cache_path", refuse)
    assert njit()(twice)(21) == 42


def refuse(locator: object) -> None:
    raise OSError(30, "Read-only file system")


def test_other_errors_of_numba_are_raised(monkeypatch: pytest.MonkeyPatch):
    def fail(**options: object) -> None:
        raise RuntimeError("another")

    monkeypatch.setattr("numba.njit", fail)
    with pytest.raises(RuntimeError, match="another"):
        njit()(twice)

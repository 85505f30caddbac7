"""Numba's decorator, as all kernels use it: compiled code is saved if there is a place for it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


def njit(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """`numba.njit` with `cache=True`; without it if neither the package nor the user's cache folder can be written.

    Then every process compiles the kernels that it needs, which takes a minute.
    """
    import numba

    def compiled(function: Callable[..., Any]) -> Any:
        try:
            return numba.njit(cache=True, **options)(function)
        except RuntimeError as error:
            if "no locator available" not in str(error):
                raise
            return numba.njit(**options)(function)

    return compiled

"""Classes from elsewhere: 2D segmenters, their class tables, and fusion over views."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from semgs.segmenters.opening import open_segmenter as open

__all__ = ["open"]


def __getattr__(name: str) -> object:
    """`open`, imported on first use."""
    if name == "open":
        return import_module("semgs.segmenters.opening").open_segmenter
    raise AttributeError(f"module 'semgs.segmenters' has no attribute {name!r}")

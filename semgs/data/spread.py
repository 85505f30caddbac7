"""A few of many, evenly spread."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

Item = TypeVar("Item")


def spread(items: Sequence[Item], most: int) -> list[Item]:
    """All items, or `most` of them, evenly spread: the first, the last and some between."""
    return [items[round(step)] for step in np.linspace(0, len(items) - 1, min(len(items), most))]

"""Parts of the method that a network may lack: the switches of the paper's ablation by name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, get_args

Part = Literal["shared_layers", "windows", "camera_awareness"]
"""What the paper's ablation takes from the network; its fourth part, the smoothness of regions, is a weight of the loss."""

_WITHOUT: dict[str, dict[str, Any]] = {
    "shared_layers": {"shared_layers": False},
    "windows": {"windows": 1},
    "camera_awareness": {"camera_aware_colour": False, "camera_aware_semantic": False},
}


def lacking(without: Sequence[Part]) -> dict[str, Any]:
    """Arguments of the network that lacks these parts.

    Raises:
        ValueError: there is no such part.
    """
    changes: dict[str, Any] = {}
    for part in without:
        if part not in _WITHOUT:
            raise ValueError(f"the method has no part {part!r} to leave out; known: {', '.join(get_args(Part))}")
        changes |= _WITHOUT[part]
    return changes

"""Chunks: stages that treat each view on its own can take a few views at a time, to save memory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from torch import Tensor

from semgs.scene.encoding import Encoding


@dataclass(frozen=True)
class Chunks:
    """How many views to process at a time; None is all. Results only change by rounding.

    Attributes:
        cost: reference views of the cost volume.
        heads: views whose features are upsampled and become Gaussians.

    Raises:
        ValueError: one of them is less than 1.
    """

    cost: int | None = None
    heads: int | None = None

    def __post_init__(self) -> None:
        for name, count in (("cost", self.cost), ("heads", self.heads)):
            if count is not None and count < 1:
                raise ValueError(f"{name} is {count}; expected 1 view or more at a time, or None for all")


WHOLE = Chunks()
"""All views at once."""


Result = TypeVar("Result", Tensor, Encoding)


def by_chunks(function: Callable[[slice], Result], views: int, at_a_time: int | None) -> Result:
    """The result of `function` for all views, which it computes for some of them at a time.

    Args:
        function: takes a slice of the views; every tensor of its result has the views along its first axis.
        views: number of views.
        at_a_time: views for one call; None is all.
    """
    if at_a_time is None or at_a_time >= views:
        return function(slice(0, views))
    whole: Result | None = None
    for start in range(0, views, at_a_time):
        at = slice(start, min(start + at_a_time, views))
        part = function(at)
        # Filled in place: to join all parts at the end would need twice the memory.
        if whole is None:
            whole = _mapped(part, lambda tensor: tensor.new_empty(views, *tensor.shape[1:]))
        for target, tensor in zip(_tensors(whole), _tensors(part), strict=True):
            target[at] = tensor
    assert whole is not None
    return whole


def _mapped(result: Result, function: Callable[[Tensor], Tensor]) -> Result:
    """The function of a tensor, or of every tensor of an encoding."""
    return function(result) if isinstance(result, Tensor) else result.map(function)


def _tensors(result: Tensor | Encoding) -> list[Tensor]:
    """The tensors of a result, in a fixed order."""
    return [result] if isinstance(result, Tensor) else result.tensors()

"""Floating-point operations of what runs, by the kind of operation whose ceiling they are compared with."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import torch
from torch.utils.flop_counter import FlopCounterMode, sdpa_flop_count

from semgs.model import correlation  # noqa: F401  (defines the operator that is counted)

aten = torch.ops.aten

KINDS: dict[Any, str] = {
    aten.mm: "matmul",
    aten.addmm: "matmul",
    aten.bmm: "matmul",
    aten.baddbmm: "matmul",
    aten.convolution: "conv",
    aten.convolution_backward: "conv",
    torch.ops.semgs.correlate: "sweep",
    torch.ops.semgs.correlate_backward: "sweep",
}
"""Kind of each operator; every other one that is counted is attention."""

PER_CHANNEL = 9
"""Of one sample of the plane sweep: four texels weighted and summed, and the product with the reference's channel."""


class Counter:
    """Operations so far, by kind: conv, matmul, attention, sweep."""

    def __init__(self, mode: FlopCounterMode) -> None:
        self._mode = mode

    def read(self) -> dict[str, float]:
        """Operations since the beginning."""
        kinds = dict.fromkeys(("conv", "matmul", "attention", "sweep"), 0.0)
        for operator, count in self._mode.get_flop_counts().get("Global", {}).items():
            kinds[KINDS.get(operator, "attention")] += count
        return kinds


@contextmanager
def counted() -> Iterator[Counter]:
    """Count all that torch computes inside; a product and its sum are two operations."""
    extra = {
        aten._scaled_dot_product_flash_attention_for_cpu: _attention,
        torch.ops.semgs.correlate: _sweep,
        torch.ops.semgs.correlate_backward: _sweep_backward,
    }
    with FlopCounterMode(display=False, custom_mapping=extra) as mode:
        yield Counter(mode)


def difference(after: Mapping[str, float], before: Mapping[str, float]) -> dict[str, float]:
    """Operations between two readings."""
    return {kind: after[kind] - before[kind] for kind in after}


def _attention(query, key, value, *args, out_shape=None, **kwargs) -> int:
    return sdpa_flop_count(query, key, value)


def _sweep(reference, source, matrices, offsets, depths, *args, out_shape=None, **kwargs) -> int:
    n, h, w, channels = reference
    return n * h * w * depths[1] * channels * PER_CHANNEL


def _sweep_backward(*args, out_shape=None, **kwargs) -> int:
    return 2 * _sweep(*args)

"""Precision: layers may compute in bfloat16; geometry computes in float32 or better, even within autocast."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from functools import wraps
from pathlib import Path
from typing import Any, Literal, ParamSpec, TypeVar

import torch
from torch import Tensor, nn

from semgs.runtime.control_groups import ROOT, file_lines

Precision = Literal["float32", "bf16"]
"""Of the layers of a network."""

BFLOAT16_UNITS = {"avx512_bf16", "amx_bf16"}
"""Flags of processors that compute in bfloat16; others imitate it and take 5 to 20 times as long."""

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def has_bfloat16_units(root: Path = ROOT) -> bool:
    """Whether the processor computes in bfloat16, as far as the system says.

    Args:
        root: the folder with `proc`.
    """
    flags = next((line for line in file_lines(root / "proc/cpuinfo") if line.startswith("flags")), "")
    return not BFLOAT16_UNITS.isdisjoint(flags.split())


def in_full(maps: Tensor) -> Tensor:
    """A tensor in its own precision, or float32 if that is better."""
    return maps.to(torch.promote_types(maps.dtype, torch.float32))


def in_own_precision(forward: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Let a method of a network compute in its `precision`. In float32 an autocast around it stays in force, as in training."""

    @wraps(forward)
    def computed(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        network: Any = args[0]
        half = network.precision == "bf16"
        device = next(network.parameters()).device.type
        with torch.autocast(device, torch.bfloat16) if half else nullcontext():
            return forward(*args, **kwargs)

    return computed


class FullPrecisionConv2d(nn.Conv2d):
    """A convolution in the precision of its weights, even within autocast: for the last layers before depth and opacity."""

    def forward(self, input: Tensor) -> Tensor:
        """The convolved map."""
        if not torch.is_autocast_enabled(input.device.type):
            return super().forward(input.to(self.weight.dtype))
        with torch.autocast(input.device.type, enabled=False):
            return super().forward(input.to(self.weight.dtype))


def outside_autocast(function: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Disable autocast inside a function, on the device of its first tensor.

    Autocast would round the operands of every matrix product to half precision, for positions a relative error of 1/256.
    """

    @wraps(function)
    def precise(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        first = next(one for one in args if isinstance(one, Tensor))
        if not torch.is_autocast_enabled(first.device.type):
            return function(*args, **kwargs)
        with torch.autocast(first.device.type, enabled=False):
            return function(*args, **kwargs)

    return precise

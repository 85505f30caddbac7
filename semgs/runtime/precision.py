"""Precision: geometry computes in float32 or better, even within autocast."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import ParamSpec, TypeVar

import torch
from torch import Tensor, nn

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


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

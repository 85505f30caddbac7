"""The device that a network computes on, and the precision of its layers."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from semgs.run.usage_errors import UsageError

if TYPE_CHECKING:
    from semgs.runtime.precision import Precision


def chosen_device(name: str) -> str:
    """The device to compute on, "cpu" or "cuda"; "auto" uses CUDA if it is available.

    Raises:
        UsageError: CUDA is requested but not available.
    """
    import torch

    if name == "cuda" and not torch.cuda.is_available():
        raise UsageError("--device cuda: torch finds no CUDA device here; use --device cpu or auto")
    if name == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    return name


def chosen_precision(name: str, device: str) -> Precision:
    """The precision of a network's layers, "float32" or "bf16"; "auto" is bf16 on processors that compute in it.

    On a GPU, auto is float32: there a frame is too small to gain by bf16.
    """
    from semgs.runtime.precision import has_bfloat16_units

    fast = device == "cpu" and has_bfloat16_units()
    if name == "auto":
        return "bf16" if fast else "float32"
    if name == "bf16" and device == "cpu" and not fast:
        print("semgs: this processor only imitates bf16, so it is many times slower than float32", file=sys.stderr)
    return "bf16" if name == "bf16" else "float32"

"""The device that a network computes on."""

from __future__ import annotations

from semgs.cli.usage_errors import UsageError


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

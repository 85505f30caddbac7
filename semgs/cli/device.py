"""The device that a network computes on."""

from __future__ import annotations

from semgs.cli.errors import UsageError

DEVICES = ("auto", "cpu", "cuda")


def check_device(name: str) -> None:
    """Refuse a device that nothing here can use, without importing torch.

    Raises:
        UsageError: it is none of auto, cpu and cuda.
    """
    if name == "mps":
        raise UsageError("--device mps is not supported yet: it has no float64, which cameras need; use cpu")
    if name not in DEVICES:
        raise UsageError(f"--device is {name!r}; expected one of {', '.join(DEVICES)}")


def chosen_device(name: str) -> str:
    """The device to compute on: "cpu" or "cuda"; "auto" takes CUDA where there is one.

    Raises:
        UsageError: CUDA is asked for and there is none.
    """
    import torch

    check_device(name)
    if name == "cuda" and not torch.cuda.is_available():
        raise UsageError("--device cuda: torch finds no CUDA device here; use --device cpu or auto")
    if name == "auto":
        return "cuda" if torch.cuda.is_available() else "cpu"
    return name

"""Software versions and hardware, for reports."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import torch

from semgs._version import __version__

LIBRARIES = ("torch", "numpy", "scipy", "torchmetrics", "numba", "opencv-python-headless", "pillow")
"""Libraries that affect the numbers."""


def versions() -> dict[str, str]:
    """The versions of semgs, of Python and of the libraries that affect the numbers."""
    found = {"semgs": __version__, "python": platform.python_version()}
    for name in (*LIBRARIES, "lpips"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def hardware(device: str) -> dict[str, str | int]:
    """The processor, the number of cores and threads, and the GPU if one was used.

    Args:
        device: of the network, "cpu" or "cuda".
    """
    found: dict[str, str | int] = {
        "system": f"{platform.system()} {platform.machine()}",
        "processor": _processor(),
        "cores": os.cpu_count() or 1,
        "threads": torch.get_num_threads(),
        "device": device,
    }
    if device != "cpu":
        found["gpu"] = torch.cuda.get_device_name()
    return found


def _processor() -> str:
    """The name of the processor, if the system reports it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()

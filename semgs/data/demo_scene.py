"""The included scene: a room that ships with the package, to try everything without data."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

SEED = 2026
"""Seed of the scene, which is room 412; nothing is trained or validated on this seed."""


def demo_scene() -> Path:
    """Folder of the included scene: eight frames of a living room at 240x320, with depths and labels.

    Raises:
        FileNotFoundError: the installed package does not contain it.
    """
    folder = Path(str(files("semgs.data"))) / "demo"
    if not (folder / "transforms.json").is_file():
        raise FileNotFoundError(f"{folder} contains no scene; the package is incomplete, install it again")
    return folder

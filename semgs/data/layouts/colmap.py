"""COLMAP."""

from pathlib import Path

LOOKED_FOR = "a COLMAP model"


def recognises(path: Path) -> bool:
    return False


def open_model(path: Path):
    raise NotImplementedError

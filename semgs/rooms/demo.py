"""The embedded scene: a room that comes with the package, so that everything can be tried without data."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

SEED = 2026
"""The stream that the scene is from (its room 412, pictures of quality 90); nothing is trained or validated in it."""
SIZE = (240, 320)
FRAMES = 8


def demo_scene() -> Path:
    """The folder of the embedded scene: eight frames of a living room at 240x320, with depths and labels.

    Raises:
        FileNotFoundError: the package was installed without it.
    """
    folder = Path(str(files("semgs.rooms"))) / "demo"
    if not (folder / "transforms.json").is_file():
        raise FileNotFoundError(f"{folder} holds no scene: the package is incomplete; install it again")
    return folder

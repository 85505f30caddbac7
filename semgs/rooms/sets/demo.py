"""The embedded scene: a room that comes with the package, so that everything can be tried without data."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

SEED = 2026
"""The stream that the scene is from; nothing is trained or validated in it."""
INDEX = 412
"""Which of its rooms."""
SIZE = (240, 320)
FRAMES = 8


def demo_scene() -> Path:
    """The folder of the embedded scene: eight frames of a living room at 240x320, with depths and labels.

    Raises:
        FileNotFoundError: the package was installed without it.
    """
    folder = Path(str(files("semgs.rooms.sets"))) / "demo"
    if not (folder / "transforms.json").is_file():
        raise FileNotFoundError(f"{folder} holds no scene: the package is incomplete; install it again")
    return folder


def write_demo(folder: str | Path, overwrite: bool = False) -> None:
    """Draw the embedded scene anew into a folder.

    Raises:
        InputError: as `write_scene`.
        ImportError: embreex is not installed; names the extra that brings it.
    """
    from semgs.rooms.sets.scenes import (
        write_scene,
    )  # needs torch, which those that only ask for the folder or the seed do not

    write_scene(folder, SEED, index=INDEX, size=SIZE, frames=FRAMES, quality=90, overwrite=overwrite)

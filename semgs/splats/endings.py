"""The names of files that commands take for splats. What such a file is, its content says."""

from __future__ import annotations

from pathlib import Path

from semgs.files.errors import InputError
from semgs.files.paths import trained_splat

ENDINGS = (".ply", ".spz", ".glb", ".gltf")
"""Of the names, in lower case."""


OTHERS = {".sog": "SOG", ".ksplat": "KSPLAT", ".splat": ".splat", ".spx": "SPX", ".lcc": "LCC"}
"""Kinds of splats that are not read, by their endings."""


def is_splat(path: Path) -> bool:
    """Whether a path has the ending of a splat and is not a folder, or is the folder of a training, which has splats."""
    return trained_splat(path) is not None if path.is_dir() else path.suffix.lower() in (*ENDINGS, *OTHERS)


def lacks_classes(path: Path, option: str) -> InputError:
    """The error if a splat of another program is given for an option that needs classes."""
    return InputError(
        path, f"a scene with classes for {option}", "a splat of another program", advice="semgs label-splat gives it classes"
    )  # fmt: skip

"""The names of files that commands take for splats. What such a file is, its content says."""

from __future__ import annotations

from pathlib import Path

from semgs.files.errors import InputError

ENDINGS = (".ply", ".spz", ".glb", ".gltf")
"""Of the names, in lower case."""


def is_splat(path: Path) -> bool:
    """Whether a path has the ending of a splat and is not a folder."""
    return path.suffix.lower() in ENDINGS and not path.is_dir()


def lacks_classes(path: Path, option: str) -> InputError:
    """The error if a splat of another program is given for an option that needs classes."""
    return InputError(
        path, f"a scene with classes for {option}", "a splat of another program", advice="semgs label-splat gives it classes"
    )  # fmt: skip

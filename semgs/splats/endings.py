"""The names of files that commands take for splats. What such a file is, its content says."""

from __future__ import annotations

from pathlib import Path

ENDINGS = (".ply", ".spz", ".glb", ".gltf")
"""Of the names, in lower case."""


def is_splat(path: Path) -> bool:
    """Whether a path has the ending of a splat and is not a folder."""
    return path.suffix.lower() in ENDINGS and not path.is_dir()

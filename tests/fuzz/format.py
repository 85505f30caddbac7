"""What a format is to the fuzzer, and how views and scenes are read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import torch

from semgs.data.scenes import open_scene
from semgs.data.views import Views

Seed = Callable[[Path], Path]
"""Writes a seed into a folder and returns what to open."""


@dataclass(frozen=True)
class Format:
    """A format to be damaged.

    Attributes:
        name: for the command line.
        variants: write the seeds; blocks of cases take them in turn.
        main: patterns of the files that most cases change.
        read: reads what a seed wrote; takes the path, a folder to write to, and the names of the changed files.
        modules: of the readers, whose lines are counted.
        cases: how many are run if nothing is said.
        sealed: whether nothing outside may be read, as from an archive.
    """

    name: str
    variants: tuple[Seed, ...]
    main: tuple[str, ...]
    read: Callable[[Path, Path, Sequence[str]], object]
    modules: tuple[str, ...]
    cases: int = 10_000
    sealed: bool = False


def sane(views: Views) -> None:
    """Views that were read have finite numbers in their ranges.

    Raises:
        AssertionError: they have not.
    """
    views.checked()
    assert torch.isfinite(views.images).all(), "images"
    assert 0 <= views.images.min() <= views.images.max() <= 1, "images"
    assert torch.isfinite(views.cameras.world_from_camera).all(), "poses"
    assert torch.isfinite(views.cameras.intrinsics).all(), "intrinsics"
    if views.depths is not None:
        assert torch.isfinite(views.depths).all(), "depths"
        assert (views.depths >= 0).all(), "depths"


def read_scene(path: Path, out: Path, changed: Sequence[str]) -> None:
    """Open a scene and read its first frames."""
    scene = open_scene(path)
    sane(scene.read(range(min(3, len(scene)))))

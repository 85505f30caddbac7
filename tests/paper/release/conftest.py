"""Scenes that are known to the pixel, as in the tests of evaluations."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from known_scenes import SIZE, write_scene

from semgs.data.scene import Scene


@pytest.fixture
def make_scene(tmp_path: Path) -> Callable[..., Scene]:
    """`make_scene("living", frames=5, size=(36, 48), labels=True, depth=True, positions=None, change=None)`."""

    def make(name: str = "living", frames: int = 5, size: tuple[int, int] = SIZE, **options: object) -> Scene:
        return write_scene(tmp_path / "scenes" / name, frames, size, **options)  # type: ignore[arg-type]

    return make

"""A small scene on disk for the command line, and its variants."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from turned_cameras import write_scene


@pytest.fixture(scope="session")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a good scene of four frames, one for all who only read it."""
    return write_scene(tmp_path_factory.mktemp("scenes") / "room")


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """The folder of a good scene of four frames, to be changed at will."""
    return write_scene(tmp_path / "scene")


@pytest.fixture
def broken(tmp_path: Path) -> Callable[..., Path]:
    """Writes a scene and edits its description: `broken(lambda scene: ..., frames=4)`."""
    return lambda change=None, frames=4: write_scene(tmp_path / "scene", change, frames)

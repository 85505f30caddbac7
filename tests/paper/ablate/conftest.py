"""A small scene on disk."""

from __future__ import annotations

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

"""What several commands read."""

from __future__ import annotations

from pathlib import Path

import pytest
from blocks import room_of_blocks

from semgs.scene.scene_file import save_scene


@pytest.fixture(scope="session")
def scene_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scene with two chairs, not to be changed. They have 300 Gaussians each, so they are things."""
    path = tmp_path_factory.mktemp("blocks") / "scene.safetensors"
    save_scene(path, room_of_blocks())
    return path

"""Photos that several tests read, and none changes."""

from __future__ import annotations

import pytest
from pycolmap_photos import Taken, poses_of, take


@pytest.fixture(scope="session")
def three(tmp_path_factory: pytest.TempPathFactory) -> Taken:
    """Three photos, 30 cm apart."""
    return take(tmp_path_factory.mktemp("photos") / "three", poses_of(3))

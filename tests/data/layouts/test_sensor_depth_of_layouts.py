"""Every layout with depth gives it to `--depth sensor`: Gaussians lie where its maps say, at the pixels of its images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from miniatures import miniature
from scannet_writer import scan, write_extracted, write_raw
from test_frame_files import write_frames
from test_one_room import LAYOUTS, ROOM
from test_rgbd import MANNERS, STATES_NO_UNIT

from semgs.data.choosing.choice import choose_named
from semgs.data.scene import Scene
from semgs.data.scenes import open_scene
from semgs.geometry.cameras import project
from semgs.model.semgs import SemGS
from semgs.model.weights.load import load
from semgs.run.steps.pipeline import reconstruct


def manner(name: str) -> Callable[[Path], Scene]:
    """Opens the room as RGB-D frames with poses in text."""
    unit = 0.001 if name in STATES_NO_UNIT else None
    return lambda folder: open_scene(MANNERS[name](folder, miniature().first(3)), depth_unit=unit)


SCENES: dict[str, Callable[[Path], Scene]] = {
    **{name: (lambda folder, write=write: write(folder, ROOM)) for name, write in LAYOUTS.items()},
    **{name: manner(name) for name in MANNERS},
    "7-Scenes": lambda folder: open_scene(write_frames(folder / "seq-01", miniature((480, 640), 3))),
    "ScanNet, raw": lambda folder: open_scene(write_raw(folder, scan())),
    "ScanNet, extracted": lambda folder: open_scene(write_extracted(folder, scan())),
}


@pytest.fixture(scope="module")
def network() -> SemGS:
    """With random weights: its own depth is noise."""
    return load("small", weights="random").eval()


@pytest.mark.parametrize("layout", SCENES)
def test_gaussians_lie_at_the_depth_that_the_layout_gives(layout: str, network: SemGS, tmp_path: Path):
    folder = tmp_path / "room"
    if layout != "ROS bag":  # whose writer makes it
        folder.mkdir()
    scene = SCENES[layout](folder)
    result = reconstruct(scene, replace(choose_named(scene, [0, 2]), size=(32, 48)), network, depth="sensor")
    depths, cameras = result.context.views.depths, result.context.views.cameras
    assert depths is not None
    assert result.placement is not None
    assert min(fit.measured for fit in result.placement.fits) > 0.5
    for view in range(2):
        own = slice(view * 16 * 24, (view + 1) * 16 * 24)
        x, y, z = project(result.encoding.gaussians.means[own], cameras[view]).unbind(-1)
        rows, columns = (side.reshape(16, 24).long() for side in (y, x))
        assert (rows // 2 == torch.arange(16)[:, None]).all()
        assert (columns // 2 == torch.arange(24)).all()
        blocks = depths[view].reshape(16, 2, 24, 2).transpose(1, 2).flatten(2).sort(-1).values
        known = blocks[..., 0] > 0
        np.testing.assert_allclose(z.reshape(16, 24)[known], blocks[..., 1][known], rtol=1e-4)
        assert known.float().mean() > 0.5

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from blocks import room_of_blocks, turned

from semgs.export.scene_export import SceneExport
from semgs.export.scene_objects import floor_of
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.scene.confidence import part_of
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import UpDirection


def raised() -> tuple[SavedScene, UpDirection]:
    """The room of blocks in a frame in which nothing is level and the floor is 1.7 m above the origin."""
    move = torch.eye(4, dtype=torch.float64)
    move[:3, :3] = matrix_from_quaternion(torch.tensor([0.6, 0.5, -0.2, 0.3], dtype=torch.float64))
    up = move[:3, 2].clone()
    move[:3, 3] = 1.7 * up
    return turned(room_of_blocks(), move), UpDirection(up, "as given")


def export_of(scene: SavedScene, up: UpDirection) -> SceneExport:
    return SceneExport(scene, torch.ones(len(scene.gaussians), dtype=torch.bool), up, None)


def test_with_z_up_the_floor_is_at_zero_and_other_files_are_centred() -> None:
    scene, up = raised()
    assert floor_of(scene, up) == pytest.approx(1.7, abs=1e-5)
    framed = export_of(scene, up).frame("z")
    labels = scene.gaussians.semantic.features.argmax(-1)
    heights = framed.scene.gaussians.means[labels == scene.classes.index("floor"), 2]
    assert heights.abs().max() < 1e-5
    assert framed.scene.cameras.centres[:, 2].tolist() == pytest.approx([1.2, 1.3], abs=1e-5)
    assert framed.scene.gaussians.means[:, :2].median(0).values.abs().max() < 1e-5, "centred beside"
    back = framed.source_from_file.numpy()
    means = framed.scene.gaussians.means.double().numpy() @ back[:3, :3].T + back[:3, 3]
    np.testing.assert_allclose(means, scene.gaussians.means.numpy(), atol=1e-5)
    for axes in ("-y", "y"):
        assert export_of(scene, up).frame(axes).scene.gaussians.means.median(0).values.abs().max() < 1e-5


def test_without_a_floor_or_a_unit_the_height_is_centred_too() -> None:
    scene, up = raised()
    for other in (
        replace(scene, unit="unknown"),
        part_of(scene, scene.gaussians.semantic.features.argmax(-1) == 0),
    ):
        assert floor_of(other, up) is None
        assert export_of(other, up).frame("z").scene.gaussians.means.median(0).values.abs().max() < 1e-5

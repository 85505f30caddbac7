"""Labelled meshes of scenes that are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from blocks import room_of_blocks
from saved_scenes import CHAIR, WALL, wall

pytest.importorskip("skimage")

from semgs.mesh.labelled import mesh_of
from semgs.rendering.temperatures import Temperatures


def test_a_wall_has_its_depth_its_colours_and_its_classes() -> None:
    scene = wall()
    mesh = mesh_of(scene, voxel=0.05)
    camera = scene.cameras[0]
    inside = (
        torch.from_numpy(mesh.vertices) @ camera.camera_from_world[:3, :3].T + camera.camera_from_world[:3, 3]
    ).numpy()
    first = inside[(np.abs(inside[:, :2]) < 0.3).all(1)]
    assert (
        1.8 < np.median(first[:, 2]) < 2.02
    )  # the second camera is turned by some degrees, and its wall in part before the other
    column = inside[:, 0] / inside[:, 2] * float(camera.intrinsics[0, 0]) + float(camera.intrinsics[0, 2])
    assert (mesh.labels[column < 14] == WALL).mean() > 0.95
    assert (mesh.labels[column > 26] == CHAIR).mean() > 0.95
    assert np.median(mesh.confidences[column < 14]) == pytest.approx(0.81, abs=0.03)
    assert mesh.instances is None
    red = mesh.colours[:, 0].astype(float)
    assert red[column < 10].mean() < 100 < 150 < red[column > 30].mean()


def test_a_temperature_calibrates_the_confidence() -> None:
    """0.81 and nineteen times 0.01 to the power 1/2: 0.9 of 0.9 + 19 * 0.1 is 0.321."""
    mesh = mesh_of(wall(temperatures=Temperatures(2.0, 1.0)), voxel=0.05)
    assert np.median(mesh.confidences[mesh.labels == WALL]) == pytest.approx(0.321, abs=0.03)


def test_a_room_has_its_floor_its_wall_and_its_things() -> None:
    scene = room_of_blocks()
    numbers = (scene.gaussians.semantic.features.argmax(-1) == CHAIR).long()
    mesh = mesh_of(scene, voxel=0.05, instances=numbers.numpy())
    names = np.array(scene.classes.names)[mesh.labels]
    floor, far, chair = (mesh.vertices[names == name] for name in ("floor", "wall", "chair"))
    assert np.mean(np.abs(floor[:, 2]) < 0.05) > 0.95
    assert np.mean(np.abs(far[:, 0] - 4.02) < 0.05) > 0.95
    assert chair[:, 2].max() == pytest.approx(0.78, abs=0.06)
    assert np.mean(mesh.instances[names == "chair"] == 1) > 0.9
    assert np.mean(mesh.instances[names == "wall"] == 0) > 0.95
    fewer = mesh.simplified(len(mesh.faces) // 4) if pytest.importorskip("fast_simplification") else mesh
    assert len(fewer.faces) <= 1.1 * len(mesh.faces) / 4
    kept = np.array(scene.classes.names)[fewer.labels]
    assert np.mean(np.abs(fewer.vertices[kept == "wall"][:, 0] - 4.02) < 0.05) > 0.9
    assert len(fewer.vertices) == len(fewer.colours) == len(fewer.instances)


def test_uncertain_depth_and_one_view_and_no_depth_give_no_mesh() -> None:
    scene = wall()
    with pytest.raises(ValueError, match="needs two or more views, and the scene has one"):
        mesh_of(
            replace(
                scene, cameras=scene.cameras[:1], depths=scene.depths[:1], confidences=scene.confidences[:1], depth_spread=None,
                depth_range=scene.depth_range[:1], frames=("a",), gaussians=scene.gaussians.map(lambda one: one[: 30 * 41]), stride=1,
            )
        )  # fmt: skip
    faint = replace(scene.gaussians, opacities=torch.full_like(scene.gaussians.opacities, 0.001))
    with pytest.raises(ValueError, match="a mesh needs depth"):
        mesh_of(replace(scene, gaussians=faint))
    with pytest.raises(ValueError, match="no surface is left"):
        mesh_of(replace(scene, depth_spread=torch.full_like(scene.depths, 10.0)), voxel=0.05)


def test_without_metres_voxels_are_a_150th_of_the_depth() -> None:
    scene = replace(wall(), unit="unknown", depth_spread=None)
    near, far = (
        np.median(np.diff(np.unique(np.round(mesh_of(scene, voxel=one).vertices, 9), axis=0)[:, 0]))
        for one in (None, 2 / 150)
    )
    assert near == pytest.approx(far, rel=0.1)

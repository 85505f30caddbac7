from __future__ import annotations

import numpy as np
import pytest
import torch
from wall_and_chair import WALL, wall_and_chair

from semgs.data.tables.classes import SCANNET20
from semgs.geometry.cameras import Cameras, project
from semgs.rendering.render import render
from semgs.rendering.rendering import UNSEEN, label_maps
from semgs.viewer.pick import pick


def between(scene) -> Cameras:
    """A camera between the two input views, of another size."""
    poses = scene.cameras.world_from_camera
    pose = poses[0].clone()
    pose[:3, 3] = poses[:, :3, 3].mean(0)
    return Cameras(pose, torch.tensor([[31.0, 0, 16.4], [0, 29.0, 13.2], [0, 0, 1]]), (28, 36))


def test_a_click_on_any_pixel_names_the_class_that_the_class_map_has_there():
    scene = wall_and_chair()
    mixed = scene.gaussians.semantic.features
    mixed[:] = torch.rand(mixed.shape, generator=torch.Generator().manual_seed(3)).softmax(-1)
    camera = between(scene)
    rendering = render(scene.gaussians, camera.arranged(lambda array: array[None]), near=scene.near)
    labels = label_maps(rendering)[0]
    assert len(np.unique(labels)) > 5
    for row in range(0, 28, 3):
        for column in range(0, 36, 3):
            hit = pick(scene, camera, (column + 0.5, row + 0.5))
            expected = None if labels[row, column] == UNSEEN else SCANNET20.names[labels[row, column]]
            assert (hit and hit.name) == expected, (row, column)
            if hit is not None:
                assert hit.probability == pytest.approx(float(rendering.semantics[0, :, row, column].max()), abs=1e-4)


def test_the_position_is_where_the_opacity_passes_a_half_in_the_coordinates_of_the_source():
    scene = wall_and_chair()
    hit = pick(scene, scene.cameras[0], (10.5, 20.5), visible=np.arange(4000) < 2000)  # those of the first view
    assert hit is not None
    at = torch.tensor(hit.position, dtype=torch.float64) - torch.tensor(scene.origin)
    x, y, depth = project(at[None], scene.cameras[0])[0].tolist()
    assert (x, y) == pytest.approx((10.5, 20.5), abs=1e-6)
    assert depth == pytest.approx(2.5, abs=1e-3)


def test_two_faint_layers_pass_a_half_at_the_second():
    """Opacities of 0.4: the first leaves 0.6 of the light and the second 0.36, which is less than a half."""
    scene = wall_and_chair()
    gaussians = scene.gaussians.map(lambda tensor: tensor[[20 * 50 + 10] * 3].clone())
    camera = scene.cameras[0]
    gaussians.opacities[:] = 0.4
    for index, depth in enumerate((3.0, 1.0, 2.0)):
        ray = torch.tensor([10.5, 20.5, 1.0], dtype=torch.float64) @ torch.linalg.inv(camera.intrinsics).T
        gaussians.means[index] = (camera.centres + depth * camera.world_from_camera[:3, :3] @ ray).float()
    object.__setattr__(scene, "gaussians", gaussians)
    hit = pick(scene, camera, (10.5, 20.5))
    assert hit is not None
    at = torch.tensor(hit.position, dtype=torch.float64) - torch.tensor(scene.origin)
    assert float(project(at[None], camera)[0, 2]) == pytest.approx(2.0, abs=1e-5)


def test_what_is_hidden_cannot_be_clicked():
    scene = wall_and_chair()
    wall = scene.gaussians.semantic.features.argmax(-1).numpy() == WALL
    assert pick(scene, scene.cameras[0], (10.5, 20.5)).name == "wall"
    behind = pick(scene, scene.cameras[0], (10.5, 20.5), visible=~wall)
    assert behind is None or behind.name == "chair"
    assert pick(scene, scene.cameras[0], (10.5, 20.5), visible=np.zeros(len(wall), np.bool_)) is None


def test_a_class_that_is_not_sure_enough_is_unknown():
    scene = wall_and_chair()
    hit = pick(scene, scene.cameras[0], (10.5, 20.5), min_confidence=0.9)
    assert (hit.name, round(hit.probability, 1)) == ("unknown", 0.8)


def test_without_classes_there_is_a_position_only():
    scene = wall_and_chair(classes=False)
    hit = pick(scene, scene.cameras[0], (10.5, 20.5))
    assert (hit.name, hit.probability) == (None, None)


def test_the_thing_is_that_of_the_clicked_class():
    """Each view has Gaussians of its own there: those of the first are thing 5, those of the second thing 9."""
    scene = wall_and_chair()
    instances = np.full(4000, 9)
    instances[:2000] = 5
    first = np.arange(4000) < 2000
    hit = pick(scene, scene.cameras[0], (10.5, 20.5), first, instances=instances)
    assert hit is not None
    assert (hit.name, hit.thing) == ("wall", 5)
    hit = pick(scene, scene.cameras[0], (10.5, 20.5), ~first, instances=instances)
    assert hit is not None
    assert hit.thing == 9
    nowhere = pick(scene, scene.cameras[0], (10.5, 20.5), first)
    assert nowhere is not None
    assert nowhere.thing == 0


def test_a_gaussian_of_another_class_does_not_say_which_thing_it_is():
    """A faint chair, thing 7, hangs in front of the wall, thing 8: the pixel is wall, so the thing is the wall's."""
    scene = wall_and_chair()
    wall, chair = 20 * 50 + 10, 20 * 50 + 45
    gaussians = scene.gaussians.map(lambda tensor: tensor[[chair, wall]].clone())
    gaussians.means[0] = gaussians.means[1] + 0.2 * (scene.cameras.centres[0] - gaussians.means[1]).float()
    gaussians.opacities[:] = torch.tensor([0.3, 0.9])
    object.__setattr__(scene, "gaussians", gaussians)
    hit = pick(scene, scene.cameras[0], (10.5, 20.5), instances=np.array([7, 8]))
    assert hit is not None
    assert (hit.name, hit.thing) == ("wall", 8)

"""The near bound: the smallest of a scene's views', whichever view has it, and the measure of all its lengths."""

from __future__ import annotations

from dataclasses import replace

import torch
from golden import fill_golden
from networks import preset
from posed import posed_views

from semgs.geometry.cameras import Cameras


def test_permuting_views_of_different_bounds_permutes_the_output() -> None:
    model = fill_golden(preset("small_plain")).double()
    views = posed_views(3, (32, 48), dtype=torch.float64)
    bounds = torch.tensor([[0.9, 9.0], [0.4, 12.0], [0.6, 10.0]], dtype=torch.float64)
    views = replace(views, depth_range=bounds)
    order = [2, 0, 1]
    # Cameras so close that the unit of their translations is the near bound's.
    poses = views.cameras.world_from_camera.clone()
    poses[:, :3, 3] = poses[:1, :3, 3] + 1e-4 * (poses[:, :3, 3] - poses[:1, :3, 3])
    views = replace(views, cameras=Cameras(poses, views.cameras.intrinsics, views.size))
    with torch.inference_mode():
        a, b = model(views), model(views.select(order))
    assert (b.depths - a.depths[order]).norm() / a.depths.norm() < 1e-8


def test_a_scene_in_other_units_has_the_same_depths_in_those() -> None:
    model = fill_golden(preset("small_plain")).double()
    views = posed_views(2, (32, 48), dtype=torch.float64)
    poses = views.cameras.world_from_camera.clone()
    poses[:, :3, 3] *= 7
    scaled = replace(
        views, cameras=Cameras(poses, views.cameras.intrinsics, views.size), depth_range=7 * views.depth_range
    )
    with torch.inference_mode():
        a, b = model(views), model(scaled)
    assert (b.depths - 7 * a.depths).norm() / (7 * a.depths).norm() < 1e-8

"""The near bound of a scene is the smallest of its views', whichever view has it."""

from __future__ import annotations

from dataclasses import replace

import torch
from golden import fill_golden
from posed import posed_views

from semgs.model import presets


def test_permuting_views_of_different_bounds_permutes_the_output() -> None:
    model = fill_golden(presets.small()).double()
    views = posed_views(3, (32, 48), dtype=torch.float64)
    bounds = torch.tensor([[0.9, 9.0], [0.4, 12.0], [0.6, 10.0]], dtype=torch.float64)
    views = replace(views, depth_range=bounds)
    order = [2, 0, 1]
    # Cameras so close that the unit of their translations is the near bound's.
    poses = views.cameras.world_from_camera.clone()
    poses[:, :3, 3] = poses[:1, :3, 3] + 1e-4 * (poses[:, :3, 3] - poses[:1, :3, 3])
    views = replace(views, cameras=type(views.cameras)(poses, views.cameras.intrinsics, views.size))
    with torch.inference_mode():
        a, b = model(views), model(views.select(order))
    assert (b.depths - a.depths[order]).norm() / a.depths.norm() < 1e-8

"""What the network returns, and what it looks like from cameras."""

from __future__ import annotations

from dataclasses import replace

import torch
from golden import fill_golden
from networks import preset
from posed import posed_views

from semgs.data.views import stack
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.model.layers.network_input import Chunks
from semgs.rendering.render import render
from semgs.scene.encoding import Encoding
from semgs.scene.scene_file import SavedScene

SIZE = (32, 48)


def test_the_near_bound_of_a_scene_is_the_smallest_of_its_views() -> None:
    views = posed_views(3, SIZE)
    with torch.inference_mode():
        encoding = fill_golden(preset("small_plain"))(views, Chunks(heads=2))
        assert torch.equal(encoding.depth_range, views.depth_range)
        # Bounds whose near planes, a fifth of them, lie among the Gaussians.
        bounds = 5 * float(encoding.depths.median()) * torch.tensor([[0.9, 9.0], [0.4, 8.0], [0.7, 7.0]])
        encoding = replace(encoding, depth_range=bounds)
        found = encoding.render(views.cameras).images
        for near in bounds[:, 0].tolist():
            expected = render(encoding.gaussians, views.cameras, near=near).images
            assert torch.equal(found, expected) == (near == min(bounds[:, 0].tolist()))
            assert torch.equal(encoding.render(views.cameras, near=near).images, expected)


def test_each_scene_of_a_batch_has_its_own_near_bound() -> None:
    one, other = posed_views(2, SIZE, seed=1), posed_views(2, SIZE, seed=5)
    other = other.changed(depth_range=2 * other.depth_range)
    model = fill_golden(preset("small_plain"))
    with torch.inference_mode():
        encoding = model(stack([one, other]))
        together = encoding.render(stack([one, other]).cameras)
        for index, views in enumerate((one, other)):
            alone = encoding.map(lambda tensor, index=index: tensor[index]).render(views.cameras)
            assert torch.equal(together.images[index], alone.images)
    assert torch.equal(encoding.depth_range, torch.stack([one.depth_range, other.depth_range]))


def test_bounds_stay_where_they_are_when_an_encoding_moves() -> None:
    with torch.inference_mode():
        encoding = fill_golden(preset("small_plain"))(posed_views(2, SIZE))
    moved = encoding.to("cpu", torch.float16)
    assert (moved.depths.dtype, moved.gaussians.means.dtype) == (torch.float16, torch.float16)
    assert moved.depth_range.dtype == torch.float64


def test_blocks_at_the_edge_count_when_places_are_counted_over_the_views() -> None:
    """5x8 px in blocks of 2x2 are 3 rows of 4 blocks."""
    size, count = (5, 8), 4
    shape = Appearance(torch.tensor([[1.0, 0, 0, 0]] * count), torch.ones(count, 3), torch.zeros(count, 1, 3))
    maps = torch.ones(3, *size)
    scene = SavedScene(
        Gaussians(torch.zeros(count, 3), torch.ones(count), shape, None), posed_views(3, size).cameras, maps, maps,
        torch.tensor([[0.5, 2.0]] * 3, dtype=torch.float64), "unknown", None, ("a", "b", "c"), "", "",
        stride=2, places=torch.tensor([0, 11, 12, 35]),
    )  # fmt: skip
    assert scene.grid == (3, 3, 4)
    assert scene.own_views.tolist() == [0, 0, 1, 2]


def test_gaussians_that_stand_for_a_hidden_pixel_have_no_opacity_or_are_left_out() -> None:
    """5x8 px in blocks of 2x2 are 3 rows of 4 blocks for each view; the hidden pixels are in block 5 of view 0 and in block 11 of view 1."""
    views = posed_views(2, (5, 8))
    count = 24
    shape = Appearance(torch.tensor([[1.0, 0, 0, 0]] * count), torch.ones(count, 3), torch.zeros(count, 1, 3))
    maps = torch.ones(2, 5, 8)
    means = torch.arange(3.0 * count).reshape(count, 3)
    encoding = Encoding(
        Gaussians(means, torch.full((count,), 0.7), shape), maps, maps, maps, views.depth_range, stride=2
    )
    hidden = torch.zeros(2, 5, 8, dtype=torch.bool)
    hidden[0, 3, 2] = hidden[1, 4, 7] = True
    opacities = encoding.hide(hidden).gaussians.opacities
    assert (opacities == 0).nonzero()[:, 0].tolist() == [5, 12 + 11]
    assert (opacities[opacities > 0] == torch.tensor(0.7)).all()
    left = encoding.without(hidden)
    kept = [block for block in range(count) if block not in (5, 23)]
    assert left.places.tolist() == kept
    assert torch.equal(left.gaussians.means, means[kept])
    assert left.own_views.tolist() == [0] * 11 + [1] * 11
    assert torch.equal(left.without(hidden).places, left.places)
    assert encoding.hide(None) is encoding.without(None) is encoding


def test_the_network_gives_hidden_pixels_no_opacity_and_leaves_all_else_alone() -> None:
    views = posed_views(2, SIZE)
    hidden = torch.zeros(2, *SIZE, dtype=torch.bool)
    hidden[1, :4] = True
    model = fill_golden(preset("small_plain"))
    with torch.inference_mode():
        free, masked = model(views), model(views.changed(hidden=hidden))
    gone = masked.gaussians.opacities.reshape(2, -1) == 0
    rows = 4 // free.stride
    assert gone.sum(1).tolist() == [0, rows * SIZE[1] // free.stride]
    assert gone[1, : rows * SIZE[1] // free.stride].all()
    assert torch.equal(masked.gaussians.opacities[~gone.flatten()], free.gaussians.opacities[~gone.flatten()])
    assert torch.equal(masked.depths, free.depths)

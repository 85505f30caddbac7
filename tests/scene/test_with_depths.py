"""The Gaussians of an encoding at other depths."""

from __future__ import annotations

from functools import cache

import pytest
import torch
from golden import fill_golden
from networks import network
from posed import posed_views

from semgs.data.views import Views
from semgs.geometry.cameras import project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.model.settings import MVSPLAT
from semgs.scene.encoding import Encoding

SIZE = (17, 22)
TINY = {
    "channels": 16,
    "cnn_widths": (8, 8, 16),
    "candidates": 8,
    "colour_blocks": 1,
    "cost_width": 16,
    "cost_hidden": 8,
}
TINY |= {"cost_levels": 1, "refine_levels": 1, "semantic_blocks": 1, "projected_channels": 8, "upsampled_channels": 16}


@cache
def encoded(name: str) -> Encoding:
    """Two views of 17x22 pixels as a tiny network sees them: a Gaussian for 2x2 pixels ("small"), or for each, by either convention."""
    changes: dict = {"small": {"gaussian_stride": 2}, "base": {}, "mvsplat": {"conventions": MVSPLAT}}
    model = fill_golden(network(**TINY, **changes[name]))
    with torch.no_grad():
        return model.double().eval()(posed_views(2, SIZE, dtype=torch.float64))


VIEWS: Views = posed_views(2, SIZE, dtype=torch.float64)
DEPTHS = 1 + torch.rand(2, *SIZE, generator=torch.Generator().manual_seed(4), dtype=torch.float64) * 3


def moved_one_by_one(encoding: Encoding, stride: int) -> tuple[list, list, list, list]:
    """Slow twin: means, sizes of both branches and opacities, Gaussian by Gaussian, from its block's pixels and its own ray."""
    gaussians, rows, columns = encoding.gaussians, -(-SIZE[0] // stride), -(-SIZE[1] // stride)
    means, colour, semantic, opacities = [], [], [], []
    for view in range(2):
        pose = VIEWS.cameras.world_from_camera[view]
        for row in range(rows):
            for column in range(columns):
                index = (view * rows + row) * columns + column
                block = [
                    (y, x)
                    for y in range(row * stride, min((row + 1) * stride, SIZE[0]))
                    for x in range(column * stride, min((column + 1) * stride, SIZE[1]))
                ]
                inside = pose[:3, :3].T @ (gaussians.means[index] - pose[:3, 3])
                z = sorted(float(DEPTHS[view, y, x]) for y, x in block)[(len(block) - 1) // 2]
                means.append(pose[:3, :3] @ (inside / inside[2] * z) + pose[:3, 3])
                colour.append(gaussians.colour.scales[index] * z / inside[2])
                semantic.append(gaussians.semantic.scales[index] * z / inside[2])
                opacities.append(sum(float(DEPTHS[view, y, x]) / 10 for y, x in block) / len(block))
    return means, colour, semantic, opacities


@pytest.mark.parametrize(("name", "stride"), [("small", 2), ("base", 1), ("mvsplat", 1)])
def test_moving_all_gaussians_is_moving_each_along_its_ray(name: str, stride: int):
    before = encoded(name)
    after = before.with_depths(DEPTHS, VIEWS.cameras, opacities=DEPTHS / 10)
    means, colour, semantic, opacities = moved_one_by_one(before, stride)
    torch.testing.assert_close(after.gaussians.means, torch.stack(means))
    torch.testing.assert_close(after.gaussians.colour.scales, torch.stack(colour))
    torch.testing.assert_close(after.gaussians.semantic.scales, torch.stack(semantic))
    torch.testing.assert_close(after.gaussians.opacities, torch.tensor(opacities, dtype=torch.float64))
    assert after.gaussians.colour.features is before.gaussians.colour.features
    assert after.gaussians.colour.quaternions is before.gaussians.colour.quaternions
    torch.testing.assert_close(after.placed_depths(VIEWS.cameras), after.depths)


@pytest.mark.parametrize("name", ["small", "mvsplat"])
def test_moved_gaussians_are_seen_at_the_same_pixels_at_the_new_depth(name: str):
    before = encoded(name)
    after = before.with_depths(torch.full_like(DEPTHS, 2.5), VIEWS.cameras)
    for view in range(2):
        own = slice(view * len(before.gaussians) // 2, (view + 1) * len(before.gaussians) // 2)
        was, now = (project(one.gaussians.means[own], VIEWS.cameras[view]) for one in (before, after))
        torch.testing.assert_close(now[:, :2], was[:, :2])
        torch.testing.assert_close(now[:, 2], torch.full_like(now[:, 2], 2.5))


def test_at_their_own_depths_gaussians_stay():
    before = encoded("small")
    torch.testing.assert_close(before.placed_depths(VIEWS.cameras), before.depths)
    after = before.with_depths(before.depths, VIEWS.cameras)
    for name, tensor in after.gaussians.tensors().items():
        torch.testing.assert_close(tensor, before.gaussians.tensors()[name])
    assert after.confidences is before.confidences
    assert after.depth_spread is before.depth_spread


def test_scenes_of_a_batch_move_by_themselves():
    one, other = encoded("small"), encoded("small").with_depths(DEPTHS, VIEWS.cameras)
    both = Encoding(
        Gaussians(
            *(torch.stack(pair) for pair in ((one.gaussians.means, other.gaussians.means),)),
            torch.stack((one.gaussians.opacities, other.gaussians.opacities)),
            Appearance(*(torch.stack((a, b)) for a, b in zip(vars(one.gaussians.colour).values(), vars(other.gaussians.colour).values(), strict=True))),
        ),
        *(torch.stack((getattr(one, name), getattr(other, name))) for name in ("depths", "confidences", "depth_spread", "depth_range")),
        stride=one.stride,
    )  # fmt: skip
    cameras = VIEWS.cameras.arranged(lambda array: array.expand(2, *array.shape))
    after = both.with_depths(torch.stack((DEPTHS, 2 * DEPTHS)), cameras)
    torch.testing.assert_close(after.gaussians.means[0], other.gaussians.means)
    torch.testing.assert_close(after.gaussians.means[1], one.with_depths(2 * DEPTHS, VIEWS.cameras).gaussians.means)


def test_a_block_lies_on_one_of_its_surfaces_and_never_between_them():
    """2 m and 4 m in each block of 2x2: with three pixels of a surface it wins, with two the nearer one, never 3 m."""
    depths = torch.full((2, *SIZE), 4.0, dtype=torch.float64)
    depths[:, 0, 0] = 2.0
    depths[:, 0, 2:4] = 2.0
    depths[:, 16, 2] = 2.0  # the last row has blocks of 1x2
    after = encoded("small").with_depths(depths, VIEWS.cameras)
    assert after.depths[0, :2, :4].tolist() == [[4, 4, 2, 2], [4, 4, 2, 2]]
    assert after.depths[1, 16, 2:4].tolist() == [2, 2]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"depths": DEPTHS[:, 1:]}, r"depths are \(2, 16, 22\); expected \(2, 17, 22\)"),
        ({"depths": DEPTHS - DEPTHS.min()}, "not finite or not positive"),
        ({"depths": DEPTHS / 0}, "not finite or not positive"),
    ],
)
def test_maps_that_are_no_depths_of_these_pixels_are_refused(change: dict, message: str):
    with pytest.raises(ValueError, match=message):
        encoded("small").with_depths(cameras=VIEWS.cameras, **({"depths": DEPTHS} | change))

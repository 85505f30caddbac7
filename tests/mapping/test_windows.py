"""Scenes from more views than the network takes at once: against the mapper, which adds frames one by one, and by hand."""

from __future__ import annotations

import pytest
import torch
from mapping_walls import SIZE, WALL, KnowsTheWall, cameras_at, encoded, image, seen_at

from semgs.data.bounds.depth_range import DepthRange
from semgs.mapping.mapper import Mapper
from semgs.mapping.windows import encode_in_windows, merge

BLOCKS = SIZE[0] * SIZE[1]


def test_each_view_has_the_gaussians_of_its_own_window_and_equal_windows_are_encoded_once():
    """The second window sees the wall at twice the depth: so does its own view, and no other. Three views have shrunk Gaussians to (2 / 3)^0.5 of 0.1 where all see them."""
    cameras, network, told = cameras_at(0.0, 0.0, 0.0, 0.0), KnowsTheWall(), []
    views = seen_at(cameras)

    def encode(window):
        found = network(window)
        return encoded(window.cameras, found.depths * len(network.windows))

    windows = [(0, 1, 2), (0, 1, 2), (0, 1, 2), (1, 2, 3)]
    found = encode_in_windows(views, windows, encode, told.append)
    assert network.windows == [3, 3]
    assert told == [1, 2]
    assert [float(depth.mean()) for depth in found.depths] == pytest.approx([WALL, WALL, WALL, 2 * WALL])
    assert found.gaussians.means[:, 2].reshape(4, BLOCKS).mean(1).tolist() == pytest.approx([4, 4, 4, 8])
    assert found.gaussians.colour.scales.mean() == pytest.approx(0.1 * 1.5**0.5)


def test_merging_at_once_gives_what_the_mapper_gives_frame_by_frame():
    """Frames an image's fifth apart: all are keyframes of the mapper, and of windows of two."""
    cameras = cameras_at(0.0, 0.9, 1.8, 2.7)
    views, network = seen_at(cameras, image().expand(4, 3, *SIZE)), KnowsTheWall()
    mapper = Mapper(lambda numbers, window: network(window), DepthRange(0.5, 10.0, "metric", "test"))
    for number in range(4):
        mapper.add(views.select([number]))
    slow = mapper.merged()
    assert slow is not None
    assert slow.numbers == (0, 1, 2, 3)
    whole = merge(encode_in_windows(views, [(0, 1), (0, 1), (1, 2), (2, 3)], network, lambda count: None), views, None)
    assert torch.equal(whole.places, slow.encoding.places)
    torch.testing.assert_close(whole.gaussians.means, slow.encoding.gaussians.means)
    torch.testing.assert_close(whole.gaussians.semantic.features, slow.encoding.gaussians.semantic.features)


@pytest.mark.parametrize("layers", [1, 2, 3, 4])
def test_a_surface_has_the_gaussians_of_so_many_views(layers: int):
    """Four photos from one place see the same wall."""
    views = seen_at(cameras_at(0.0, 0.0, 0.0, 0.0))
    assert len(merge(KnowsTheWall()(views), views, None, layers).gaussians) == layers * BLOCKS

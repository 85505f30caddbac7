"""However many pairs of Gaussian and tile a picture has, those in memory together are bounded, and the picture is the same."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from traced_memory import most_memory

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering import numba_backend
from semgs.rendering.numba_backend import runs_of_tiles
from semgs.rendering.render import render
from semgs.rendering.rendering import Rendering

FIELDS = ("images", "semantics", "depths", "alphas")


def drawn(gaussians: Gaussians, cameras: Cameras) -> tuple[Rendering, list[torch.Tensor]]:
    """The rendering, and the gradients of a random linear function of it in every tensor of the Gaussians."""
    leaves: list[torch.Tensor] = []

    def leaf(tensor: torch.Tensor) -> torch.Tensor:
        leaves.append(tensor.detach().clone().requires_grad_())
        return leaves[-1]

    rendering = render(gaussians.map(leaf), cameras, backend="numba")
    generator = torch.Generator().manual_seed(3)
    fields = [getattr(rendering, name) for name in FIELDS]
    sum((one * torch.randn(one.shape, generator=generator, dtype=one.dtype)).sum() for one in fields).backward()
    return rendering, [leaf.grad for leaf in leaves]


def covering(count: int, size: tuple[int, int]) -> tuple[Gaussians, Cameras]:
    """Faint Gaussians, each of which covers the whole picture."""
    generator = torch.Generator().manual_seed(5)
    means = torch.rand(count, 3, generator=generator) * 0.1 + torch.tensor([0.0, 0.0, 2.0])
    turns = torch.randn(count, 4, generator=generator)
    colour = Appearance(turns, torch.full((count, 3), 30.0), torch.rand(count, 1, 3, generator=generator))
    semantic = Appearance(turns, torch.full((count, 3), 20.0), torch.rand(count, 3, generator=generator).softmax(-1))
    pose = torch.eye(4, dtype=torch.float64)[None]
    cameras = Cameras(pose, [[[150, 0, 0.4 * size[1]], [0, 160, 0.6 * size[0]], [0, 0, 1]]], size)
    return Gaussians(means, torch.full((count,), 0.01), colour, semantic), cameras


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("most", [1, 23, 400])
def test_a_picture_drawn_in_runs_of_tiles_has_the_bits_of_one_drawn_at_once(
    random_scene, monkeypatch: pytest.MonkeyPatch, dtype: torch.dtype, most: int
) -> None:
    gaussians, cameras = random_scene(4, 200, 2, (50, 61), 4, 5)
    gaussians = gaussians.to(dtype)
    whole, gradients = drawn(gaussians, cameras)
    monkeypatch.setattr(numba_backend, "PAIRS_AT_A_TIME", most)
    parts, others = drawn(gaussians, cameras)
    for name in FIELDS:
        assert torch.equal(getattr(parts, name), getattr(whole, name))
    for one, other in zip(gradients, others, strict=True):
        assert torch.equal(one, other)


@pytest.mark.parametrize(("most", "runs"), [(5, [(0, 2), (2, 5), (5, 6), (6, 9)]), (99, [(0, 9)])])
def test_runs_have_at_most_so_many_pairs_or_are_one_tile(most: int, runs: list[tuple[int, int]]) -> None:
    pairs = np.array([0, 5, 2, 0, 3, 9, 1, 2, 1])
    assert [(run.start, run.stop) for run in runs_of_tiles(pairs, most)] == runs


def arrays_at_most(size: tuple[int, int]) -> int:
    """Bytes of the arrays that drawing there and back holds together, of 200 Gaussians that cover the picture."""
    scene = covering(200, size)
    return most_memory(lambda: drawn(*scene))


def test_gaussians_that_cover_the_picture_are_drawn_in_bounded_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn(*covering(3, (16, 16)))  # compiled, or loaded
    assert arrays_at_most((96, 160)) > 24_000 * 76  # 6 rows of 20 tiles, 200 Gaussians in each
    monkeypatch.setattr(numba_backend, "PAIRS_AT_A_TIME", 2000)
    small, large = arrays_at_most((96, 160)), arrays_at_most((192, 320))
    assert small < 2000 * 100 + 200 * 500
    assert large < 1.1 * small  # four times as many pairs

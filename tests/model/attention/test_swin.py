import math
from itertools import product

import pytest
import torch
from golden import fill_golden

from semgs.model.attention.transformer import MultiViewSwin, WindowAttention, Windows

GRID, COUNT, D = (8, 12), 2, 8


def by_loop(q, k, v, shifted: bool, cross: bool) -> torch.Tensor:
    """Attention of every token over its window's tokens, pair by pair."""
    _, views, h, w, d = q.shape
    size = (h // COUNT, w // COUNT)
    shift = (size[0] // 2, size[1] // 2) if shifted else (0, 0)

    def window(row: int, column: int) -> tuple[int, int]:
        return ((row - shift[0]) % h) // size[0], ((column - shift[1]) % w) // size[1]

    def region(row: int, column: int) -> tuple[bool, bool]:
        return row < shift[0], column < shift[1]

    out = torch.zeros_like(q)
    cells = [(r, c) for r in range(h) for c in range(w)]
    for i in range(views):
        keys_of = [j for j in range(views) if j != i] if cross else [i]
        for cell in cells:
            near = [(j, *u) for j in keys_of for u in cells if window(*u) == window(*cell)]
            logits = torch.stack([q[0, i][cell] @ k[0][u] / d**0.5 for u in near])
            logits = logits + torch.tensor([0.0 if region(*u[1:]) == region(*cell) else -100.0 for u in near])
            out[0, i][cell] = logits.softmax(0) @ torch.stack([v[0][u] for u in near])
    return out


@pytest.mark.parametrize("views", [2, 3, 4])
@pytest.mark.parametrize("shifted", [False, True])
@pytest.mark.parametrize("cross", [False, True])
def test_windowed_attention_equals_a_loop_over_tokens(views, shifted, cross):
    grid = GRID if views == 2 else (4, 8)
    q, k, v = (torch.randn(1, views, *grid, D, dtype=torch.float64) for _ in range(3))
    fast = Windows(grid, COUNT, shifted).attend(q, k, v, cross)
    assert (fast - by_loop(q, k, v, shifted, cross)).abs().max() < 1e-10


@pytest.mark.parametrize("views", [2, 3, 4])
@pytest.mark.parametrize("cross", [False, True])
def test_the_keys_of_a_token_are_its_window_in_its_own_view_or_in_all_others(views, cross):
    """With one value channel for every token, the output is the weights themselves."""
    grid = (4, 6)
    tokens = views * grid[0] * grid[1]
    v = torch.eye(tokens, dtype=torch.float64).reshape(1, views, *grid, tokens)
    q = torch.randn(v.shape, dtype=torch.float64)
    weights = Windows(grid, 2, True).attend(q, q, v, cross)[0].reshape(views, *grid, views, *grid)
    for i in range(views):
        used = (weights[i] > 1e-20).any(dim=(-1, -2))  # row, column, view of the keys
        expected = [j != i if cross else j == i for j in range(views)]
        assert (used == torch.tensor(expected)).all()
        # Windows of 2x3, shifted by one token both ways: (1, 1) heads a whole one; (0, 0) is left alone in its corner.
        inside = weights[i, 1, 1][[j for j in range(views) if expected[j]]] > 1e-20
        assert inside.nonzero()[:, 1:].unique(dim=0).tolist() == [[1, 1], [1, 2], [1, 3], [2, 1], [2, 2], [2, 3]]
        corner = weights[i, 0, 0][[j for j in range(views) if expected[j]]] > 1e-20
        assert corner.nonzero()[:, 1:].unique(dim=0).tolist() == [[0, 0]]
    assert torch.allclose(weights.sum((-1, -2, -3)), torch.ones(1, dtype=torch.float64))


def test_giving_every_other_view_twice_changes_nothing_and_one_of_two_does():
    q = torch.randn(1, 3, *GRID, D, dtype=torch.float64)

    def first(views: list[int]) -> torch.Tensor:
        x = q[:, views]
        return Windows(GRID, COUNT, True).attend(x, x, x, True)[:, 0]

    assert (first([0, 1, 2]) - first([0, 1, 2, 1, 2])).abs().max() < 1e-12
    assert (first([0, 1, 2]) - first([0, 1, 2, 1])).abs().max() > 1e-3


@pytest.mark.parametrize(("grid", "count"), [(GRID, 2), ((6, 10), 2), ((9, 12), 3)])
def test_shifted_windows_are_those_of_swin_moved_by_half_and_cut_at_the_borders(grid, count):
    windows = Windows(grid, count, True)
    for bands, side in zip((windows.rows, windows.columns), grid, strict=True):
        size = side // count
        assert [band.start for band in bands] == [0, *range(size // 2, side, size)]
        assert [band.stop for band in bands] == [*range(size // 2, side, size), side]


def positions_by_loop(grid: tuple[int, int], size: tuple[int, int]) -> torch.Tensor:
    """DETR's sine encoding, anew in every window, channel by channel [d h w]: half of them of the row, half of the column."""
    codes = torch.zeros(D, *grid, dtype=torch.float64)
    for channel, row, column in product(range(D), range(grid[0]), range(grid[1])):
        axis, place = divmod(channel, D // 2)
        angle = ((row, column)[axis] % size[axis] + 1) / size[axis] * 2 * math.pi
        angle /= 10000 ** (2 * (place // 2) / (D // 2))
        codes[channel, row, column] = math.cos(angle) if place % 2 else math.sin(angle)
    return codes


def layer_by_loop(layer: WindowAttention, source: torch.Tensor, target: torch.Tensor, shifted: bool, cross: bool):
    """source + norm(merge(attention)), with a feed-forward network: source + norm(mlp(source, message))."""
    q, k, v = layer.q_proj(source), layer.k_proj(target), layer.v_proj(target)
    message = layer.norm1(layer.merge(by_loop(q, k, v, shifted, cross)))
    if layer.mlp is not None:
        message = layer.norm2(layer.mlp(torch.cat((source, message), -1)))
    return source + message


@torch.no_grad()
def test_two_blocks_equal_loops_over_tokens():
    """Positions; then blocks, the second with shifted windows, whose cross-attention sees what the block was given."""
    grid = (4, 8)
    swin = fill_golden(MultiViewSwin(D, 2)).double()
    x = torch.randn(1, 3, D, *grid, generator=torch.Generator().manual_seed(6), dtype=torch.float64)
    tokens = (x + positions_by_loop(grid, (2, 4))).permute(0, 1, 3, 4, 2)
    for block, shifted in zip(swin.layers, (False, True), strict=True):
        own = layer_by_loop(block.self_attn, tokens, tokens, shifted, cross=False)
        tokens = layer_by_loop(block.cross_attn_ffn, own, tokens, shifted, cross=True)
    # Positions are computed in float32; one block that is wrong moves tokens by more than 0.1.
    assert (swin(x, None) - tokens.permute(0, 1, 4, 2, 3)).abs().max() < 1e-4


def test_one_window_is_full_attention_shifted_or_not():
    windows = Windows(GRID, 1, True)
    assert windows.size == GRID
    q = torch.randn(1, 2, *GRID, D, dtype=torch.float64)
    tokens = q.flatten(2, 3)
    expected = (tokens @ tokens.mT / D**0.5).softmax(-1) @ tokens
    assert (windows.attend(q, q, q, False).flatten(2, 3) - expected).abs().max() < 1e-12


def test_a_map_that_cannot_be_cut_is_refused():
    with pytest.raises(ValueError, match=r"\(7, 12\)"):
        Windows((7, 12), 2, False)


def test_all_views_move_in_lock_step():
    swin = MultiViewSwin(D, 2).double()
    x = torch.randn(1, 3, D, *GRID, dtype=torch.float64)
    order = [2, 0, 1]
    assert (swin(x, None)[:, order] - swin(x[:, order], None)).abs().max() < 1e-12


def test_reduced_tokens_still_see_the_other_views():
    swin = MultiViewSwin(D, 1, reduction=2).double()
    x = torch.randn(1, 2, D, *GRID, dtype=torch.float64)
    other = x.clone()
    other[:, 1] = torch.randn_like(other[:, 1])
    assert swin(x, None).shape == x.shape
    assert (swin(x, None)[:, 0] - swin(other, None)[:, 0]).abs().max() > 1e-3

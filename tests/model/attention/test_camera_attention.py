"""Camera-aware attention against the paper's equations 1 to 5 with every matrix written out."""

import pytest
import torch
from posed import posed_cameras
from torch import nn

from semgs.geometry.cameras import Cameras, project
from semgs.model.attention.camera_attention import normalised_projections, token_transforms
from semgs.model.attention.transformer import WindowAttention, Windows

D, GRID, VIEWS = 16, (4, 6), 3
NEAR = torch.tensor([0.5], dtype=torch.float64)


@pytest.fixture
def cameras():
    one = posed_cameras(VIEWS, (32, 48))
    return Cameras(one.world_from_camera[None], one.intrinsics[None], one.size)


def written_out(projection: torch.Tensor, row: int, column: int, d: int = D) -> torch.Tensor:
    """G_t as the paper's equations 2 and 3 have it: [d d]."""
    frequencies = 100.0 ** (-torch.arange(d // 8, dtype=torch.float64) / (d // 8))

    def rope(position: int) -> torch.Tensor:
        c, s = (position * frequencies).cos().diag(), (position * frequencies).sin().diag()
        return torch.cat((torch.cat((c, -s), 1), torch.cat((s, c), 1)))

    return torch.block_diag(torch.kron(torch.eye(d // 8, dtype=torch.float64), projection), rope(column), rope(row))


def test_each_token_is_multiplied_by_its_own_matrix(cameras):
    transforms = token_transforms(cameras, NEAR, GRID, D, torch.zeros(1, dtype=torch.float64))
    x = torch.randn(1, VIEWS, *GRID, D, dtype=torch.float64)
    q, k, o = transforms.queries(x), transforms.keys(x), transforms.outputs(x)
    projections, _ = normalised_projections(cameras, NEAR)
    for view in range(VIEWS):
        for row in range(GRID[0]):
            for column in range(GRID[1]):
                g, token = written_out(projections[0, view], row, column), x[0, view, row, column]
                place = (0, view, row, column)
                assert torch.allclose(q[place], g.T @ token, atol=1e-10)
                assert torch.allclose(k[place], torch.linalg.inv(g) @ token, atol=1e-10)
                assert torch.allclose(o[place], g @ token, atol=1e-10)
                assert not torch.allclose(q[place], torch.linalg.inv(g) @ token, atol=1e-3)


def test_the_inverse_projection_is_the_inverse(cameras):
    there, back = normalised_projections(cameras, NEAR)
    assert torch.allclose(there @ back, torch.eye(4, dtype=torch.float64).expand_as(there), atol=1e-12)


def test_a_projection_takes_a_point_to_its_place_in_a_picture_of_side_one_around_zero(cameras):
    pose, size = cameras.world_from_camera[0, 0], cameras.size
    in_first = torch.rand(9, 3, dtype=torch.float64) * 2 - 1 + torch.tensor([0.0, 0, 3])
    points = in_first @ pose[:3, :3].T + pose[:3, 3]
    seen = project(points.expand(VIEWS, 9, 3), cameras[0])
    centres = cameras.centres[0]
    unit = sum(float((centres[i] - centres[j]).norm()) for i in range(VIEWS) for j in range(i)) / 3
    homogeneous = torch.cat((in_first / unit, torch.ones(9, 1, dtype=torch.float64)), 1)
    projections, _ = normalised_projections(cameras, NEAR)
    x, y, z, one = (projections[0] @ homogeneous.T).unbind(1)
    assert torch.allclose(x / z, seen[..., 0] / size[1] - 0.5, atol=1e-12)
    assert torch.allclose(y / z, seen[..., 1] / size[0] - 0.5, atol=1e-12)
    assert torch.allclose(z * unit, seen[..., 2], atol=1e-12)
    assert torch.equal(one, torch.ones_like(one))


BASE = 128
"""The paper's d."""

BASE_GRID = (4, 6)


def by_matrices(
    q, k, v, cameras: Cameras, *, shifted: bool, cross: bool, output: bool, first=lambda g: g.T
) -> torch.Tensor:
    """Equations 4 and 5 token by token, in 2x2 windows of the map: [views h w d].

    Q' = first(G) Q (the paper: G^T), K' = G^-1 K, V' = G^-1 V, O = sum A V', and with `output` (PRoPE, GTA) G O.
    """
    views, h, w, d = q.shape
    window_size = (h // 2, w // 2)
    shift = (window_size[0] // 2, window_size[1] // 2) if shifted else (0, 0)
    projections, _ = normalised_projections(cameras, NEAR)
    tokens = [(i, r, c) for i in range(views) for r in range(h) for c in range(w)]
    g = {t: written_out(projections[0, t[0]], t[1], t[2], d) for t in tokens}
    inverse = {t: torch.linalg.inv(g[t]) for t in tokens}

    def together(t: tuple[int, int, int], u: tuple[int, int, int]) -> bool:
        """Whether both lie in one window after the roll, and did not come there from opposite edges."""
        for axis in (0, 1):
            a, b, s, side = t[axis + 1], u[axis + 1], shift[axis], (h, w)[axis]
            if (a - s) % side // window_size[axis] != (b - s) % side // window_size[axis] or (a < s) != (b < s):
                return False
        return True

    out = torch.zeros_like(q)
    for t in tokens:
        attended = [u for u in tokens if (u[0] != t[0]) == cross and together(t, u)]
        query = first(g[t]) @ q[t]
        logits = torch.stack([query @ (inverse[u] @ k[u]) for u in attended]) / d**0.5
        message = sum(a * (inverse[u] @ v[u]) for a, u in zip(logits.softmax(0), attended, strict=True))
        out[t] = g[t] @ message if output else message
    return out


def layer() -> WindowAttention:
    """An attention layer of the paper's width whose message is the bare attention output."""
    attention = WindowAttention(BASE).double()
    torch.manual_seed(3)
    for linear in (attention.q_proj, attention.k_proj, attention.v_proj):
        nn.init.normal_(linear.weight, std=BASE**-0.5)
    attention.merge = attention.norm1 = nn.Identity()
    return attention


@pytest.mark.parametrize("output", [True, False], ids=["published", "text"])
@pytest.mark.parametrize(("shifted", "cross"), [(False, False), (True, False), (False, True), (True, True)])
def test_the_layer_is_attention_with_128x128_matrices_written_out(cameras, shifted, cross, output):
    attention = layer()
    x = torch.randn(1, VIEWS, *BASE_GRID, BASE, dtype=torch.float64)
    transforms = token_transforms(cameras, NEAR, BASE_GRID, BASE, x, output)
    windows = Windows(BASE_GRID, 2, shifted)
    with torch.inference_mode():
        fast = (attention(x, x, windows, transforms, cross) - x)[0]
        projected = [linear(x)[0] for linear in (attention.q_proj, attention.k_proj, attention.v_proj)]
        form = {"shifted": shifted, "cross": cross, "output": output}
        expected = by_matrices(*projected, cameras, **form)
        swapped = by_matrices(*projected, cameras, **form, first=torch.linalg.inv)
    assert (fast - expected).abs().max() < 1e-10
    assert (fast - swapped).abs().max() > 1e-2  # G^-1 in the place of G^T


def test_the_text_s_form_is_not_the_published_one(cameras):
    assert (attention(cameras, True) - attention(cameras, False)).abs().max() > 1e-2


def attention(cameras: Cameras, output: bool) -> torch.Tensor:
    generator = torch.Generator().manual_seed(3)
    q, k, v = (torch.randn(1, VIEWS, *GRID, D, generator=generator, dtype=torch.float64) for _ in range(3))
    transforms = token_transforms(cameras, NEAR, GRID, D, q, output)
    windows = Windows(GRID, 2, True)
    return transforms.outputs(windows.attend(transforms.queries(q), transforms.keys(k), transforms.keys(v), True))


def test_logits_and_messages_know_only_relative_matrices(cameras):
    """q^T G_t G_u^-1 k and G_t G_u^-1 v, PRoPE's reading of its own equations."""
    generator = torch.Generator().manual_seed(3)
    q, k, v = (torch.randn(1, VIEWS, *GRID, D, generator=generator, dtype=torch.float64) for _ in range(3))
    projections, _ = normalised_projections(cameras, NEAR)
    tokens = [(i, r, c) for i in range(VIEWS) for r in range(GRID[0]) for c in range(GRID[1])]
    g = {t: written_out(projections[0, t[0]], t[1], t[2]) for t in tokens}
    expected = torch.zeros_like(q)
    for t in tokens:
        others = [u for u in tokens if u[0] != t[0]]
        relative = [g[t] @ torch.linalg.inv(g[u]) for u in others]
        logits = torch.stack([q[0][t] @ m @ k[0][u] for m, u in zip(relative, others, strict=True)]) / D**0.5
        weights = logits.softmax(0)
        expected[0][t] = sum(w * (m @ v[0][u]) for w, m, u in zip(weights, relative, others, strict=True))
    transforms = token_transforms(cameras, NEAR, GRID, D, q)
    windows = Windows(GRID, 1, False)
    result = transforms.outputs(windows.attend(transforms.queries(q), transforms.keys(k), transforms.keys(v), True))
    assert (result - expected).abs().max() < 1e-10


def test_columns_turn_the_third_quarter_of_the_channels_and_rows_the_fourth(cameras):
    """Positions are those in the whole map, not in a window, nor after the roll."""
    x = torch.ones(1, VIEWS, *GRID, D, dtype=torch.float64)
    turned = token_transforms(cameras, NEAR, GRID, D, x).queries(x)[0, 0]
    by_column, by_row = turned[..., D // 2 : 3 * D // 4], turned[..., 3 * D // 4 :]
    assert torch.equal(by_column[0], by_column[-1])
    assert torch.equal(by_row[:, 0], by_row[:, -1])
    assert len(by_column[0].unique(dim=0)) == GRID[1]
    assert len(by_row[:, 0].unique(dim=0)) == GRID[0]


def moved(cameras: Cameras) -> Cameras:
    motion = torch.eye(4, dtype=torch.float64)
    motion[:3, :3] = torch.tensor([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    motion[:3, 3] = torch.tensor([1000.0, -20, 3])
    return Cameras(motion @ cameras.world_from_camera, cameras.intrinsics, cameras.size)


def test_the_choice_of_world_does_not_matter(cameras):
    assert (attention(cameras, True) - attention(moved(cameras), True)).abs().max() < 1e-9


def test_without_the_output_transform_the_first_camera_is_the_frame(cameras):
    swapped = cameras[:, [1, 0, 2]]
    plain = attention(cameras, False) - attention(swapped, False)
    assert plain.abs().max() > 1e-2


def test_a_camera_that_only_turns_is_valid(cameras):
    still = cameras.world_from_camera.clone()
    still[..., :3, 3] = 0
    there, back = normalised_projections(Cameras(still, cameras.intrinsics, cameras.size), NEAR)
    assert torch.isfinite(there).all()
    assert torch.isfinite(back).all()


def test_channels_must_be_a_multiple_of_eight(cameras):
    with pytest.raises(ValueError, match="12 channels"):
        token_transforms(cameras, NEAR, GRID, 12, torch.zeros(1))

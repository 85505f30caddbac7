import pytest
import torch
from posed import posed_cameras

from semgs.geometry.cameras import Cameras
from semgs.model.camera_attention import normalised_projections, token_transforms
from semgs.model.swin import Windows

D, GRID, VIEWS = 16, (4, 6), 3
NEAR = torch.tensor([0.5], dtype=torch.float64)


@pytest.fixture
def cameras():
    one = posed_cameras(VIEWS, (32, 48))
    return Cameras(one.world_from_camera[None], one.intrinsics[None], one.size)


def written_out(projection: torch.Tensor, row: int, column: int) -> torch.Tensor:
    """G_t as the paper's equation 2 has it: [D D]."""
    frequencies = 100.0 ** (-torch.arange(D // 8, dtype=torch.float64) / (D // 8))

    def rope(position: int) -> torch.Tensor:
        c, s = (position * frequencies).cos().diag(), (position * frequencies).sin().diag()
        return torch.cat((torch.cat((c, -s), 1), torch.cat((s, c), 1)))

    return torch.block_diag(torch.kron(torch.eye(D // 8, dtype=torch.float64), projection), rope(column), rope(row))


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


def attention(cameras: Cameras, output: bool) -> torch.Tensor:
    generator = torch.Generator().manual_seed(3)
    q, k, v = (torch.randn(1, VIEWS, *GRID, D, generator=generator, dtype=torch.float64) for _ in range(3))
    transforms = token_transforms(cameras, NEAR, GRID, D, q, output)
    windows = Windows(GRID, 2, True, q)
    return transforms.outputs(windows.attend(transforms.queries(q), transforms.keys(k), transforms.keys(v), True))


def test_attention_with_the_output_transform_is_the_published_form_written_out(cameras):
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
    windows = Windows(GRID, 1, False, q)
    result = transforms.outputs(windows.attend(transforms.queries(q), transforms.keys(k), transforms.keys(v), True))
    assert (result - expected).abs().max() < 1e-10


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

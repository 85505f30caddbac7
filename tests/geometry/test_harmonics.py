"""Spherical harmonics: the constants of 3DGS, orthonormal functions, colour of a constant."""

from __future__ import annotations

import pytest
import torch

from semgs.geometry.harmonics import basis, colours_from_harmonics


def _directions(count: int, seed: int = 0) -> torch.Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.nn.functional.normalize(torch.randn(count, 3, generator=generator, dtype=torch.float64), dim=-1)


def test_the_basis_has_the_constants_and_signs_of_3dgs() -> None:
    d = _directions(50)
    x, y, z = d.unbind(-1)
    expected = torch.stack(
        (
            torch.full_like(x, 0.28209479177387814),
            -0.4886025119029199 * y,
            0.4886025119029199 * z,
            -0.4886025119029199 * x,
            1.0925484305920792 * x * y,
            -1.0925484305920792 * y * z,
            0.31539156525252005 * (2 * z * z - x * x - y * y),
            -1.0925484305920792 * x * z,
            0.5462742152960396 * (x * x - y * y),
            -0.5900435899266435 * y * (3 * x * x - y * y),
            2.890611442640554 * x * y * z,
            -0.4570457994644658 * y * (4 * z * z - x * x - y * y),
            0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y),
            -0.4570457994644658 * x * (4 * z * z - x * x - y * y),
            1.445305721320277 * z * (x * x - y * y),
            -0.5900435899266435 * x * (x * x - 3 * y * y),
        ),
        dim=-1,
    )
    torch.testing.assert_close(basis(d, 3), expected, rtol=0, atol=1e-14)


def test_the_basis_is_orthonormal_on_the_sphere() -> None:
    # Exact for polynomials of degree 6: Gauss-Legendre in z, equal steps around it.
    nodes = torch.tensor([-0.9324695142031521, -0.6612093864662645, -0.2386191860831969], dtype=torch.float64)
    weights = torch.tensor([0.1713244923791704, 0.3607615730481386, 0.4679139345726910], dtype=torch.float64)
    z, w = torch.cat((nodes, -nodes)), torch.cat((weights, weights))
    angle = torch.arange(12, dtype=torch.float64) * torch.pi / 6
    radius = (1 - z * z).sqrt()[:, None]
    points = torch.stack((radius * angle.cos(), radius * angle.sin(), z[:, None].expand(-1, 12)), dim=-1)
    values = basis(points, 3)
    gram = torch.einsum("z,zak,zal->kl", w * torch.pi / 6, values, values)
    torch.testing.assert_close(gram, torch.eye(16, dtype=torch.float64), rtol=0, atol=1e-12)


def test_a_constant_harmonic_is_the_same_colour_from_every_side() -> None:
    harmonics = torch.zeros(7, 9, 3, dtype=torch.float64)
    harmonics[:, 0] = torch.tensor([1.0, -0.5, 0.0]) / 0.28209479177387814
    colours = colours_from_harmonics(harmonics, _directions(7))
    expected = torch.tensor([1.5, 0.0, 0.5], dtype=torch.float64).expand(7, 3)
    torch.testing.assert_close(colours, expected)


def test_colour_never_goes_below_zero_but_may_exceed_one() -> None:
    harmonics = torch.tensor([[[-9.0, 9.0, 0.0]]])
    red, green, _ = colours_from_harmonics(harmonics, torch.tensor([[0.0, 0.6, 0.8]]))[0]
    assert red == 0
    assert green > 1


@pytest.mark.parametrize("count", [1, 4, 9, 16])
def test_leading_axes_are_free_for_each_degree(count: int) -> None:
    harmonics = torch.randn(2, 5, count, 3, generator=torch.Generator().manual_seed(count), dtype=torch.float64)
    directions = _directions(10).reshape(2, 5, 3)
    colours = colours_from_harmonics(harmonics, directions)
    torch.testing.assert_close(colours[1, 3], colours_from_harmonics(harmonics[1, 3], directions[1, 3]))


@pytest.mark.parametrize("count", [2, 25])
def test_other_numbers_of_harmonics_are_refused(count: int) -> None:
    with pytest.raises(ValueError, match="k = 1, 4, 9 or 16"):
        colours_from_harmonics(torch.zeros(3, count, 3), torch.zeros(3, 3))


def test_a_degree_beyond_the_format_is_refused() -> None:
    with pytest.raises(ValueError, match="degree is 4"):
        basis(torch.zeros(3), 4)

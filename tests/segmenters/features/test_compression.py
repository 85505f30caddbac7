"""Compression of features: what is kept, which way is taken, and that zero stays zero."""

from __future__ import annotations

import pytest
import torch

from semgs.segmenters.features.compression import (
    ENTRIES,
    MOST_NUMBERS,
    Compression,
    compression_of,
    k_means,
    lost,
    principal_directions,
)

GENERATOR = torch.Generator().manual_seed(0)


def unit(*shape: int) -> torch.Tensor:
    return torch.nn.functional.normalize(torch.randn(*shape, generator=GENERATOR), dim=-1)


def again(compression: Compression, features: torch.Tensor) -> torch.Tensor:
    """Features after compression."""
    return compression.features(compression.decoded(compression.codes(compression.coordinates(features))))


def test_features_of_few_directions_are_kept_by_components():
    features = torch.nn.functional.normalize(unit(500, 30) @ unit(30, 200), dim=1)
    found = compression_of(features)
    assert found.book is None
    assert found.basis.shape == (200, 30)
    torch.testing.assert_close(again(found, features), features, rtol=0, atol=1e-5)


def test_segments_of_more_directions_than_components_are_kept_by_a_book():
    """Forty directions at right angles, equally often: 32 components keep 32 of 40 parts of the energy, a book all."""
    features = torch.eye(64)[:40].repeat(10, 1)
    components = Compression(principal_directions(features, MOST_NUMBERS))
    assert lost(components, features) == pytest.approx(0.2 * 400, rel=1e-5)
    found = compression_of(features)
    assert found.book is not None
    assert found.book.shape == (41, 40)
    assert found.codes(found.coordinates(features)).dtype == torch.uint8
    torch.testing.assert_close(again(found, features), features, rtol=0, atol=1e-5)


def test_more_directions_than_a_book_has_are_kept_by_components():
    features = torch.nn.functional.normalize(unit(3000, 40) * torch.arange(40, 0, -1) ** 2 @ unit(40, 64), dim=1)
    found = compression_of(features)
    assert found.book is None
    assert found.basis.shape == (64, MOST_NUMBERS)
    assert lost(found, features) < 0.01 * 3000


@pytest.mark.parametrize("samples", [300, 50])
def test_directions_are_those_of_a_singular_value_decomposition(samples: int):
    """Whichever of the two matrices is the smaller one; compared by the projections that they make, as signs are free."""
    features = unit(samples, 90) * torch.linspace(2, 0.1, 90)
    found = principal_directions(features, 7)
    _, _, right = torch.linalg.svd(features.double(), full_matrices=False)
    expected = right[:7].mT.float()
    torch.testing.assert_close(found.mT @ found, torch.eye(7), rtol=0, atol=1e-5)
    torch.testing.assert_close(found @ found.mT, expected @ expected.mT, rtol=0, atol=1e-4)


def test_zero_stays_zero_and_a_book_goes_by_direction():
    """The entry nearest to (0.5, 0, 0.05) by distance would be zero; by direction it is the first axis."""
    book = Compression(torch.eye(3), torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]))
    given = torch.tensor([[0.0, 0, 0], [0.4, 0, 0.05], [0.05, 0.06, 0], [0.3, 0.35, 0]])
    assert book.codes(book.coordinates(given)).tolist() == [0, 1, 0, 2]
    assert (again(Compression(unit(4, 4)[:, :2]), torch.zeros(3, 4)) == 0).all()


@pytest.mark.parametrize("with_book", [False, True])
def test_cosines_are_those_of_the_features_that_are_never_computed(with_book: bool):
    basis = torch.linalg.qr(unit(20, 5)).Q
    compression = Compression(basis, torch.cat((torch.zeros(1, 5), unit(9, 5))) if with_book else None)
    coordinates = compression.decoded(compression.codes(0.6 * unit(30, 5)))
    embedding = 3 * unit(20)
    expected = torch.nn.functional.cosine_similarity(compression.features(coordinates), embedding[None], dim=1)
    torch.testing.assert_close(compression.cosine(coordinates, embedding), expected, rtol=0, atol=1e-6)


def test_a_feature_shorter_than_a_tenth_is_like_nothing():
    compression = Compression(torch.eye(2))
    found = compression.cosine(torch.tensor([[0.09, 0.0], [0.11, 0.0], [torch.nan, torch.nan]]), torch.tensor([1.0, 0]))
    assert found.isnan().tolist() == [True, False, True]
    assert found[1] == 1


def test_k_means_finds_groups_and_never_more_entries_than_allowed():
    centres = 10 * torch.eye(6)
    points = (centres[:, None] + 0.1 * torch.randn(6, 50, 6, generator=GENERATOR)).flatten(0, 1)
    found = k_means(points, 6)
    order = torch.cdist(centres, found).argmin(1)
    assert sorted(order.tolist()) == list(range(6))
    torch.testing.assert_close(found[order], points.view(6, 50, 6).mean(1), rtol=0, atol=1e-5)
    assert torch.equal(k_means(points, 6), found)
    assert len(k_means(points[:1].repeat(9, 1), 4)) == 1
    assert len(k_means(unit(2000, 8), ENTRIES - 1)) == 255

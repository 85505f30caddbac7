"""Compression: features of hundreds of numbers become at most 32 numbers, or the entry of a book, and back.

Features are compared by their cosine, so they are of length 1, or zero if there is none. A feature is `basis @ z` with orthonormal columns
of `basis`, up to an error; zero stays zero. By principal components z are at most 32 numbers of its own; with a book z is one of 256
entries. The one that keeps more is taken: components for features that vary smoothly, a book for features that are equal over segments.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import torch
from jaxtyping import Float, Shaped
from torch import Tensor

MOST_NUMBERS = 32
"""Numbers of a feature by principal components."""

ENTRIES = 256
"""Entries of a book, at most; also its largest number of dimensions. The first one is zero."""

ROUNDS = 10
"""Rounds of k-means."""

FLAT = 1e-10
"""Components with less than this share of the largest one's energy are rounding errors, and points that are so close are one."""

SHORTEST = 0.1
"""A feature that is shorter than this, as where features in all directions are mixed, says nothing."""


@final
@dataclass(frozen=True)
class Compression:
    """How features are compressed.

    Attributes:
        basis: orthonormal directions.
        book: entries, the first one zero and the others about of length 1; None if each feature has its own numbers.
    """

    basis: Float[Tensor, "n k"]
    book: Float[Tensor, "entry k"] | None = None

    def coordinates(self, features: Float[Tensor, "*any n"]) -> Float[Tensor, "*any k"]:
        """The features in the basis, before a book."""
        return features @ self.basis

    def codes(self, coordinates: Float[Tensor, "any k"]) -> Shaped[Tensor, "any ..."]:
        """What is stored of each feature: its coordinates [any k], or the number of the entry in about its direction [any], uint8."""
        if self.book is None:
            return coordinates
        length = coordinates.norm(dim=1, keepdim=True)
        nearest = 1 + nearest_entry(coordinates / length.clamp(min=SHORTEST), self.book[1:])
        return torch.where(length[:, 0] < SHORTEST, 0, nearest).to(torch.uint8)

    def decoded(self, codes: Shaped[Tensor, "any ..."]) -> Float[Tensor, "any k"]:
        """The coordinates that codes stand for."""
        return codes if self.book is None else self.book[codes.long()]

    def features(self, coordinates: Float[Tensor, "*any k"]) -> Float[Tensor, "*any n"]:
        """The features at coordinates."""
        return coordinates @ self.basis.mT

    def cosine(self, coordinates: Float[Tensor, "*any k"], embedding: Float[Tensor, " n"]) -> Float[Tensor, "*any"]:
        """The cosine of the features at coordinates with an embedding, without computing them; NaN for those shorter than `SHORTEST`.

        Args:
            coordinates: of the features.
            embedding: not zero.
        """
        length = coordinates.norm(dim=-1)
        along = coordinates @ ((embedding / embedding.norm()) @ self.basis)
        return torch.where(length < SHORTEST, torch.nan, along / length.clamp(min=SHORTEST)).clamp(-1, 1)


def compression_of(features: Float[Tensor, "sample n"]) -> Compression:
    """The compression that keeps most of some features of length 1."""
    basis = principal_directions(features, ENTRIES)
    components = Compression(basis[:, :MOST_NUMBERS])
    if basis.shape[1] <= MOST_NUMBERS:
        return components
    entries = k_means(features @ basis, ENTRIES - 1)
    book = Compression(basis, torch.cat((torch.zeros_like(entries[:1]), entries)))
    return min((components, book), key=lambda one: lost(one, features))


def lost(compression: Compression, features: Float[Tensor, "some n"]) -> float:
    """The energy of the features that is lost: the sum of the squared errors."""
    coordinates = compression.decoded(compression.codes(compression.coordinates(features)))
    return float((features - compression.features(coordinates)).square().sum(dtype=torch.float64))


def principal_directions(features: Float[Tensor, "sample n"], most: int) -> Float[Tensor, "n k"]:
    """The orthonormal directions of the largest energy, at most so many."""
    samples, numbers = features.shape
    exact = features.double()
    if samples < numbers:  # the smaller of the two matrices has the same eigenvalues
        values, vectors = torch.linalg.eigh(exact @ exact.mT)
        vectors = torch.nn.functional.normalize(exact.mT @ vectors, dim=0)
    else:
        values, vectors = torch.linalg.eigh(exact.mT @ exact)
    count = min(most, int((values > FLAT * values[-1]).sum()))
    return vectors.flip(1)[:, :count].to(features)


def k_means(points: Float[Tensor, "any k"], most: int) -> Float[Tensor, "entry k"]:
    """The centres of k-means, at most so many. It starts with points that are far from one another, so the result is always the same."""
    chosen = [points[0]]
    away = (points - chosen[0]).square().sum(-1)
    while len(chosen) < most and away.max() > FLAT:
        chosen.append(points[away.argmax()])
        away = torch.minimum(away, (points - chosen[-1]).square().sum(-1))
    centres = torch.stack(chosen)
    for _ in range(ROUNDS):
        nearest = nearest_entry(points, centres)
        counts = torch.bincount(nearest, minlength=len(centres))[:, None]
        sums = torch.zeros_like(centres).index_add_(0, nearest, points)
        centres = torch.where(counts > 0, sums / counts.clamp(min=1), centres)
    return centres


def nearest_entry(points: Float[Tensor, "any k"], entries: Float[Tensor, "entry k"]) -> Shaped[Tensor, " any"]:
    """The number of the entry that is nearest to each point; the first of several."""
    squares = entries.square().sum(-1)
    return torch.cat([(squares - 2 * part @ entries.mT).argmin(-1) for part in points.split(1 << 16)])

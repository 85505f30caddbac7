"""Exposure: a camera on automatic gives the same surface other colours in other photos. Here they come to a common exposure.

Where two photos see the same surface, by its depth, their colours should agree after a gain and an offset of each photo, for each channel. There, the ratio
of two gains is that of the standard deviations of the colours, and the difference of two offsets follows from the means. The gains (their logs) and then
the offsets of all photos are the least-squares solution for these, weighted by the pixels in common. A regression of one photo on the other would find too
small gains, because depth and poses match pixels only roughly; the ratio of standard deviations favours neither photo.

Only ratios of gains can be known: the logs of the gains, and the offsets, of photos that share surfaces have a mean of 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras, back_project
from semgs.geometry.fusion import see_again
from semgs.geometry.harmonics import basis
from semgs.scene.encoding import Encoding
from semgs.scene.overlap import inside

ExposureChoice = Literal["auto", "fitted", "as-taken"]
"""Whether photos come to a common exposure: if they differ in exposure, always, or never."""

STEP = 2
"""Every second pixel of every second row is compared."""

SATURATED = 0.98
"""A pixel with a brighter channel is not compared, because it does not say how much light there was."""

FLATTEST = 0.01
"""A smaller standard deviation is noise, and says nothing about gains."""

FEWEST = 100
"""Photos that share fewer pixels are not compared."""

PARTNERS = 8
"""Each photo is compared with the next one, and with so many others that see the most of it: of a walk, not with all others."""

THIN = 16
"""Every so many pixels of every so many rows tell how much of a photo another one sees."""

SHOWN = 0.5
"""A pixel that is rendered less opaque shows nothing."""

UNEXPLAINED = 2 / 3
"""Photos differ in exposure if no more than this share of their mean squared difference remains at the common one."""

MEANS_DIFFER = 0.02
"""Of three or more photos, a larger difference of the mean colours of what two of them share decides instead (0..1, root mean square)."""


@dataclass(frozen=True)
class Exposures:
    """By how much the exposures of photos differ: gain * colour + offset is a colour at the common exposure.

    Attributes:
        gains, offsets: of each photo and channel.
        before, after: mean squared difference of the photos where they see the same surface, as taken and at the common exposure; 0 if they share nothing.
        means_before, means_after: the same of the mean colours of what each two photos share. Unlike pixels, these hardly depend on depth.
    """

    gains: Float[Tensor, "v 3"]
    offsets: Float[Tensor, "v 3"]
    before: float
    after: float
    means_before: float = 0.0
    means_after: float = 0.0

    @property
    def compared(self) -> tuple[float, float]:
        """The squared differences that count, before and after: of mean colours if these differ and there are three photos or more, else of pixels."""
        by_means = len(self.gains) > 2 and self.means_before > MEANS_DIFFER**2  # offsets make those of two photos equal
        return (self.means_before, self.means_after) if by_means else (self.before, self.after)

    @property
    def differ(self) -> bool:
        """Whether the common exposure explains enough of the difference of the photos to be worth it."""
        before, after = self.compared
        return after < UNEXPLAINED * before

    def applied(self, views: Views) -> Views:
        """The photos at the common exposure."""
        gains, offsets = (numbers.to(views.images)[..., None, None] for numbers in (self.gains, self.offsets))
        return views.changed(images=(gains * views.images + offsets).clamp(0, 1))

    def recoloured(self, encoding: Encoding) -> Encoding:
        """The Gaussians of these photos with their colours at the common exposure."""
        colour = encoding.gaussians.colour
        own = encoding.own_views.to(colour.features.device)
        gains, offsets = (numbers.to(colour.features)[own] for numbers in (self.gains, self.offsets))
        features = gains[:, None] * colour.features
        # A colour is 0.5 plus the harmonics, of which the first is constant.
        features[:, 0] += (0.5 * (gains - 1) + offsets) / basis(features.new_zeros(3), 0)
        return replace(encoding, gaussians=replace(encoding.gaussians, colour=replace(colour, features=features)))


@dataclass(frozen=True)
class _Pair:
    """The pixels of two photos that see the same surfaces: how many, and mean, standard deviation and covariance of their colours."""

    pixels: int
    mean: Float64[Tensor, "2 3"]
    deviation: Float64[Tensor, "2 3"]
    covariance: Float64[Tensor, " 3"]

    def difference(self, gains: Float64[Tensor, "2 3"], offsets: Float64[Tensor, "2 3"]) -> float:
        """The sum of the squared differences over the pixels, a mean over the channels, after gains and offsets."""
        one, other = gains * self.mean + offsets
        varied = (gains * self.deviation).square().sum(0) - 2 * gains.prod(0) * self.covariance
        return self.pixels * float(((one - other).square() + varied).mean())


def fit_exposures(views: Views, depths: Float[Tensor, "v h w"], spread: Float[Tensor, "v h w"]) -> Exposures:
    """The exposures of the photos of a scene.

    Args:
        views: the photos.
        depths: z-depth of every pixel [m].
        spread: standard deviation of the log depth of every pixel.
    """
    points = back_project(depths, views.cameras)
    known = (views.images < SATURATED).all(1)
    known = known if views.hidden is None else known & ~views.hidden

    def compare(one: int, other: int) -> _Pair | None:
        """A pair of photos; None if they share too little."""
        coarse = (..., slice(None, None, STEP), slice(None, None, STEP))
        of_one = (points[one][::STEP, ::STEP].flatten(0, 1), spread[one][coarse].flatten())
        agrees, place = see_again(*of_one, depths[other], spread[other], views.cameras[other])
        agrees = agrees & known[one][coarse].flatten() & known[other].flatten()[place]
        if (pixels := int(agrees.sum())) < FEWEST:
            return None
        here, there = views.images[one][coarse].flatten(1)[:, agrees], views.images[other].flatten(1)[:, place[agrees]]
        colours = torch.stack((here, there)).double()
        mean = colours.mean(-1)
        apart = colours - mean[..., None]
        return _Pair(pixels, mean, apart.square().mean(-1).sqrt(), apart.prod(0).mean(-1))

    found = {members: pair for members in _partners(points, views.cameras) if (pair := compare(*members))}
    gains, offsets = torch.ones(len(views), 3, dtype=torch.float64), torch.zeros(len(views), 3, dtype=torch.float64)
    if not found:
        return Exposures(gains.float(), offsets.float(), 0.0, 0.0)
    members = torch.tensor(list(found))
    pixels = torch.tensor([pair.pixels for pair in found.values()], dtype=torch.float64)[:, None]
    means, deviations = (
        torch.stack([getattr(pair, name) for pair in found.values()]) for name in ("mean", "deviation")
    )
    varied = (deviations >= FLATTEST).all(1)
    ratios = torch.where(varied, (deviations[:, 1] / deviations[:, 0].clamp(min=FLATTEST)), 1).log()
    before = sum(pair.difference(gains[:2], offsets[:2]) for pair in found.values())
    gains = _solve(members, ratios, pixels * varied, len(views)).exp()
    seen = gains[members] * means
    offsets = _solve(members, seen[:, 1] - seen[:, 0], pixels.expand_as(ratios), len(views))
    after = sum(pair.difference(gains[list(both)], offsets[list(both)]) for both, pair in found.items())
    total = float(pixels.sum())
    at_common = gains[members] * means + offsets[members]
    apart = [float((pixels * (one[:, 0] - one[:, 1]).square()).mean(1).sum()) for one in (means, at_common)]
    return Exposures(gains.float(), offsets.float(), *(one / total for one in (before, after, *apart)))


def common_exposure(views: Views, encoding: Encoding, choice: ExposureChoice) -> Exposures | None:
    """The exposures of photos that come to a common one; None if they stay as taken.

    Args:
        views: the photos.
        encoding: their Gaussians.
        choice: whether they come to it.
    """
    if choice == "as-taken":
        return None
    exposures = fit_exposures(views, encoding.depths, encoding.depth_spread)
    return exposures if exposures.differ or choice == "fitted" else None


def exposure_as_rendered(views: Views, images: Float[Tensor, "v 3 h w"], alphas: Float[Tensor, "v h w"]) -> Views:
    """Held-out photos at the exposure of their renderings: each channel with the same mean and standard deviation, where something is rendered.

    Args:
        views: the photos [v].
        images, alphas: their renderings, and how opaque these are.
    """
    found = views.images.clone()
    for view, (photo, image) in enumerate(zip(views.images, images.to(found), strict=True)):
        shown = (alphas[view].to(photo) > SHOWN) & (photo < SATURATED).all(0)
        shown = shown if views.hidden is None else shown & ~views.hidden[view]
        if int(shown.sum()) < FEWEST:
            continue
        (own, own_mean), (drawn, drawn_mean) = (torch.std_mean(one[:, shown], dim=1) for one in (photo, image))
        gains = (drawn / own.clamp(min=FLATTEST))[:, None, None]
        found[view] = (gains * (photo - own_mean[:, None, None]) + drawn_mean[:, None, None]).clamp(0, 1)
    return views.changed(images=found)


def _partners(points: Float[Tensor, "v h w 3"], cameras: Cameras) -> list[tuple[int, int]]:
    """The pairs of photos to compare, as positions of the first and the second; all pairs if the photos are few.

    Args:
        points: that the pixels of each photo show [m].
        cameras: of the photos.
    """
    count = len(points)
    thin = points[:, ::THIN, ::THIN].flatten(0, 2)
    # Camera by camera: all at once, a walk of 300 photos takes 2 GB.
    seen = [inside(thin, cameras[one : one + 1]).reshape(count, -1).double().mean(1) for one in range(count)]
    shares = torch.stack(seen, 1)
    shares = (shares + shares.T).fill_diagonal_(-1)
    best = shares.topk(min(PARTNERS, count - 1)).indices
    pairs = {(one, one + 1) for one in range(count - 1)}
    return sorted(
        pairs
        | {
            (min(pair), max(pair))
            for pair in zip(
                torch.arange(count).repeat_interleave(best.shape[1]).tolist(), best.flatten().tolist(), strict=True
            )
        }
    )


def _solve(
    members: Tensor, differences: Float64[Tensor, "p 3"], weights: Float64[Tensor, "p 3"], count: int
) -> Float64[Tensor, "v 3"]:
    """The numbers of each photo whose differences, first of a pair less second, fit best; the smallest ones of these."""
    signs = torch.zeros(len(members), count, dtype=torch.float64)
    signs.scatter_(1, members, torch.tensor([[1.0, -1.0]], dtype=torch.float64).expand(len(members), 2))
    roots = weights.sqrt().T[..., None]
    return torch.linalg.lstsq(roots * signs, roots * differences.T[..., None], driver="gelsd").solution[..., 0].T

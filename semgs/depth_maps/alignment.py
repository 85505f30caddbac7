"""Aligns depth maps of unknown scale to a scene.

In inverse depth, a map x (its own numbers if they are inverse depths, else their inverse) differs from the truth by a factor and perhaps a constant:
1 / depth = scale x + shift, for each view. One robust fit finds those of all views. Its residuals, of log depth, are those to a reference, weighted by
the spread of the reference, and those between views: a pixel's point, seen by another view, should have the depth of that view's map there. Errors of
neighbouring pixels are alike, in maps more than between views, so the second kind counts little (`SHARED`): it decides where a view has no reference.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import sqrt
from typing import final

import torch
from jaxtyping import Bool, Float, Float64, Int64
from torch import Tensor
from torch.nn.functional import grid_sample

from semgs.depth_maps.depth_fit import SIGMA_PER_MAD, TUKEY
from semgs.depth_maps.depth_source import Meaning
from semgs.geometry.cameras import Cameras, back_project, project

STEP = 6
"""One pixel of so many by so many takes part in the fit; of a sparse reference, all that it knows, up to as many."""

ROUNDS = 12
"""Rounds of weighted least squares."""

SHARED = 0.05
"""Weight of residuals between views, relative to those to the reference."""

SAME_SURFACE = 0.25
"""Views whose log depths differ by more see different surfaces."""

LEAST_SPREAD = 0.01
"""Residuals are not trusted to be smaller than this [log depth]."""

LEAST_INVERSE = 0.01
"""An inverse depth is at least this share of the median one of the reference, however the fit extrapolates."""

OWN_SHARE = 0.1
"""At least this share of the squared residual is the map's own error, however uncertain the reference says it is."""


@dataclass(frozen=True)
class Reference:
    """What maps are aligned to.

    Attributes:
        title: in words.
        depths: of every pixel, 0 where unknown.
        spread: standard deviation of their logarithm.
    """

    title: str
    depths: Float[Tensor, "v h w"]
    spread: Float[Tensor, "v h w"]

    def cpu(self) -> Reference:
        """The same in the memory of the CPU, where maps are aligned."""
        return Reference(self.title, self.depths.cpu(), self.spread.cpu())


@final
@dataclass(frozen=True)
class MapFit:
    """How the map of a view was aligned.

    Attributes:
        known: share of the pixels that have a value, 0..1.
        scale, shift: 1 / depth = scale x + shift.
        residual: robust standard deviation of log depth to the reference; NaN without one in this view.
        disagreement: the same between this view's map and those of other views, per map; NaN if no other view sees the same.
        spread: of log depth: what the map's own error probably is.
    """

    known: float
    scale: float
    shift: float
    residual: float
    disagreement: float
    spread: float


def inverses(maps: Float[Tensor, "*n"], meaning: Meaning) -> Float64[Tensor, "*n"]:
    """The numbers that are linear in inverse depth; NaN where a map knows nothing, as depths that are not positive."""
    values = maps.double()
    if meaning == "inverse":
        return torch.where(values.isfinite(), values, torch.nan)
    return torch.where(values.isfinite() & (values > 0), 1 / values, torch.nan)


def align(
    maps: Float[Tensor, "v h w"], meaning: Meaning, reference: Reference, cameras: Cameras
) -> tuple[Float[Tensor, "v h w"], tuple[MapFit, ...]]:
    """Align maps to a reference and to one another. Returns their depths, 0 where unknown, on the CPU, and each fit.

    Args:
        maps: NaN where unknown.
        meaning: what their numbers are.
        reference: of the same pixels.
        cameras: of the views.

    Raises:
        ValueError: a view has no pixel with a value, or no view has one where the reference is known.
    """
    x, reference = inverses(maps.cpu(), meaning), reference.cpu()
    known = x.isfinite()
    if not known.flatten(1).any(1).all():
        raise ValueError("a map has no value")
    if not (known & (reference.depths > 0)).any():
        raise ValueError("the maps have no value where the depth is known")
    fit = _Fit(x, meaning == "inverse", reference, cameras)
    for _ in range(ROUNDS):
        fit.improve()
    inverse = torch.stack([fit.inverse_depths(view, numbers) for view, numbers in enumerate(x.nan_to_num(0))])
    return torch.where(known, 1 / inverse, 0).to(reference.depths), fit.results()


class _Fit:
    """Scales and shifts of all views, improved round by round.

    Args:
        x: inverse depths up to scale and shift, NaN where unknown.
        shifts: whether there are shifts.
        reference, cameras: as for `align`.
    """

    def __init__(self, x: Float64[Tensor, "v h w"], shifts: bool, reference: Reference, cameras: Cameras) -> None:
        self._x, self._shifts, self._cameras = x, shifts, cameras
        count, height, width = x.shape
        rows, columns = (torch.arange(min(STEP // 2, side - 1), side, STEP) for side in (height, width))
        self._rows, self._columns = (grid.flatten() for grid in torch.meshgrid(rows, columns, indexing="ij"))
        self._few = x[:, self._rows, self._columns]
        places = [self._known_places(x[view].isfinite() & (reference.depths[view] > 0)) for view in range(count)]
        self._at = [x[view].flatten()[place] for view, place in enumerate(places)]
        self._reference = [reference.depths[view].flatten()[place].double() for view, place in enumerate(places)]
        self._spread = [reference.spread[view].flatten()[place].double() for view, place in enumerate(places)]
        self._least = LEAST_INVERSE / float(torch.cat(self._reference).median())
        # Views without a reference start from the median of the others.
        starts = [self._start(view) for view in range(count)]
        usual = torch.tensor([start for start in starts if start is not None], dtype=torch.float64).median(0).values
        lines = torch.stack([usual if one is None else torch.tensor(one, dtype=torch.float64) for one in starts])
        self.scales, self.shifts = lines[:, 0].clone(), lines[:, 1].clone()

    def _known_places(self, known: Bool[Tensor, "h w"]) -> Int64[Tensor, " n"]:
        """The pixels of a view that are compared with the reference, counted row by row: those of the grid that are known, or, if fewer than half of
        all are, as many of those that are, because sparse points are hardly ever on the grid."""
        grid = self._rows * known.shape[1] + self._columns
        every, on_grid = known.flatten().nonzero()[:, 0], grid[known.flatten()[grid]]
        if 2 * len(every) >= known.numel() and len(on_grid):
            return on_grid
        return every[:: max(1, -(-len(every) // len(grid)))]

    def inverse_depths(self, view: int, x: Float64[Tensor, "*n"]) -> Float64[Tensor, "*n"]:
        """The aligned inverse depths of numbers of a view."""
        return (self.scales[view] * x + self.shifts[view]).clamp(min=self._least)

    def improve(self) -> None:
        """One round of weighted least squares over all views."""
        count = len(self._x)
        unknowns = 2 * count if self._shifts else count
        square, side = torch.zeros(unknowns, unknowns, dtype=torch.float64), torch.zeros(unknowns, dtype=torch.float64)
        for slopes, residuals, weights in (*self._to_reference(), *self._between_views()):
            square += slopes.mT @ (slopes * weights[:, None])
            side += slopes.mT @ (residuals * weights)
        ridge = 1e-9 * square.diagonal().mean() * torch.eye(unknowns, dtype=torch.float64)
        step = torch.linalg.solve(square + ridge, -side)
        self.scales += step[:count]
        if self._shifts:
            self.shifts += step[count:]

    def results(self) -> tuple[MapFit, ...]:
        """The fit of each view."""
        apart: list[list[Tensor]] = [[] for _ in self._x]
        for view, errors, _ in self._shared():
            apart[view].append(errors)
        return tuple(self._result(view, torch.cat(errors) if errors else None) for view, errors in enumerate(apart))

    def _result(self, view: int, apart: Float64[Tensor, " n"] | None) -> MapFit:
        """The fit of a view, whose log depths are so far from those of other views."""
        variances = [LEAST_SPREAD**2]
        residual = disagreement = torch.nan
        if len(self._at[view]):
            residual = SIGMA_PER_MAD * float(self._errors(view).abs().median())
            others = float(self._spread[view].square().median())
            variances.append(max(residual**2 - others, OWN_SHARE * residual**2))
        if apart is not None and len(apart):
            disagreement = SIGMA_PER_MAD * float(apart.abs().median()) / sqrt(2)
            variances.append(disagreement**2)
        known, scale, shift = self._x[view].isfinite().double().mean(), self.scales[view], self.shifts[view]
        return MapFit(float(known), float(scale), float(shift), residual, disagreement, sqrt(max(variances)))

    def _start(self, view: int) -> tuple[float, float] | None:
        """Scale and shift of a view by itself, by robust least squares of inverse depth; None without a reference."""
        x, y = self._at[view], 1 / self._reference[view]
        if not len(x):
            return None
        if not self._shifts:
            return float((y / x).median()), 0.0
        columns, weights = torch.stack((x, torch.ones_like(x)), -1), torch.ones_like(x)
        for _ in range(ROUNDS):
            roots = weights.sqrt()
            line = torch.linalg.lstsq(columns * roots[:, None], y * roots, driver="gelsd").solution
            errors = columns @ line - y
            sigma = SIGMA_PER_MAD * float(errors.abs().median()) + 1e-9 * float(y.median())
            weights = (1 - (errors / (TUKEY * sigma)).square()).clamp(min=0).square()
        return float(line[0]), float(line[1])

    def _errors(self, view: int) -> Float64[Tensor, " n"]:
        """Log of the reference over the aligned depth, where the reference is known."""
        return (self.inverse_depths(view, self._at[view]) * self._reference[view]).log()

    def _slopes(self, view: int, x: Float64[Tensor, " n"]) -> Float64[Tensor, "n unknowns"]:
        """How the log of the inverse depth of pixels changes with each unknown."""
        count = len(self._x)
        inverse = self.inverse_depths(view, x)
        slopes = torch.zeros(len(x), 2 * count if self._shifts else count, dtype=torch.float64)
        slopes[:, view] = x / inverse
        if self._shifts:
            slopes[:, count + view] = 1 / inverse
        return slopes

    def _to_reference(self) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
        """Slopes, residuals and weights of each view's pixels against the reference."""
        for view in range(len(self._x)):
            if not len(self._at[view]):
                continue
            errors = self._errors(view)
            sigma = SIGMA_PER_MAD * errors.abs().median() + LEAST_SPREAD
            weights = 1 / (1 + (errors / sigma).square()) / (sigma.square() + self._spread[view].square())
            yield self._slopes(view, self._at[view]), errors, weights

    def _between_views(self) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
        """Slopes, residuals and weights of pixels against the maps of other views."""
        for _, errors, slopes in self._shared():
            if len(errors):
                sigma = SIGMA_PER_MAD * errors.abs().median() + LEAST_SPREAD
                yield slopes, errors, SHARED / (1 + (errors / sigma).square()) / sigma.square()

    def _shared(self) -> Iterator[tuple[int, Tensor, Tensor]]:
        """For each ordered pair of views: the first, and of the surface that they share the log ratio of depths in the second, with its slopes."""
        height, width = self._x.shape[1:]
        known = self._x.isfinite()
        for own in range(len(self._x)):
            depths = torch.zeros(height, width, dtype=torch.float64)
            depths[self._rows, self._columns] = 1 / self.inverse_depths(own, self._few[own].nan_to_num(0))
            points = back_project(depths, self._cameras[own])[self._rows, self._columns]
            for other in range(len(self._x)):
                if other == own:
                    continue
                column, row, z = project(points, self._cameras[other]).unbind(-1)
                inside = (
                    self._few[own].isfinite() & (z > 0) & (column > 0) & (column < width) & (row > 0) & (row < height)
                )
                column, row, z = column[inside], row[inside], z[inside]
                there = torch.stack((2 * column / width - 1, 2 * row / height - 1), -1)[None, None]
                planes = torch.stack((self._x[other].nan_to_num(0), known[other].double()))[None]
                x, certain = grid_sample(planes, there, align_corners=False, padding_mode="border")[0, :, 0]
                errors = z.log() + self.inverse_depths(other, x).log()
                same = (certain > 0.99) & (errors.abs() < SAME_SURFACE)
                # z is linear in the depth of the first view, beside a constant that is the same for all pixels.
                forward = self._cameras[other].world_from_camera[:3, 2].double()
                offset = (self._cameras[own].centres - self._cameras[other].centres).double() @ forward
                mine = self._slopes(own, self._few[own][inside]) * (1 - offset / z)[:, None]
                yield own, errors[same], (self._slopes(other, x) - mine)[same]

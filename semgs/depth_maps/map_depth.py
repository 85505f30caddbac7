"""Depth maps from elsewhere as one more measurement: aligned to the scene, and weighed with the plane sweep by what each probably errs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import ClassVar, Literal, final

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.data.resampling import Fit
from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.depth_maps.alignment import MapFit, Reference, align
from semgs.depth_maps.depth_fit import ALIKE, POOR
from semgs.depth_maps.depth_source import DepthMaps, Meaning
from semgs.depth_maps.sensor_depth import FEWEST_MEASURED, metre_of, sensor_spread
from semgs.files.errors import InputError
from semgs.files.text import percent
from semgs.geometry.cameras import project
from semgs.runtime.notes import Kind, Note
from semgs.scene.encoding import Encoding

MAPS_DO_NOT_FIT = Kind(
    "The depth maps of these frames do not fit {reference}, so their depth is the model's alone (typical difference): {frames}."
)

FEWEST_POINTS = 100
"""Sparse points are the reference if each view sees at least so many."""

POINT_SPREAD = 0.02
"""Standard deviation of log depth of sparse points."""

CLEARLY_BETTER = 0.5
"""Maps mean something else than said if their residual is then less than this share of what it is now."""


@final
@dataclass(frozen=True)
class MapPlacement:
    """How Gaussians were placed with the help of depth maps.

    Attributes:
        title: where the maps are from.
        meaning: what their numbers are.
        reference: what they were aligned to, in words.
        fits: of the maps, one for each view.
    """

    source: ClassVar[Literal["maps"]] = "maps"
    shift: ClassVar[None] = None
    title: str
    meaning: Meaning
    reference: str
    fits: tuple[MapFit, ...]

    @property
    def description(self) -> str:
        """Where the depth is from, in words."""
        return f"the model and the maps of {self.title}, aligned to {self.reference}"

    def lines(self, names: Sequence[str]) -> tuple[str, ...]:
        """Each fit as text; names are those of the frames."""
        return tuple(
            f"{name}: {percent(fit.known)} known; {self._formula(fit)}, typical difference {percent(fit.residual)}, counted as "
            f"{percent(fit.spread)} uncertain"
            for name, fit in zip(names, self.fits, strict=True)
        )

    def _formula(self, fit: MapFit) -> str:
        """How depth follows from a map."""
        if self.meaning == "inverse":
            return f"1 / depth = {fit.scale:.4g} map {fit.shift:+.3g}"
        return f"depth = {1 / fit.scale if fit.scale else math.inf:.4g} map"

    def notes(self, names: Sequence[str]) -> tuple[Note, ...]:
        """What the user should know."""
        poor = [
            f"{name} ({percent(fit.residual)})" for name, fit in zip(names, self.fits, strict=True) if not fits(fit)
        ]
        if not poor:
            return ()
        return (MAPS_DO_NOT_FIT(reference=self.reference, frames=", ".join(poor)),)


def fits(fit: MapFit) -> bool:
    """Whether a map shows the same scene. One that shares nothing with the reference and other views has a scale of theirs, which nothing confirms."""
    compared = not (math.isnan(fit.residual) and math.isnan(fit.disagreement))
    return compared and fit.scale > 0 and not fit.residual > POOR


def read_maps(
    maps: DepthMaps, scene: Scene, positions: Sequence[int], size: tuple[int, int], fit: Fit = "crop"
) -> Float[Tensor, "v h w"]:
    """The maps of frames of a scene, NaN where unknown; size and fit are as for `Scene.read`.

    Raises:
        InputError: as `DepthMaps.of`, or a map knows nothing.
    """
    read = []
    for position in positions:
        frame = scene.frames[position]
        read.append(maps.of(frame, size, fit))
        if not read[-1].isfinite().any():
            raise InputError(maps.title, f"a depth somewhere in the map of {frame.name}", "none")
    return torch.stack(read)


def find_reference(
    encoding: Encoding, scene: Scene, positions: Sequence[int], views: Views, *, independent: bool = True
) -> Reference:
    """What maps of frames are aligned to: the depth that a sensor measured, else sparse points, else the network's depth.

    Args:
        encoding: of the views.
        scene: contains the frames.
        positions: of the frames in the scene.
        views: the frames as read.
        independent: whether the scene's depth maps and sparse points are from elsewhere than the maps to align; if not, the network's depth it is.
    """
    measured = views.depths if independent else None
    if measured is not None and ((measured > 0).double().mean((-2, -1)) >= FEWEST_MEASURED).all():
        return Reference(
            "the sensor's depth", measured, sensor_spread(measured, metre_of(views, scene.unit == "metric"))
        )
    points = _depths_of_points(scene, positions, views) if independent else None
    if points is not None and ((points > 0).sum((-2, -1)) >= FEWEST_POINTS).all():
        return Reference("the scene's sparse points", points, torch.full_like(points, POINT_SPREAD))
    return Reference("the model's depth", encoding.placed_depths(views.cameras), encoding.depth_spread)


def place_at_maps(
    encoding: Encoding,
    views: Views,
    maps: Float[Tensor, "v h w"],
    source: DepthMaps,
    reference: Reference,
    *,
    trusted: bool = False,
) -> tuple[Encoding, MapPlacement]:
    """Place Gaussians at the mean log depth of the network, the aligned maps and, if it is the reference, the sensor, weighted by inverse variances.

    The variance of a map is that of its fit, the same everywhere in a view. Opacities and confidences stay. Views whose map does not fit keep the
    network's depth.

    Args:
        encoding: of the views.
        views: of one scene.
        maps: of the views, as from `read_maps`.
        source: of the maps.
        reference: as from `find_reference`.
        trusted: whether other maps of the source fit this scene; then these are not refused, whatever they show.

    Raises:
        InputError: no map fits, or metres are not metres; the error says what fits better.
    """
    depths, aligned = align(maps, source.meaning, reference, views.cameras)
    if not (trusted or any(fits(fit) for fit in aligned)):
        _check_misfit(maps, source, reference, views, aligned)
    elif source.meaning == "metric" and not trusted:
        _check_metres(source, reference, aligned)
    network = encoding.placed_depths(views.cameras)
    spreads = torch.tensor([fit.spread for fit in aligned]).to(network)[:, None, None].expand_as(network)
    good = torch.tensor([fits(fit) for fit in aligned])[:, None, None]
    measurements = [(network, encoding.depth_spread), (torch.where(good, depths, 0).to(network), spreads)]
    if views.depths is not None and reference.depths is views.depths:
        measurements.append((reference.depths.to(network), reference.spread.to(network)))
    weights = [(depth > 0) / spread.square().clamp(min=1e-12) for depth, spread in measurements]
    total = torch.stack(weights).sum(0)
    logs = [weight * depth.clamp(min=1e-6).log() for weight, (depth, _) in zip(weights, measurements, strict=True)]
    moved = encoding.with_depths((torch.stack(logs).sum(0) / total).exp(), views.cameras, depth_spread=total.rsqrt())
    return moved.hide(views.hidden), MapPlacement(source.title, source.meaning, reference.title, aligned)


def _check_misfit(
    maps: Float[Tensor, "v h w"], source: DepthMaps, reference: Reference, views: Views, aligned: tuple[MapFit, ...]
) -> None:
    """Refuse maps that mean something else than said, or show something else. Others do not fit only because a view is flat.

    Raises:
        InputError: as above.
    """
    expected = f"depth maps that fit {reference.title}, as {source.meaning}"
    found = f"a typical difference of {percent(median(fit.residual for fit in aligned))}"
    other: Meaning = "scaled" if source.meaning == "inverse" else "inverse"
    again = align(maps, other, reference, views.cameras)[1]
    pairs = zip(again, aligned, strict=True)
    if all(fits(fit) and fit.residual < CLEARLY_BETTER * before.residual for fit, before in pairs):
        raise InputError(source.title, expected, found, advice=f"they fit as {other}: --depth-meaning {other}")
    if all(fit.residual > POOR for fit in aligned):
        raise InputError(source.title, expected, found, advice="they may be of other photos")


def _check_metres(source: DepthMaps, reference: Reference, aligned: tuple[MapFit, ...]) -> None:
    """Refuse maps in metres that are in another unit.

    Raises:
        InputError: as above.
    """
    factor = median(fit.scale for fit in aligned if fits(fit))
    if abs(math.log(factor)) > math.log(ALIKE):
        raise InputError(
            source.title, "depth in metres", f"{factor:.3g} times the depth of {reference.title}",
            advice="state the unit of the maps, or give --depth-meaning scaled; or the poses are not in metres",
        )  # fmt: skip


def _depths_of_points(scene: Scene, positions: Sequence[int], views: Views) -> Float[Tensor, "v h w"] | None:
    """Depth maps with the sparse points that each frame sees, in a pixel the nearest one, 0 elsewhere; None if the scene does not say which."""
    frames = [scene.frames[position] for position in positions]
    if scene.points is None or any(frame.points is None for frame in frames):
        return None
    height, width = views.size
    maps = torch.full((len(views), height * width), torch.inf)
    for view, frame in enumerate(frames):
        points = torch.from_numpy(scene.points[frame.points] - scene.origin).double()
        column, row, depth = project(points, views.cameras[view]).unbind(-1)
        inside = (depth > 0) & (column >= 0) & (column < width) & (row >= 0) & (row < height)
        pixels = row[inside].long() * width + column[inside].long()
        maps[view].scatter_reduce_(0, pixels, depth[inside].float(), "amin")
    return torch.where(maps.isfinite(), maps, 0).unflatten(1, views.size)

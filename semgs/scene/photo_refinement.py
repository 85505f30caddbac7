"""Refinement: a few seconds of optimisation on the input photos, which make a scene's images sharp. Not in the paper.

Each step renders one photo and moves all Gaussians a little towards it. What may move, and how fast, is such that surfaces stay where several views put
them: Gaussians move along their rays together, by a coarse grid of shifts for each view, and alone only slowly. Their number, their places in
the photos and their classes stay. What one photo alone sees changes its colour only: no other photo would tell that it moves the wrong way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import log10

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from semgs.data.views import Views
from semgs.files.errors import check_type
from semgs.geometry.fusion import see_again
from semgs.geometry.gaussians import Gaussians
from semgs.scene.encoding import Encoding

PASSES, WALK_PASSES = 15, 7
"""Steps for each photo: of a few views, and of a walk."""

CELL = 8
"""Gaussians along each side of a cell of the grid of depth shifts."""

ERROR_WEIGHT, PRIOR_WEIGHT = 10.0, 1e-4
"""Weights of the mean squared error, and of shifts in standard deviations, squared."""

CELL_DEVIATION, LEAST_SPREAD = 0.05, 0.01
"""Standard deviation of a cell's shift, and the least one of a Gaussian's, in log depth."""

DECAY = 0.1
"""The rates at the end, as a part of those at the start."""

BORDER, FAINTEST = 0.12, 0.5
"""Opacity falls towards a photo's border: the width of the border, as a part of the shorter side, and the factor at its end."""

BETAS, EPSILON = (0.9, 0.99), 1e-15
"""Of Adam."""


@dataclass
class Unknown:
    """A tensor that learns, by Adam.

    Attributes:
        value: with a gradient.
        rate: of the first step.
        together: divide by one second moment for the whole tensor. With one for each number, noise moves flat walls as fast as errors move edges.
    """

    value: Tensor
    rate: float
    together: bool = False

    def __post_init__(self) -> None:
        self.value = self.value.detach().clone().requires_grad_()
        self._first = torch.zeros_like(self.value)
        self._second = torch.zeros(()).to(self.value) if self.together else torch.zeros_like(self.value)
        self._steps = 0

    @torch.no_grad()
    def step(self, factor: float) -> None:
        """One step against the gradient, at a part of the rate."""
        gradient = self.value.grad
        if gradient is None:
            return
        self._steps += 1
        first, second = BETAS
        square = gradient.square()
        self._first.lerp_(gradient, 1 - first)
        self._second.lerp_(square.mean() if self.together else square, 1 - second)
        mean = self._first / (1 - first**self._steps)
        scale = (self._second / (1 - second**self._steps)).sqrt() + EPSILON
        self.value -= factor * self.rate * mean / scale
        self.value.grad = None


@dataclass(frozen=True)
class Refined:
    """A refined scene.

    Attributes:
        encoding: the scene.
        passes: after which it was taken; 0 is before the first.
        curve: PSNR of the view that decided when to stop, before the first pass and after each [dB]; empty without such a view.
    """

    encoding: Encoding
    passes: int
    curve: tuple[float, ...] = ()


def refine(encoding: Encoding, views: Views, passes: int = PASSES, *, seed: int = 0) -> Encoding:
    """The same scene with sharper images.

    Args:
        encoding: of one scene.
        views: its input views.
        passes: steps for each photo.
        seed: of the order of the photos.

    Raises:
        ValueError: passes is less than 1; the views are not those of the encoding, or it has a batch axis.
    """
    return refine_until(encoding, views, passes, seed=seed).encoding


@torch.enable_grad()
def refine_until(
    encoding: Encoding,
    views: Views,
    passes: int = PASSES,
    *,
    seed: int = 0,
    check: Views | None = None,
    moves: bool = True,
    photos: Views | None = None,
    done: Callable[[int], object] = lambda steps: None,
) -> Refined:
    """As `refine`, with a view that decides when to stop.

    Args:
        encoding, views, passes, seed: as for `refine`.
        check: views that the result must render well; of all passes the best one is kept. None keeps the last one.
        moves: whether Gaussians may move; not those that a sensor has placed.
        photos: the views that teach; by default the input views.
        done: called after each step with the number of steps so far.

    Raises:
        ValueError: as for `refine`.
    """
    check_type("the encoding is", encoding, Encoding, 'the output of a network, such as load("small")(views)')
    check_type("views are", views, Views, "semgs.Views, the input views of the encoding")
    if passes < 1:
        raise ValueError(f"passes is {passes}; expected 1 or more")
    if encoding.depths.shape != (len(views), *views.size):
        raise ValueError(
            f"the encoding has depths {tuple(encoding.depths.shape)}; expected those of {len(views)} views of {views.size[0]}x{views.size[1]}"
        )
    shared = seen_by_several(encoding, views)
    unknowns = Unknowns(with_faded_borders(encoding, views, shared), views, moves, shared)
    curve, best = [], None
    if check is not None:
        curve, best = [_psnr(encoding, check)], encoding
    order = torch.Generator().manual_seed(seed)
    photos = views if photos is None else photos
    steps, taken = passes * len(photos), 0
    for _ in range(passes):
        for photo in torch.randperm(len(photos), generator=order).tolist():
            loss = ERROR_WEIGHT * _error(unknowns.gaussians(), encoding, photos, photo)
            (loss + PRIOR_WEIGHT * unknowns.prior()).backward()
            unknowns.step(DECAY ** (taken / steps))
            taken += 1
            done(taken)
        if check is not None:
            now = unknowns.encoding()
            curve.append(_psnr(now, check))
            if curve[-1] > max(curve[:-1]):
                best = now
    if best is None:
        return Refined(unknowns.encoding(), passes)
    return Refined(best, curve.index(max(curve)), tuple(curve))


class Unknowns:
    """What learns, and the scene that it makes of another. Gaussians that are not `shared` learn their colour only."""

    def __init__(self, encoding: Encoding, views: Views, moves: bool, shared: Bool[Tensor, " g"]) -> None:
        self._start, self._moves, self._shared = encoding.map(torch.Tensor.detach), moves, shared
        gaussians = self._start.gaussians
        self._blocks = encoding.blocks.to(gaussians.means.device)
        owner = encoding.own_views
        poses = views.cameras.world_from_camera.to(gaussians.means)[owner]
        self._rays = gaussians.means - poses[:, :3, 3]
        self._centres = poses[:, :3, 3]
        depths = (self._rays * poses[:, :3, 2]).sum(-1)
        pixel = depths[:, None] / views.cameras.focal_px.to(gaussians.means)[owner]
        self._pixel = poses[:, :3, :2] * pixel[:, None]
        self._spread = self._start.per_gaussian(self._start.depth_spread[:, None])[:, 0].clamp(min=LEAST_SPREAD)
        colour, zeros = gaussians.colour, gaussians.means.new_zeros
        opacities = gaussians.opacities.clamp(1e-4, 1 - 1e-4)
        cells = [-(-side // CELL) for side in encoding.grid]
        self.colour = Unknown(colour.features[:, :1], 0.04)
        self.harmonics = Unknown(colour.features[:, 1:], 0.004)
        self.log_size = Unknown(colour.scales.clamp(min=1e-9).log(), 0.04)
        self.rotation = Unknown(colour.quaternions, 0.008)
        self.opacity = Unknown(opacities.logit(), 0.1)
        self.cells = Unknown(zeros(len(views), 1, *cells), 0.003)
        self.depth = Unknown(zeros(len(gaussians)), 0.002, together=True)
        self.aside = Unknown(zeros(len(gaussians), 2), 0.1, together=True)

    def step(self, factor: float) -> None:
        """One step of all."""
        for unknown in vars(self).values():
            if isinstance(unknown, Unknown):
                unknown.step(factor)

    def prior(self) -> Tensor:
        """How unlikely the shifts of depth are."""
        own = (self.depth.value / self._spread).square().mean()
        return own + (self.cells.value / CELL_DEVIATION).square().mean()

    def gaussians(self) -> Gaussians:
        """The Gaussians, without classes, which do not learn."""
        start = self._start.gaussians
        means, factors = start.means, start.means.new_ones(1)
        if self._moves:
            factors = ((self._cell_shifts().flatten()[self._blocks] + self.depth.value) * self._shared).exp()[:, None]
            aside = (self._pixel @ self.aside.value[..., None])[..., 0] * self._shared[:, None]
            means = self._centres + (self._rays + aside) * factors
        return replace(
            start,
            means=means,
            opacities=torch.where(self._shared, self.opacity.value.sigmoid(), start.opacities) * (start.opacities > 0),
            colour=replace(
                start.colour,
                features=torch.cat((self.colour.value, self.harmonics.value), 1),
                scales=torch.where(self._shared[:, None], self.log_size.value.exp(), start.colour.scales) * factors,
                quaternions=torch.where(
                    self._shared[:, None],
                    torch.nn.functional.normalize(self.rotation.value, dim=-1),
                    start.colour.quaternions,
                ),
            ),
            semantic=None,
        )

    @torch.no_grad()
    def encoding(self) -> Encoding:
        """The scene now: classes stay, depths follow."""
        start, gaussians = self._start, self.gaussians().detach()
        if not self._moves:
            return replace(start, gaussians=replace(gaussians, semantic=start.gaussians.semantic))
        shifts = self._cell_shifts()
        own = shifts.flatten()
        own[self._blocks] = (own[self._blocks] + self.depth.value) * self._shared
        factors = own[self._blocks].exp()[:, None]
        semantic = start.gaussians.semantic
        if semantic is not None:
            semantic = replace(semantic, scales=semantic.scales * factors)
        ratios = own.reshape(shifts.shape).exp()
        depths = start.depths * start.per_pixel(ratios)
        return replace(start, gaussians=replace(gaussians, semantic=semantic), depths=depths)

    def _cell_shifts(self) -> Float[Tensor, "v rows columns"]:
        """The shift of log depth of each block, from those of the cells."""
        rows, columns = self._start.grid
        fine = torch.nn.functional.interpolate(
            self.cells.value, scale_factor=CELL, mode="bilinear", align_corners=False
        )
        return fine[:, 0, :rows, :columns]


@torch.no_grad()
def with_faded_borders(encoding: Encoding, views: Views, shared: Bool[Tensor, " g"]) -> Encoding:
    """The same scene with less opaque Gaussians near the borders of their photos, if they are shared with another photo. Photos are darker there, and end in a step."""
    (height, width), means = views.size, encoding.gaussians.means
    down, along = (torch.arange(side) + 0.5 for side in (height, width))
    inwards = torch.minimum(torch.minimum(down, height - down)[:, None], torch.minimum(along, width - along))
    part = (inwards / (BORDER * min(height, width))).clamp(max=1).to(means)
    factors = FAINTEST + (1 - FAINTEST) * encoding.per_gaussian(part.expand(len(views), 1, height, width))[:, 0]
    factors = torch.where(shared, factors, 1)
    return replace(encoding, gaussians=replace(encoding.gaussians, opacities=factors * encoding.gaussians.opacities))


@torch.no_grad()
def seen_by_several(encoding: Encoding, views: Views) -> Bool[Tensor, " g"]:
    """Which Gaussians another photo than their own sees, too, as far as depths agree."""
    means = encoding.gaussians.means
    spread = encoding.per_gaussian(encoding.depth_spread[:, None])[:, 0]
    found, own = torch.zeros(len(means), dtype=torch.bool, device=means.device), encoding.own_views.to(means.device)
    for view in range(len(views)):
        seen, _ = see_again(means, spread, encoding.depths[view], encoding.depth_spread[view], views.cameras[view])
        found |= seen & (own != view)
    return found


def _error(gaussians: Gaussians, encoding: Encoding, views: Views, view: int) -> Tensor:
    """The mean squared error of a photo's rendering, without hidden pixels."""
    photo = views.images[view].to(gaussians.means)
    image = replace(encoding, gaussians=gaussians).render(views.cameras[view : view + 1], clamp=False).images[0]
    if views.hidden is not None:
        shown = ~views.hidden[view].to(photo.device)
        photo, image = photo[:, shown], image[:, shown]
    return (image - photo).square().mean()


@torch.no_grad()
def _psnr(encoding: Encoding, views: Views) -> float:
    """Of the rendering of views, together [dB]."""
    plain = replace(encoding.gaussians, semantic=None)
    error = sum(float(_error(plain, encoding, views, view)) for view in range(len(views))) / len(views)
    return -10 * log10(max(error, 1e-12))

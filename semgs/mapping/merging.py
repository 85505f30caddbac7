"""Merging: what many keyframes say about each surface becomes one set of Gaussians.

Each keyframe is one view of a window of two to four views; its Gaussians, depth and classes come from that window. Each of its Gaussians is projected into the
other keyframes, and each of those votes on it, by the depth that it sees there and the rule of `semgs.geometry.fusion`:

- its depth agrees: it is the same surface. It pulls the Gaussian to its own depth, its classes count, and if it sees the surface more sharply, it may
  replace the Gaussian;
- it sees a surface behind, all around: it looks freely through the Gaussian, which then is a floater;
- it sees a surface in front: the Gaussian is hidden, and it does not vote.

Where depth is uncertain, the photos decide: a Gaussian is tried at `STEPS` depths along its ray, and each keyframe that would see it there says whether its
photo has that colour there. The Gaussian goes to the depth that most photos agree with, and is dropped if more contradict than agree even there.

All votes are sums over pairs of a Gaussian and a keyframe. So the result does not depend on the order of the keyframes, and adding keyframes one by one
gives the same as merging all at once, which is what the tests do by loops.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import log
from typing import Any

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from semgs.data.views import Views
from semgs.geometry.cameras import Cameras, project
from semgs.geometry.fusion import LEAST, SPREAD, TOLERANCE, depth_deviation
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.scene.encoding import Encoding, per_gaussian
from semgs.scene.overlap import PAIR, inside, shrinkage

LAYERS = 4
"""A surface gets the Gaussians of this many keyframes, those that see it most sharply, unless it will be refined."""

SHRINK = 0.5
"""Each layer makes surfaces thicker, and colours are tuned to two: with n > 2 of them, colour Gaussians get (2 / n)^SHRINK of their size, as in windows of n views."""

SHARPER = 1.5
"""Keyframes see a surface equally sharply if their pixels on it differ by less than about this factor. Then the earlier one goes first."""

STEPS, REACH = 9, 2.0
"""Photos are compared at so many depths, evenly spaced in the log, up to `REACH` standard deviations of log depth to both sides."""

SAME_COLOUR = 0.08
"""A colour, 0..1, fits a photo if it is at most this far outside the range of the pixels around; more between photos that differ in exposure."""

STAY = 0.3
"""Share of photos that must speak for a depth that is `REACH` away from the mean depth of the keyframes."""


@dataclass(frozen=True)
class Sightings:
    """The points that a keyframe has in its image.

    Attributes:
        numbers: of the points.
        z: their depth in its camera [m].
        places: that they fall into, counted row by row.
    """

    numbers: Int64[Tensor, " s"]
    z: Float[Tensor, " s"]
    places: Int64[Tensor, " s"]


@dataclass(frozen=True)
class Sheet:
    """What one keyframe sees, as the others are compared with it; one place is a block of pixels.

    Attributes:
        number: of the keyframe, in the order of time.
        camera: at the size of the images.
        stride: pixels along each side of a place.
        depths: z-depth of every place [m].
        nearest: the smallest z-depth of a place and its eight neighbours [m].
        spread: standard deviation of log depth.
        logs: log probabilities of the classes; None without classes.
        colours: of the photo, 0..1.
        darkest, brightest: the range of the colours of a place and its eight neighbours, for each channel.
        points: of the places, in the world [m].
        shown: whether a place has no hidden pixel (`Views.hidden`); None if all of them.
    """

    number: int
    camera: Cameras
    stride: int
    depths: Float[Tensor, "rows columns"]
    nearest: Float[Tensor, "rows columns"]
    spread: Float[Tensor, "rows columns"]
    logs: Float[Tensor, "rows columns class"] | None
    colours: Float[Tensor, "rows columns 3"]
    darkest: Float[Tensor, "rows columns 3"]
    brightest: Float[Tensor, "rows columns 3"]
    points: Float[Tensor, "rows columns 3"]
    shown: Bool[Tensor, "rows columns"] | None = None

    @property
    def focal_px(self) -> float:
        """The mean focal length [px]."""
        return float(self.camera.focal_px.mean())

    def sightings(self, points: Float[Tensor, "n 3"]) -> Sightings:
        """Which of some points [m] are in its image, and where."""
        # Relative to the camera in float64, so that float32 is precise enough.
        x, y, z = project(points.double(), self.camera).to(self.depths).unbind(-1)
        height, width = self.camera.size
        numbers = ((z > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)).nonzero()[:, 0]
        column, row = ((one[numbers] / self.stride).long() for one in (x, y))
        places = row * self.depths.shape[1] + column
        if self.shown is not None:
            visible = self.shown.flatten()[places]
            numbers, places = numbers[visible], places[visible]
        return Sightings(numbers, z[numbers], places)


@dataclass(frozen=True)
class Votes:
    """What keyframes say about Gaussians: sums over the keyframes.

    Attributes:
        agree: how many see the same surface.
        through: how many look freely through it.
        before: how many of those that agree go before the Gaussian's own keyframe, because they see the surface more sharply.
        weight: sum of the weights 1 / variance of log depth of those that agree.
        shift: sum of these weights times the log of their depth over that of the Gaussian.
        logs: sum of the log probabilities of the classes of those that agree; None without classes.
        fits, clashes: how many would see it at each of the depths that are tried, with and against their photo.
    """

    agree: Float[Tensor, " g"]
    through: Float[Tensor, " g"]
    before: Float[Tensor, " g"]
    weight: Float[Tensor, " g"]
    shift: Float[Tensor, " g"]
    logs: Float[Tensor, "g class"] | None
    fits: Float[Tensor, "g step"]
    clashes: Float[Tensor, "g step"]

    def map(self, function: Callable[[Tensor], Tensor]) -> Votes:
        """These votes with `function` applied to each array."""
        arrays: dict[str, Any] = {name: None if one is None else function(one) for name, one in vars(self).items()}
        return Votes(**arrays)

    def __add__(self, other: Votes) -> Votes:
        """The votes of both groups of keyframes."""
        more = vars(other)
        arrays: dict[str, Any] = {name: None if one is None else one + more[name] for name, one in vars(self).items()}
        return Votes(**arrays)


@dataclass(frozen=True)
class KeyframePart:
    """The Gaussians of one keyframe, and the votes about them. The Gaussians stay as the network placed them; `settle` applies the votes.

    Attributes:
        sheet: of the keyframe.
        gaussians: some of its Gaussians.
        index: their places in the keyframe, row by row.
        spread: standard deviation of their log depth.
        level: how sharply their own keyframe sees them: the log of the size of a pixel there, in steps of a factor `SHARPER`.
        votes: of the other keyframes.
        layers: a surface gets the Gaussians of so many keyframes.
    """

    sheet: Sheet
    gaussians: Gaussians
    index: Int64[Tensor, " g"]
    spread: Float[Tensor, " g"]
    level: Float[Tensor, " g"]
    votes: Votes
    layers: int = LAYERS

    def __len__(self) -> int:
        return len(self.index)

    def __getitem__(self, keep: Bool[Tensor, " g"]) -> KeyframePart:
        """Some of the Gaussians."""
        if keep.all():
            return self
        return replace(
            self,
            gaussians=self.gaussians.map(lambda tensor: tensor[keep]),
            index=self.index[keep],
            spread=self.spread[keep],
            level=self.level[keep],
            votes=self.votes.map(lambda tensor: tensor[keep]),
        )

    def judged_by(self, other: Sheet) -> KeyframePart:
        """The same Gaussians, with the votes of one more keyframe; without those that are not needed any more."""
        voted = replace(self, votes=self.votes + votes_of(self, other))
        return voted[voted.votes.before < self.layers]


def unshrunk(encoding: Encoding, cameras: Cameras) -> Encoding:
    """The Gaussians of a window at the sizes of two views: with more, the network makes them smaller.

    Args:
        encoding: of the window.
        cameras: of its views [v].
    """
    if len(encoding.depths) <= PAIR:
        return encoding
    colour = encoding.gaussians.colour
    times = inside(encoding.gaussians.means, cameras).sum(-1).to(colour.scales)
    grown = replace(colour, scales=colour.scales / shrinkage(times, SHRINK)[:, None])
    return replace(encoding, gaussians=replace(encoding.gaussians, colour=grown))


def parts_of(encoding: Encoding, seen: Views, numbers: Sequence[int], layers: int = LAYERS) -> list[KeyframePart]:
    """The Gaussians of each view, without votes of others and without those of hidden pixels.

    Args:
        encoding: of the views, with Gaussians at the sizes of two views.
        seen: the views [v].
        numbers: of the keyframes.
        layers: a surface gets the Gaussians of so many keyframes.
    """
    views, cameras = len(numbers), seen.cameras
    count = len(encoding.gaussians) // views
    stride = encoding.stride
    rows, columns = (-(-side // stride) for side in cameras.size)
    every = encoding.gaussians.map(lambda tensor: tensor.unflatten(0, (views, count)))
    spreads = per_gaussian(encoding.depth_spread[:, None], stride).reshape(views, rows, columns)
    depths = per_gaussian(encoding.placed_depths(cameras)[:, None], stride).reshape(views, rows, columns)
    colours = torch.nn.functional.avg_pool2d(seen.images.to(depths), stride, ceil_mode=True)
    brightest, darkest = (sign * torch.nn.functional.max_pool2d(sign * colours, 3, 1, 1) for sign in (1, -1))
    photos = torch.stack((colours, darkest, brightest)).permute(1, 0, 3, 4, 2)
    found = []
    shown = None
    if seen.hidden is not None:
        shown = per_gaussian(seen.hidden[:, None].to(depths), stride).reshape(views, rows, columns) == 0
    for view, number in enumerate(numbers):
        gaussians = every.map(lambda tensor, view=view: tensor[view].clone())  # not a view: the window goes
        logs = None
        if gaussians.semantic is not None:
            logs = (gaussians.semantic.features + LEAST).log().reshape(rows, columns, -1)
        nearest = -torch.nn.functional.max_pool2d(-depths[view][None], 3, 1, 1)[0]
        own, darkest_own, brightest_own = photos[view].unbind()
        sheet = Sheet(
            number,
            cameras[view],
            stride,
            depths[view],
            nearest,
            spreads[view],
            logs,
            own,
            darkest_own,
            brightest_own,
            gaussians.means.reshape(rows, columns, 3),
            None if shown is None else shown[view],
        )
        zeros, tried = torch.zeros(count), torch.zeros(count, STEPS)
        none = None if logs is None else torch.zeros(count, logs.shape[-1])
        votes = Votes(zeros, zeros, zeros, zeros, zeros, none, tried, tried)
        level = sharpness(depths[view].flatten(), sheet.focal_px)
        part = KeyframePart(sheet, gaussians, torch.arange(count), spreads[view].flatten(), level, votes, layers)
        found.append(part if sheet.shown is None else part[sheet.shown.flatten()])
    return found


def sharpness(depths: Float[Tensor, "*n"], focal_px: float) -> Float[Tensor, "*n"]:
    """The log of the size of a pixel on a surface at some depths, in whole steps of a factor `SHARPER`."""
    return ((depths / focal_px).log() / log(SHARPER)).floor()


def votes_of(part: KeyframePart, other: Sheet) -> Votes:
    """What one keyframe says about Gaussians of another."""
    means = part.gaussians.means
    found = other.sightings(means)
    within, z, place = found.numbers, found.z, found.places
    seen, spread = other.depths.flatten()[place], other.spread.flatten()[place]
    apart = depth_deviation(z, seen, part.spread[within], spread)
    agrees = apart.abs() <= TOLERANCE
    free = depth_deviation(z, other.nearest.flatten()[place], part.spread[within], spread) < -TOLERANCE
    level = sharpness(seen, other.focal_px)
    first = (level < part.level[within]) | ((level == part.level[within]) & (other.number < part.sheet.number))
    weight = agrees / (spread.square() + SPREAD**2)

    def spread_out(values: Tensor) -> Tensor:
        """Values of the Gaussians that it sees, 0 for the others."""
        return values.new_zeros((len(means), *values.shape[1:])).index_copy_(0, within, values)

    logs = None if other.logs is None else other.logs.flatten(0, 1)[place] * agrees[:, None]
    fits, clashes = compare_photos(part, other)
    return Votes(
        agree=spread_out(agrees.to(means)),
        through=spread_out(free.to(means)),
        before=spread_out((agrees & first).to(means)),
        weight=spread_out(weight),
        shift=spread_out(weight * (seen / z).log()),
        logs=None if logs is None else spread_out(logs),
        fits=fits,
        clashes=clashes,
    )


def steps(spread: Float[Tensor, " g"]) -> Float[Tensor, "g step"]:
    """The depths at which Gaussians are compared with photos: logs, relative to their own depth."""
    return torch.linspace(-REACH, REACH, STEPS).to(spread) * (spread + SPREAD)[:, None]


def compare_photos(part: KeyframePart, other: Sheet) -> tuple[Float[Tensor, "g step"], Float[Tensor, "g step"]]:
    """At which depths a keyframe would see Gaussians of another with the colour of its own photo, and at which with another colour; 1 or 0."""
    camera, centre = other.camera, part.sheet.camera.centres
    pixel_from_world = camera.intrinsics @ camera.world_from_camera[:3, :3].T
    start = pixel_from_world @ (centre - camera.centres)
    rays = (part.gaussians.means.double() - centre) @ pixel_from_world.T
    points = start + steps(part.spread).double().exp()[..., None] * rays[:, None]
    z = points[..., 2].to(part.spread)
    x, y = (points[..., axis].to(z) / z for axis in (0, 1))
    height, width = camera.size
    within = (z > 0) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    column, row = ((torch.where(within, one, 0) / other.stride).long() for one in (x, y))
    place = row * other.depths.shape[1] + column
    spread = part.spread[:, None].expand_as(z)
    apart = depth_deviation(
        torch.where(within, z, 1), other.depths.flatten()[place], spread, other.spread.flatten()[place]
    )
    visible = within & (apart <= TOLERANCE)
    if other.shown is not None:
        visible &= other.shown.flatten()[place]
    own = part.sheet.colours.flatten(0, 1)[part.index][:, None].expand(-1, STEPS, -1)
    same = outside(own, other, place) <= SAME_COLOUR + exposure(part.sheet, other)
    return (visible & same).to(z), (visible & ~same).to(z)


def outside(colours: Float[Tensor, "*n 3"], other: Sheet, place: Int64[Tensor, "*n"]) -> Float[Tensor, "*n"]:
    """How far colours are outside the range of a photo around some places, in the channel where that is most."""
    darkest, brightest = (one.flatten(0, 1)[place] for one in (other.darkest, other.brightest))
    return torch.maximum(colours - brightest, darkest - colours).amax(-1).clamp(min=0)


def exposure(one: Sheet, other: Sheet) -> float:
    """By how much the photos of two keyframes differ where their depths agree: the third quartile; 1 if they agree nowhere."""
    found = other.sightings(one.points.flatten(0, 1))
    within, place = found.numbers, found.places
    apart = depth_deviation(
        found.z, other.depths.flatten()[place], one.spread.flatten()[within], other.spread.flatten()[place]
    )
    agree = apart.abs() <= TOLERANCE
    differences = outside(one.colours.flatten(0, 1)[within][agree], other, place[agree])
    return float(differences.quantile(0.75)) if len(differences) else 1.0


def choose_shifts(part: KeyframePart) -> tuple[Float[Tensor, " g"], Bool[Tensor, " g"]]:
    """The log of how much farther each Gaussian goes, and whether photos allow it there.

    It goes to the mean depth of the keyframes, weighted by certainty, unless clearly more photos speak for another of the depths that were tried. The
    photos' votes are smoothed over neighbouring places. It is allowed if no more photos speak against it than for it.
    """
    votes, (rows, columns) = part.votes, part.sheet.depths.shape
    mean = votes.shift / (1 / (part.spread.square() + SPREAD**2) + votes.weight)

    def smooth(values: Tensor) -> Tensor:
        """Each place takes the mean of itself and its eight neighbours."""
        maps = values.new_zeros(rows * columns, STEPS).index_copy_(0, part.index, values)
        pooled = torch.nn.functional.avg_pool2d(maps.T.reshape(1, STEPS, rows, columns), 3, 1, 1)
        return pooled.flatten(2)[0].T[part.index]

    fits, clashes = smooth(votes.fits), smooth(votes.clashes)
    tried = steps(part.spread)
    moves = ((tried - mean[:, None]) / (REACH * (part.spread[:, None] + SPREAD))).square()
    best = (clashes / (fits + clashes).clamp(min=LEAST) + STAY * moves).argmin(1, keepdim=True)
    found = tried.gather(1, best)[:, 0]
    stays = best[:, 0] == moves.argmin(1)
    allowed = votes.clashes.gather(1, best) <= votes.fits.gather(1, best)
    return torch.where(stays, mean, found), allowed[:, 0]


def settle(part: KeyframePart) -> KeyframePart:
    """The Gaussians that stay, at the depth and with the classes that the keyframes agree on.

    Those that more of the other keyframes look through than agree with are floaters and go, and so do those that more photos contradict than show.
    """
    part = part[part.votes.before < part.layers]
    shift, allowed = choose_shifts(part)
    keep = allowed & (part.votes.through <= part.votes.agree)
    part, ratio = part[keep], shift[keep].exp()[:, None]
    gaussians, votes = part.gaussians, part.votes
    centre = part.sheet.camera.centres.to(gaussians.means)
    semantic = gaussians.semantic
    if semantic is not None and votes.logs is not None:
        logs = (semantic.features + LEAST).log() + votes.logs
        semantic = Appearance(
            semantic.quaternions, semantic.scales * ratio, (logs / (1 + votes.agree[:, None])).softmax(-1)
        )
    thinner = shrinkage((1 + votes.agree).clamp(max=part.layers), SHRINK)[:, None]
    colour = replace(gaussians.colour, scales=gaussians.colour.scales * ratio * thinner)
    means = centre + (gaussians.means - centre) * ratio
    footprints = None if gaussians.footprints is None else gaussians.footprints * ratio[:, 0].square()
    moved = replace(gaussians, means=means, colour=colour, semantic=semantic, footprints=footprints)
    return replace(part, gaussians=moved)


def join_parts(parts: Sequence[KeyframePart]) -> tuple[Gaussians, Int64[Tensor, " g"]]:
    """All Gaussians of some keyframes, and the places that they stand for, counted over the views in this order."""
    first = parts[0]
    blocks = first.sheet.depths.numel()
    index = torch.cat([part.index + view * blocks for view, part in enumerate(parts)])
    names = list(zip(*(part.gaussians.tensors().values() for part in parts), strict=True))
    tensors = iter([torch.cat(one) for one in names])
    return first.gaussians.map(lambda _: next(tensors)), index

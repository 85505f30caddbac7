"""The usual mistakes in cameras, and how each is undone."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import final

import numpy as np
import torch
from jaxtyping import Float64

from semgs.doctor.rig import FLIP, FileConvention, Rig, inverse
from semgs.files.text import natural_order
from semgs.geometry.rotations import matrix_from_quaternion, quaternion_from_matrix

FACTORS = np.geomspace(0.25, 4, 41)
"""Factors on the focal length that are tried first; the best is refined."""

SHIFTS = np.linspace(-0.2, 0.2, 9)
"""Shifts of the principal point that are tried first, relative to the image; the best is refined."""

STEPS = 4
"""Refinements of a search; each divides its step by 4."""

UNIT_FACTORS = (1e-3, 1e-2, 0.1, 10.0, 1e2, 1e3, 0.2, 5.0, 0.25, 4.0)
"""Between usual units of depth maps: powers of ten, 5,000 counts a metre (TUM RGB-D) for 1,000, and 4,000 (depth cameras that count quarters of a millimetre)."""

PLAUSIBLE_DEPTH = (0.4, 15.0)
"""Median depths of rooms [m]."""

Error = Callable[[Rig], float]
"""How far a rig is from what was observed: it misses matches [px], or depth maps disagree [%]."""


@final
@dataclass(frozen=True)
class Given:
    """What corrections need besides the cameras.

    Attributes:
        rig: the cameras as given.
        convention: how the scene's files write poses.
        names: of the frames, in the file's order.
        depth: the median of the measured depths at matches [m]; NaN if nothing was measured.
        error: how far cameras are from what was observed, in px or percent.
        disparity: as from `fit_disparity`.
    """

    rig: Rig
    convention: FileConvention
    names: tuple[str, ...]
    depth: float
    error: Error = field(repr=False)
    disparity: Float64[np.ndarray, "n 2"] | None = field(default=None, repr=False)


@final
@dataclass(frozen=True)
class Mistake:
    """A usual mistake.

    Attributes:
        name: in a few words.
        corrected: rigs of which one is right if the mistake was made; a mistake with a free parameter has searched for it.
        probes: rigs that differ as much as the mistake at least does; if one of them fits as well as the given cameras, the mistake cannot be
            excluded. By default those of `corrected`.
    """

    name: str
    corrected: Callable[[Given], Iterator[Rig]]
    probes: Callable[[Given], Iterator[Rig]] | None = None

    def excluded_by(self, given: Given) -> Iterator[Rig]:
        """The rigs whose misfit excludes the mistake."""
        return (self.probes or self.corrected)(given)


def _inverted(given: Given) -> Iterator[Rig]:
    yield _rewritten(given, inverse)


def _other_axes(given: Given) -> Iterator[Rig]:
    yield replace(given.rig, poses=given.rig.poses @ FLIP)


def _inverted_with_other_axes(given: Given) -> Iterator[Rig]:
    written = inverse(given.convention.written(given.rig.poses))
    yield replace(given.rig, poses=given.convention.read(written) @ FLIP)


def _transposed(given: Given) -> Iterator[Rig]:
    def transposed(matrices: np.ndarray) -> np.ndarray:
        return _with_rotation(matrices, matrices[:, :3, :3].mT)

    yield _rewritten(given, transposed)
    yield replace(given.rig, poses=transposed(given.rig.poses))


def _with_inverse_translations(given: Given) -> Iterator[Rig]:
    """The inverse of [R | t] has the translation -R^T t; with R^T as it is read, that is undone by -R."""

    def corrected(matrices: np.ndarray) -> np.ndarray:
        changed = matrices.copy()
        changed[:, :3, 3:] = -matrices[:, :3, :3] @ matrices[:, :3, 3:]
        return changed

    yield _rewritten(given, corrected)
    yield replace(given.rig, poses=corrected(given.rig.poses))


def _other_quaternion(given: Given) -> Iterator[Rig]:
    for order in ([3, 0, 1, 2], [1, 2, 3, 0]):

        def reordered(matrices: np.ndarray, order: list[int] = order) -> np.ndarray:
            quaternions = quaternion_from_matrix(torch.from_numpy(matrices[:, :3, :3].copy()))
            return _with_rotation(matrices, matrix_from_quaternion(quaternions[:, order]).numpy())

        yield _rewritten(given, reordered)
        yield replace(given.rig, poses=reordered(given.rig.poses))


def _mirrored(given: Given) -> Iterator[Rig]:
    """All reflections of the world are one up to a rotation of it: x to -x. One axis of the cameras is turned round with it, or all three."""
    for axes in ((1, -1, -1), (-1, 1, -1), (-1, -1, 1), (1, 1, 1)):
        poses = given.rig.poses @ np.diag([*axes, 1.0])
        poses[:, :3, 3] *= -1
        yield replace(given.rig, poses=poses)


def _reversed(given: Given) -> Iterator[Rig]:
    yield _reordered(given.rig, np.arange(len(given.names))[::-1])


def _off_by_one(given: Given) -> Iterator[Rig]:
    count = len(given.names)
    for step in (1, -1):
        poses = np.full_like(given.rig.poses, np.nan)
        kept = np.arange(max(0, -step), count - max(0, step))
        poses[kept] = given.rig.poses[kept + step]
        yield replace(given.rig, poses=poses)


def _sorted_otherwise(given: Given) -> Iterator[Rig]:
    """Sorted as text, 10 comes before 9; sorted as numbers, after it."""
    by_text = sorted(range(len(given.names)), key=lambda index: _unpadded(given.names[index]))
    by_number = sorted(range(len(given.names)), key=lambda index: natural_order(given.names[index]))
    to_text = np.empty(len(by_text), dtype=np.int64)
    to_text[by_number] = by_text
    for order in (to_text, np.argsort(to_text)):
        if (order != np.arange(len(order))).any():
            yield _reordered(given.rig, order)


def _of_other_size(given: Given) -> Iterator[Rig]:
    """The best factor on the focal length; or on the principal point as well, which then shows about what it is."""
    rig = given.rig
    yield _scaled(given, FACTORS, lambda factor: replace(rig, focal=rig.focal * factor))
    about = float((rig.sizes / (2 * rig.centre).clip(1e-6)).mean().clip(1e-3, 1e3))
    if abs(np.log(about)) > 0.2:
        around = about * np.geomspace(0.8, 1.25, 9)
        yield _scaled(given, around, lambda factor: replace(rig, focal=rig.focal * factor, centre=rig.centre * factor))


def _scaled(given: Given, factors: np.ndarray, scaled: Callable[[float], Rig]) -> Rig:
    """The best of the rigs scaled by some factors, and by others between them."""

    def error(factor: float) -> float:
        return given.error(scaled(factor))

    best, step = min(factors, key=error), factors[1] / factors[0]
    for _ in range(STEPS):
        step **= 0.25
        best = min(best * step ** np.arange(-4, 5), key=error)
    return scaled(best)


def _other_factors(given: Given) -> Iterator[Rig]:
    for factor in (0.75, 4 / 3):
        yield replace(given.rig, focal=given.rig.focal * factor)


def _focal_swapped(given: Given) -> Iterator[Rig]:
    yield replace(given.rig, focal=given.rig.focal[:, ::-1])


def _centre_swapped(given: Given) -> Iterator[Rig]:
    yield replace(given.rig, centre=given.rig.centre[:, ::-1])


def _other_centre(given: Given) -> Iterator[Rig]:
    """The middle of the image, or the best place around it."""
    middle = replace(given.rig, centre=given.rig.sizes / 2)
    yield middle

    def shifted(shift: np.ndarray) -> Rig:
        return replace(middle, centre=middle.centre + shift * middle.sizes)

    def error(shift: np.ndarray) -> float:
        return given.error(shifted(shift))

    best, step = min(_square(SHIFTS), key=error), SHIFTS[1] - SHIFTS[0]
    for _ in range(2 * STEPS):
        step /= 2
        best = min(best + step * _square(np.array([-1.0, 0.0, 1.0])), key=error)
    yield shifted(best)


def _square(numbers: np.ndarray) -> np.ndarray:
    """All pairs of some numbers [n^2 2]."""
    return np.stack(np.meshgrid(numbers, numbers), axis=-1).reshape(-1, 2)


def _other_centres(given: Given) -> Iterator[Rig]:
    for shift in ((0.05, 0.0), (-0.05, 0.0), (0.0, 0.05), (0.0, -0.05)):
        yield replace(given.rig, centre=given.rig.centre + np.array(shift) * given.rig.sizes)


def _millimetres(given: Given) -> Iterator[Rig]:
    if np.isnan(given.depth) or plausible(given.depth):
        for factor in (1e-3, 1e-2):
            poses = given.rig.poses.copy()
            poses[:, :3, 3] *= factor
            yield replace(given.rig, poses=poses)


def _other_depth_unit(given: Given) -> Iterator[Rig]:
    for factor in UNIT_FACTORS:
        if np.isnan(given.depth) or plausible(given.depth * factor):
            yield replace(given.rig, depth_unit=given.rig.depth_unit * factor)


def _along_ray(given: Given) -> Iterator[Rig]:
    if not np.isnan(given.depth):
        yield replace(given.rig, along_ray=not given.rig.along_ray)


def _inverse_depth(given: Given) -> Iterator[Rig]:
    if given.disparity is not None:
        yield replace(given.rig, disparity=given.disparity)


def _without_depth(given: Given) -> Iterator[Rig]:
    if not np.isnan(given.depth):
        yield replace(given.rig, depth_unit=np.nan)


def plausible(depth: float) -> bool:
    """Whether it may be the median depth of a room."""
    return PLAUSIBLE_DEPTH[0] <= depth <= PLAUSIBLE_DEPTH[1]


MILLIMETRES = Mistake("positions in millimetres or centimetres", _millimetres)

DEPTH_UNIT = Mistake("wrong unit of depth", _other_depth_unit)

ALONG_RAY = Mistake("depth along the ray instead of z", _along_ray)

INVERSE_DEPTH = Mistake("depth maps that are inverse depth (disparity)", _inverse_depth)

MISTAKES = (
    Mistake("poses inverted (world to camera for camera to world, or the reverse)", _inverted),
    Mistake("OpenGL and OpenCV axes confused", _other_axes),
    Mistake("poses inverted, and OpenGL and OpenCV axes confused", _inverted_with_other_axes),
    Mistake("rotations transposed", _transposed),
    Mistake("translations of world to camera as positions (or the reverse)", _with_inverse_translations),
    Mistake("order of quaternions (w first or last)", _other_quaternion),
    Mistake("mirrored world (left-handed coordinates)", _mirrored),
    Mistake("fx and fy swapped", _focal_swapped),
    Mistake("cx and cy swapped", _centre_swapped),
    MILLIMETRES,
    INVERSE_DEPTH,
    DEPTH_UNIT,
    ALONG_RAY,
    Mistake("images in reverse order", _reversed),
    Mistake("images off by one", _off_by_one),
    Mistake("images sorted as text (10 before 9)", _sorted_otherwise),
    Mistake("focal length of another image size", _of_other_size, _other_factors),
    Mistake("wrong principal point", _other_centre, _other_centres),
)
"""In this order the first counts if several explain the data equally well: those with a free parameter are last, but inverse depth, of
which parallax shows that it falls with depth, is before what depth may be."""

BAD_DEPTH = Mistake("depth maps that do not fit the images (not registered to them, or wrong)", _without_depth)
"""The last resort, because less is asked of cameras without depth: it counts if nothing else explains the data."""

OF_DEPTH = (DEPTH_UNIT, ALONG_RAY, INVERSE_DEPTH, BAD_DEPTH)
"""Mistakes in depth maps; all others are in the cameras."""


def _rewritten(given: Given, change: Callable[[np.ndarray], np.ndarray]) -> Rig:
    """The rig whose files have changed matrices."""
    return replace(given.rig, poses=given.convention.read(change(given.convention.written(given.rig.poses))))


def _with_rotation(matrices: Float64[np.ndarray, "n 4 4"], rotations: np.ndarray) -> Float64[np.ndarray, "n 4 4"]:
    """Matrices with other rotations."""
    changed = matrices.copy()
    changed[:, :3, :3] = rotations
    return changed


def _reordered(rig: Rig, order: Sequence[int] | np.ndarray) -> Rig:
    """Each image with the pose of another frame."""
    return replace(rig, poses=rig.poses[np.asarray(order)])


def _unpadded(name: str) -> str:
    """The name without leading zeros, as text."""
    return re.sub(r"\d+", lambda digits: str(int(digits[0])), name)

"""A splat of another program: what its file says, as activated quantities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from semgs.files.errors import InputError
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.summaries import describe

MOST_GAUSSIANS = 50_000_000
"""Files that claim more are refused before anything is allocated."""

DEGREES = {0: 0, 9: 1, 24: 2, 45: 3}
"""The degree of the harmonics, by how many numbers they have above the constant one, in all three channels."""

SAMPLED = 100_000
"""Gaussians that say how large they usually are."""

ROUNDING = 1e-4
"""The square of a scale may be by this share smaller than the footprint that it contains, because both are written as float32."""

MOST_BROKEN = 0.02
"""If more of the Gaussians have a number that is not valid, the file is damaged; fewer are left by trainings, and are left out."""

SHORTEST = 1e-12
"""A shorter quaternion has no direction that can be trusted."""


@dataclass(frozen=True)
class Splat:
    """Gaussians from a file of another program, in the coordinates of that file.

    Attributes:
        gaussians: of colour, without classes: opacities 0..1, standard deviations, unit quaternions (w, x, y, z), harmonics [g k 3] in the basis
            of 3DGS. Degrees that are zero in all Gaussians are left out.
        format: of the file: "PLY", "compressed PLY", "SPZ" or "glTF".
        up: the direction that is usually up in files of this format. No field of the file says it.
        extra: columns that are not part of the format, by name, each with a row for each Gaussian.
        comments: what the file says about itself, and what was not read.
        notes: the comments that the user should know, one sentence each: what was left out, or read in another way than the format says.
    """

    gaussians: Gaussians
    format: str
    up: Literal["y", "-y"]
    extra: Mapping[str, np.ndarray] = field(default_factory=dict)
    comments: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return describe(
            "Splat",
            gaussians=self.gaussians,
            format=self.format,
            extra=", ".join(self.extra) or None,
            comments="; ".join(self.comments) or None,
        )

    def noted(self, *notes: str) -> Splat:
        """This splat with notes, which are comments, too."""
        return replace(self, notes=notes, comments=(*self.comments, *notes))

    def __len__(self) -> int:
        """The number of Gaussians."""
        return len(self.gaussians)


@dataclass(frozen=True)
class Usable:
    """The Gaussians of a file whose numbers are valid.

    Attributes:
        gaussians: these.
        kept: whether each one of the file is among them.
    """

    gaussians: Gaussians
    kept: Bool[np.ndarray, " g"]


def note_left_out(count: int, of: int) -> tuple[str, ...]:
    """What to say if Gaussians of a file are left out."""
    if not count:
        return ()
    return (f"{count:,} of {of:,} Gaussians are left out: they have a number that is not finite or not valid.",)


def check_count(path: Path, count: int, place: str | None = None) -> None:
    """Check how many Gaussians a file claims.

    Raises:
        InputError: none, or more than `MOST_GAUSSIANS`.
    """
    if not 1 <= count <= MOST_GAUSSIANS:
        raise InputError(path, f"1 to {MOST_GAUSSIANS:,} Gaussians", f"{count:,}", place)


def make_gaussians(
    path: Path,
    *,
    means: Float[np.ndarray, "g 3"],
    opacities: Float[np.ndarray, " g"],
    scales: Float[np.ndarray, "g 3"],
    quaternions: Float[np.ndarray, "g 4"],
    harmonics: Float[np.ndarray, "g k 3"],
    footprints: Float[np.ndarray, " g"] | None = None,
) -> Usable:
    """Gaussians from activated numbers, without those that have a number which is not finite as a float32, an opacity that is not 0..1, a negative scale or a
    quaternion of zero.

    Args:
        path: the file, for errors.
        means: positions.
        opacities: 0..1.
        scales: standard deviations.
        quaternions: (w, x, y, z), of any length but zero.
        harmonics: in the basis of 3DGS.
        footprints: as those of `Gaussians`; the scales do not contain them.

    Raises:
        InputError: more than `MOST_BROKEN` of them would be left out; or positions are so far from the origin that float32 would move them by more than
            the Gaussians are large.
    """
    largest = np.finfo(np.float32).max
    turns, kept = quaternions.astype(np.float64), np.ones(len(means), bool)
    with np.errstate(all="ignore"):
        lengths = np.linalg.norm(turns, axis=-1)
    broken = []
    for name, values, least, most, expected in (
        ("position", means, -largest, largest, "finite numbers"),
        ("opacity", opacities, 0.0, 1.0, "0 to 1"),
        ("scale", scales, 0.0, largest, "finite numbers, 0 or more"),
        ("harmonics", harmonics, -largest, largest, "finite numbers"),
        ("rotation", lengths, SHORTEST, np.finfo(np.float64).max, "a quaternion that is not zero"),
    ):
        low, high = values.min(initial=most), values.max(initial=least)
        if not (low >= least and high <= most):  # NaN too
            good = np.asarray(((values >= least) & (values <= most)).reshape(len(values), -1).all(-1))
            broken.append((name, turns if values is lengths else values, good, expected))
            kept &= good
    if np.count_nonzero(~kept) > MOST_BROKEN * len(kept):
        for name, values, good, expected in broken:
            check_all(path, name, values, good, expected)
    if broken:
        means, opacities, scales, harmonics, turns, lengths = (
            values[kept] for values in (means, opacities, scales, harmonics, turns, lengths)
        )
        footprints = None if footprints is None else footprints[kept]
    _check_steps(path, means, scales)
    turns /= lengths[:, None]
    gaussians = Gaussians(
        means=_tensor(means),
        opacities=_tensor(opacities),
        colour=Appearance(_tensor(turns), _tensor(scales), _tensor(harmonics[:, : _used(harmonics)])),
        footprints=None if footprints is None else _tensor(footprints),
    )
    return Usable(gaussians, kept)


def without_footprints(
    scales: Float[np.ndarray, "g 3"], footprints: Float[np.ndarray, " g"]
) -> tuple[Float[np.ndarray, "g 3"], Float[np.ndarray, " g"] | None]:
    """Scales without the footprints that a file of ours says they contain, and these; unchanged scales and None if they do not contain them."""
    with np.errstate(over="ignore", invalid="ignore"):
        squares = scales.astype(np.float64) ** 2
        within = (footprints >= 0) & (footprints <= squares.min(axis=1) * (1 + ROUNDING))
    if len(footprints) != len(scales) or not within.all():
        return scales, None
    own = np.sqrt((squares - footprints[:, None]).clip(min=0))
    return np.where(scales < 0, scales, own), footprints  # negative ones stay, to be refused


def _check_steps(path: Path, means: Float[np.ndarray, "g 3"], scales: Float[np.ndarray, "g 3"]) -> None:
    """Check that positions, as in UTM, lose nothing that is seen as float32."""
    typical = float(np.median(scales[:: 1 + len(scales) // SAMPLED].max(axis=1)))
    farthest = float(np.abs(means).max())
    if farthest * np.finfo(np.float32).eps <= typical:
        return
    lost = float(np.abs(means - means.astype(np.float32)).max())
    if lost > typical:
        found = (
            f"positions {farthest:.3g} from it, which 32 bits round by {lost:.2g}; Gaussians are {typical:.2g} large"
        )
        raise InputError(
            path, "a splat near its origin", found, advice="subtract a point near the splat from its positions"
        )


def with_largest(others: Float[np.ndarray, "g 3"], largest: Int64[np.ndarray, " g"]) -> Float[np.ndarray, "g 4"]:
    """Quaternions of unit length from all of their numbers but the largest one, which is positive.

    Args:
        others: the three others, in their order.
        largest: the place of the largest one, 0..3.
    """
    quaternions, rows = np.empty((len(others), 4)), np.arange(len(others))
    for place in range(3):
        quaternions[rows, place + (place >= largest)] = others[:, place]
    quaternions[rows, largest] = np.sqrt(np.maximum(0, 1 - (others**2).sum(-1)))
    return quaternions


def _tensor(values: np.ndarray) -> Float[Tensor, " ..."]:
    """A copy as float32."""
    return torch.from_numpy(np.array(values, np.float32, order="C"))


def check_all(path: Path, name: str, values: np.ndarray, good: np.ndarray, expected: str) -> None:
    """Check that all Gaussians have good numbers.

    Args:
        path: the file.
        name: of the numbers.
        values: [g] or [g ...].
        good: of each number, or of each Gaussian.
        expected: what is good.

    Raises:
        InputError: a number is not good. It names the first Gaussian with one.
    """
    if good.all():
        return
    index = int(np.argwhere(~good)[0][0])
    found = ", ".join(f"{number:g}" for number in np.ravel(values[index])[:4])
    raise InputError(path, expected, found, f"{name} of Gaussian {index}")


def _used(harmonics: np.ndarray) -> int:
    """The harmonics up to the last degree that is not zero everywhere."""
    used = harmonics.shape[1]
    while used > 1 and not harmonics[:, (round(used**0.5) - 1) ** 2 : used].any():
        used = (round(used**0.5) - 1) ** 2
    return used

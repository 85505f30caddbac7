"""The level frame, which is the world turned until z is up, and the height of the floor in it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float64


def level_from_world(up: Sequence[float]) -> Float64[np.ndarray, "3 3"]:
    """The smallest rotation that turns a direction into +z; the identity if it is +z already.

    Args:
        up: of any length above 0.

    Raises:
        ValueError: it has no direction.
    """
    direction = np.asarray(up, np.float64)
    length = np.linalg.norm(direction) if direction.shape == (3,) else 0.0
    if not (np.isfinite(length) and length > 0):
        raise ValueError(f"up is {tuple(up)}; expected a direction of three numbers, not all 0")
    x, y, z = direction / length
    if z < 0:  # turned upside down first, by half a turn about x
        return level_from_world((x, -y, -z)) @ np.diag([1.0, -1.0, -1.0])
    return np.array(
        [
            [1 - x * x / (1 + z), -x * y / (1 + z), -x],
            [-x * y / (1 + z), 1 - y * y / (1 + z), -y],
            [x, y, z],
        ]
    )


FLOOR = "floor"
"""The class of the floor."""

BIN = 0.02
"""Width of the bins in which the floor is searched [m]."""

THICK = 0.1
"""Points within this of the floor are on it [m]."""

LEAST_FLOOR = 0.01
"""The floor has at least this share of the opacity of all points."""

MOST_BELOW, FAR_BELOW = 0.05, 0.2
"""A level with more than this share of all points further below it than this [m] is a table that was taken for a floor."""

MOST_BELOW_KNOWN_UP = 0.15
"""The same share if the direction that is up is known: then more of the points may be stray ones, or those of a step or of stairs that lead down."""

DEEPEST = 1000.0
"""Points further below the lowest camera are not searched for the floor: a single stray one would stretch the bins without end [m]."""

LOWEST_PEAK = 0.4
"""Without classes, the floor is the lowest level with this share of the points of the fullest one."""


class NoFloorError(ValueError):
    """There is no floor in the scene, or not enough of it."""


def floor_height(
    heights: Float64[np.ndarray, " n"],
    weights: Float64[np.ndarray, " n"],
    eyes: Float64[np.ndarray, " r"],
    on_floor: Bool[np.ndarray, " n"] | None = None,
    *,
    up_is_known: bool = False,
) -> float:
    """The height of the floor: of the fullest level of points that have its class, or without classes of the lowest full one. It is below all cameras.

    Args:
        heights: of points [m].
        weights: their opacities.
        eyes: heights of the cameras [m].
        on_floor: whether each point has the class of the floor; None if unknown.
        up_is_known: whether the user said which way is up.

    Raises:
        NoFloorError: there is no such level.
    """
    may = (heights < eyes.min() - THICK) & (heights > eyes.min() - DEEPEST)
    if on_floor is not None:
        may &= on_floor
    if weights[may].sum() <= LEAST_FLOOR * weights.sum():
        what = "below the cameras" if on_floor is None else "below the cameras with the class floor"
        raise NoFloorError(f"no clear floor (fewer than {LEAST_FLOOR:.0%} of the Gaussians are {what})")
    lowest = heights[may].min()
    bins = ((heights[may] - lowest) / BIN).astype(np.int64)
    width = round(THICK / BIN)
    full = np.convolve(np.bincount(bins, weights[may]), np.ones(width), "same")
    if on_floor is None:
        peak = int(np.argmax(full >= LOWEST_PEAK * full.max()))
        peak += int(np.argmax(full[peak : peak + width]))
    else:
        peak = int(np.argmax(full))
    around = may & (np.abs(heights - lowest - (peak + 0.5) * BIN) <= THICK)
    order = np.argsort(heights[around])
    shares = np.cumsum(weights[around][order])
    floor = float(heights[around][order][np.searchsorted(shares, shares[-1] / 2)])
    below, most = (
        weights[heights < floor - FAR_BELOW].sum() / weights.sum(),
        MOST_BELOW_KNOWN_UP if up_is_known else MOST_BELOW,
    )
    if below > most:
        doubt = "" if up_is_known else "; which way is up may be wrong, and --up says it"
        raise NoFloorError(
            f"no clear floor ({below:.0%} of the Gaussians are below what looks most like one, at most {most:.0%} may be{doubt})"
        )
    return floor

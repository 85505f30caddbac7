"""Whether depth maps are registered to their images.

A depth camera of another focal length sees the same scene at another size. If its maps are used as they are, each pixel gets the depth of a point
at `zoom` times its offset from the principal point, where `zoom` is the focal length of the depth camera over that of the images.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from jaxtyping import Float64

from semgs.doctor.misses import miss, misses
from semgs.doctor.rig import Rig
from semgs.doctor.warps import DepthView, warp_errors
from semgs.sfm.matches import ZOOMS, Matches

FEWEST_PAIRS = 4
"""With fewer pairs of frames, nothing can be said."""

FEWEST = 8
"""Of a pair with fewer matches whose depth is known at both zooms, no median is taken."""

LEAST_GAIN, CLEARLY = 1.05, 3.0
"""Another zoom fits better if the errors of pairs fall by this factor, and by this many standard errors of it."""

LEAST_ZOOM = 1.05
"""Focal lengths that differ by less than this factor are those of a rough calibration, not of another camera."""

FLOOR_PX, FLOOR_PERCENT = 0.1, 0.2
"""Added to errors before they are compared: smaller ones depend on the size of pixels and on noise."""


@final
@dataclass(frozen=True)
class Zoom:
    """How well depth fits if its camera has another focal length.

    Attributes:
        ratio: over that of the images.
        error: the mean error of pairs then [px, or %].
        gain: the error with depth as given over that, the geometric mean over pairs.
        significance: how many standard errors log(gain) is above 0.
    """

    ratio: float
    error: float
    gain: float
    significance: float

    @property
    def clear(self) -> bool:
        """Whether depth is clearly that of another camera."""
        apart = abs(np.log(self.ratio)) > np.log(LEAST_ZOOM)
        return bool(apart and self.gain > LEAST_GAIN and self.significance > CLEARLY)


def unregistered(rig: Rig, matches: Matches, views: Sequence[DepthView], rival_px: float) -> Zoom | None:
    """The zoom at which depth fits clearly better than as given; None if there is none.

    Wrong matches, as of repeated texture, may fit at any zoom. So matches do not count if depth maps then agree clearly less. If matches show
    nothing, the zoom at which depth maps agree clearly better counts, unless it is as good for matches without depth: then the focal length of
    the images is wrong.

    Args:
        rig: the cameras.
        matches: between images.
        views: depth maps of neighbouring frames.
        rival_px: the miss of matches if another mistake is undone, which the depth of another camera has to beat; infinite if there is no other.
    """
    by_matches, by_warps = zooms_of_matches(rig, matches), zooms_of_warps(rig, views)
    found = max(by_matches, key=lambda zoom: zoom.gain, default=None)
    if found is not None and found.clear:
        worse = any(zoom.ratio == found.ratio and zoom.significance < -CLEARLY for zoom in by_warps)
        return found if found.error < rival_px and not worse else None
    found = max(by_warps, key=lambda zoom: zoom.gain, default=None)
    if found is None or not found.clear or not len(matches) or np.isfinite(rival_px):
        return None
    alone = matches.without_depth()
    return found if miss(rig, alone) < miss(replace(rig, focal=rig.focal * found.ratio), alone) else None


def zooms_of_matches(rig: Rig, matches: Matches) -> list[Zoom]:
    """How well measured depth puts matches where they are at each of `ZOOMS`; none if too few have depth."""
    known = range(len(ZOOMS) if len(matches.zoomed) else 0)
    return _compared([_at_zoom(rig, matches, index) for index in known], FLOOR_PX)


def _at_zoom(rig: Rig, matches: Matches, index: int) -> Float64[np.ndarray, "2 p"]:
    """The median miss of each pair with depth as given and at a zoom, on the matches that have both; NaN with few of them."""
    zoomed = matches.zoomed[..., index]
    known = np.isfinite(matches.depths) & np.isfinite(zoomed)
    each = [
        misses(rig, replace(matches, depths=np.where(known, depths, np.nan))) for depths in (matches.depths, zoomed)
    ]
    result = np.full((2, len(matches.pairs)), np.nan)
    for pair in range(len(matches.pairs)):
        of_pair = known.any(1) & (matches.pair == pair)
        if of_pair.sum() >= FEWEST:
            result[:, pair] = [np.median(one[of_pair]) for one in each]
    return result


def zooms_of_warps(rig: Rig, views: Sequence[DepthView]) -> list[Zoom]:
    """How well depth maps of neighbouring frames agree at each of `ZOOMS`; none if there are too few.

    Depth maps alone cannot show which focal length is wrong, theirs or that of the images.
    """
    given = warp_errors(rig, views)
    each = [np.stack((given, warp_errors(replace(rig, focal=rig.focal * zoom), views))) for zoom in ZOOMS]
    return _compared(each, FLOOR_PERCENT)


def _compared(each: Sequence[Float64[np.ndarray, "2 p"]], floor: float) -> list[Zoom]:
    """Zooms from the errors of pairs with depth as given and at each of `ZOOMS`."""
    found = []
    for ratio, errors in zip(ZOOMS.tolist(), each, strict=False):
        before, after = errors[:, np.isfinite(errors).all(0)] + floor
        if len(before) >= FEWEST_PAIRS:
            falls = np.log(before / after)
            mean, spread = float(falls.mean()), max(float(falls.std(ddof=1)) / len(falls) ** 0.5, 1e-9)
            found.append(Zoom(ratio, float(after.mean()) - floor, float(np.exp(mean)), mean / spread))
    return found

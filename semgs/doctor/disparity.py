"""Whether depth maps are inverse depth (disparity), as networks for single images predict it.

MiDaS and Depth Anything write numbers d with 1 / z = scale d + shift, and each image has a scale and a shift of its own. Parallax shows them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from semgs.doctor.misses import triangulated_depths
from semgs.doctor.rig import Rig
from semgs.sfm.matches import Matches

FEWEST, MOST = 20, 200
"""A frame with fewer matches whose depth is known has no fit; of more than the second, every n-th is used."""

LEFT = 0.5
"""A line explains inverse depth if the median of what it leaves is at most this share of the median deviation before."""

SHARE = 0.75
"""Depth maps are inverse depth if at least this share of the frames with enough matches shows it."""


def fit_disparity(rig: Rig, matches: Matches) -> Float64[np.ndarray, "n 2"] | None:
    """The scale and shift of each frame, with a positive scale, if its measured depth is clearly inverse depth; NaN for frames without a clear fit.

    None unless most frames have one. Depth has a negative scale here, in whatever unit it is.
    """
    frames = matches.pairs[matches.pair]
    turned = replace(matches, pairs=matches.pairs[:, ::-1], points=matches.points[:, ::-1])
    parallax = np.stack([triangulated_depths(rig, one) for one in (matches, turned)], axis=-1)
    known = np.isfinite(matches.depths) & np.isfinite(parallax)
    fits, tested = np.full((len(rig.poses), 2), np.nan), 0
    for frame in np.unique(frames):
        of_frame = known & (frames == frame)
        count = int(of_frame.sum())
        if count >= FEWEST:
            tested += 1
            every = -(-count // MOST)
            line = _line(matches.depths[of_frame][::every], 1 / parallax[of_frame][::every])
            if line is not None:
                fits[frame] = line
    shown = int(np.isfinite(fits).all(1).sum())
    return fits if shown and shown >= SHARE * tested else None


def _line(d: Float64[np.ndarray, " m"], inverse: Float64[np.ndarray, " m"]) -> tuple[float, float] | None:
    """Scale and shift of the line through most points, by the median of the slopes of their pairs (Theil and Sen); None if it falls, or does not explain them."""
    one, other = np.triu_indices(len(d), 1)
    apart = d[one] != d[other]
    if not apart.any():
        return None
    scale = np.median((inverse[one] - inverse[other])[apart] / (d[one] - d[other])[apart])
    left = inverse - scale * d
    before, after = (np.median(np.abs(some - np.median(some))) for some in (inverse, left))
    return (float(scale), float(np.median(left))) if scale > 0 and after <= LEFT * before else None

"""How far cameras miss the matches: by epipolar geometry, and by one warp where depth was measured.

The matches also show whether depth maps are inverse depth (disparity), as networks for single images predict it: MiDaS and Depth Anything write numbers d with 1 / z = scale d + shift, and each image has a scale and a shift of its own. Parallax shows them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from semgs.doctor.rig import Rig, inverse
from semgs.sfm.matches import Matches

CAP_PX = 20.0
"""A match that is missed by more counts as this: how far off nonsense is says nothing."""

FEWEST, MOST = 20, 200
"""A frame with fewer matches whose depth is known has no fit; of more than the second, every n-th is used."""

LEFT = 0.5
"""A line explains inverse depth if the median of what it leaves is at most this share of the median deviation before."""

SHARE = 0.75
"""Depth maps are inverse depth if at least this share of the frames with enough matches shows it."""


def misses(rig: Rig, matches: Matches) -> Float64[np.ndarray, " m"]:
    """The distance by which each match is missed [px of the reduced images], at most `CAP_PX`; NaN if a frame has no pose.

    A point of one frame may lie anywhere on its ray, in front of both cameras: the miss is the distance of its match in the other frame from
    the image of that ray, which is half of an epipolar line. If its depth was measured, the ray is one point. Both directions are averaged;
    if only one of them has depth, that one counts.
    """
    frames = matches.pairs[matches.pair]
    relative = _second_from_first(rig, matches)
    rays = (matches.points - rig.centre[frames]) / rig.focal[frames]
    depths = rig.z_depths(matches.depths, rays, frames)
    px = rig.focal[frames] * matches.shrink[..., None]
    forth_px = _one_way(relative, rays[:, 0], rays[:, 1], depths[:, 0], px[:, 1])
    back_px = _one_way(inverse(relative), rays[:, 1], rays[:, 0], depths[:, 1], px[:, 0])
    known = np.isfinite(depths)
    forth, back = np.where(known[:, 0] | known[:, 1], known.T, 1.0)
    return (forth * forth_px + back * back_px) / (forth + back)


def pair_misses(rig: Rig, matches: Matches) -> Float64[np.ndarray, " p"]:
    """The median miss of each pair of frames [px]; NaN if a frame has no pose."""
    each = misses(rig, matches)
    starts = np.flatnonzero(np.diff(matches.pair, prepend=-1))
    counts = np.diff(starts, append=len(each))
    of = np.repeat(np.arange(len(starts)), counts)
    ordered = each[np.lexsort((each, of))]  # within each pair; NaN is last
    medians = (ordered[starts + (counts - 1) // 2] + ordered[starts + counts // 2]) / 2
    return np.where(np.isnan(ordered[starts + counts - 1]), np.nan, medians)


def miss(rig: Rig, matches: Matches) -> float:
    """The mean over pairs of their median miss [px]. Infinite if more than half of the pairs have no poses."""
    each = pair_misses(rig, matches)
    known = each[np.isfinite(each)]
    return float(known.mean()) if len(known) and 2 * len(known) >= len(each) else np.inf


def triangulated_depth(rig: Rig, matches: Matches) -> float:
    """The median of `triangulated_depths` [the scene's unit]; NaN if there is none."""
    depths = triangulated_depths(rig, matches)
    known = depths[np.isfinite(depths)]
    return float(np.median(known)) if len(known) else np.nan


def triangulated_depths(rig: Rig, matches: Matches) -> Float64[np.ndarray, " m"]:
    """The z-depth in its first frame at which the cameras put each match, by parallax alone [the scene's unit]; NaN if that is not in front of it.

    A point at depth z on the ray a is at z R a + t in the second frame, parallel to the ray b there: z (b x R a) = -(b x t), solved by least
    squares.
    """
    frames = matches.pairs[matches.pair]
    motion = _second_from_first(rig, matches)
    rays = (matches.points - rig.centre[frames]) / rig.focal[frames]
    a, b = np.concatenate((rays, np.ones((*rays.shape[:2], 1))), axis=-1).swapaxes(0, 1)
    across, step = np.cross(b, np.einsum("mij,mj->mi", motion[:, :3, :3], a)), np.cross(b, motion[:, :3, 3])
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = -(across * step).sum(1) / (across**2).sum(1)
    return np.where(np.isfinite(depths) & (depths > 0), depths, np.nan)


def epipolar_line(rig: Rig, i: int, j: int, point: Float64[np.ndarray, " xy"]) -> Float64[np.ndarray, "k 2"]:
    """The image in frame j of the ray of a point of frame i: pixel positions as in `Matches`, from the vanishing point; NaN behind the camera."""
    motion = (inverse(rig.poses[j : j + 1]) @ rig.poses[i : i + 1])[0]
    far = motion[:3, :3] @ np.append((point - rig.centre[i]) / rig.focal[i], 1.0)
    step = motion[:3, 3]
    nearness = np.concatenate(([0.0], np.geomspace(1e-3, 1e3, 200))) / max(float(np.linalg.norm(step)), 1e-12)
    along = far + nearness[:, None] * step
    with np.errstate(divide="ignore", invalid="ignore"):
        pixels = along[:, :2] / along[:, 2:] * rig.focal[j] + rig.centre[j]
    return np.where(along[:, 2:] > 1e-9, pixels, np.nan)


def _second_from_first(rig: Rig, matches: Matches) -> Float64[np.ndarray, "m 4 4"]:
    """For each match the motion from the first frame's camera to the second's."""
    first, second = rig.poses[matches.pairs].swapaxes(0, 1)
    return (inverse(second) @ first)[matches.pair]


def _one_way(
    b_from_a: Float64[np.ndarray, "m 4 4"],
    a: Float64[np.ndarray, "m 2"],
    b: Float64[np.ndarray, "m 2"],
    depths: Float64[np.ndarray, " m"],
    focal_px: Float64[np.ndarray, "m 2"],
) -> Float64[np.ndarray, " m"]:
    """The distance of points b from the images of the rays a in the other frame [px].

    A point at inverse depth w on the ray is at (R a + w t) / (R a + w t)_z: a straight line in w, with the vanishing point at w = 0. Its
    direction is l = t - (R a) t_z / (R a)_z, and the point nearest to b has (R a + w t) . l = b . l (R a + w t)_z.
    """
    far = np.einsum("mij,mj->mi", b_from_a[:, :3, :3], np.column_stack((a, np.ones(len(a)))))
    step = b_from_a[:, :3, 3]
    target, scaled_step = b * focal_px, step[:, :2] * focal_px
    scaled_far = far[:, :2] * focal_px
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        line = scaled_step * far[:, 2:] - scaled_far * step[:, 2:]
        above = _dot(target, line) * far[:, 2] - _dot(scaled_far, line)
        below = _dot(scaled_step, line) - _dot(target, line) * step[:, 2]
        nearest = np.where(below == 0, 0.0, above / below)
        distances = []
        # On the free ray both the nearest point and the vanishing point may count: the first may be behind a camera.
        for w in (np.where(np.isfinite(depths), 1 / depths, nearest), np.zeros(len(a))):
            depth = far[:, 2] + w * step[:, 2]
            at = (scaled_far + w[:, None] * scaled_step) / depth[:, None]
            distance = np.sqrt(_dot(at - target, at - target))
            distances.append(np.where((w >= 0) & (depth > 0), np.minimum(distance, CAP_PX), CAP_PX))
    least = np.where(np.isfinite(depths), distances[0], np.minimum(*distances))
    return np.where(np.isfinite(step).all(1), least, np.nan)


def _dot(a: Float64[np.ndarray, "m 2"], b: Float64[np.ndarray, "m 2"]) -> Float64[np.ndarray, " m"]:
    """Dot products of points; a sum over an axis of two takes several times as long."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1]


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

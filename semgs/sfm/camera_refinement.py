"""Better cameras for photos whose cameras are slightly wrong: the most probable ones, given matches and the cameras as they are.

A pair of cameras [R | t] sees a match as unit-depth rays a and b. Turned into the world, these and the baseline lie in one plane if the cameras
are right: (t_2 - t_1) x R_1 a . R_2 b = 0. Divided by its gradient over the four pixel coordinates, this is the distance of the match from
the epipolar geometry in pixels (Sampson's), with which the points themselves drop out of the bundle adjustment. Minimised is

    sum over matches of log(1 + (distance / MATCH_PX)^2)  +  sum over cameras of (angle / TURN_DEG)^2 + (distance / (SHIFT spacing))^2

The second sum says how far off cameras usually are. Matches say nothing about the world's frame and scale, and little about the baseline of
neighbouring views, because a shift to the side looks like a rotation. There the given cameras decide: no camera is held, and the mean position
of all stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from jaxtyping import Float64, Int64
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from semgs.data.scene import Scene
from semgs.runtime.notes import Kind, Note
from semgs.sfm.matches import Matches, find_matches

MATCH_PX = 1.0
"""How far true matches miss [px of the reduced images]."""

TURN_DEG, SHIFT = 1.0, 0.02
"""How far cameras are off: their rotation [degrees], and their position as a share of the spacing."""

COARSE = 4.0
"""Matches may first miss by this many times more, so that those of cameras which are further off count as well."""

FALLS_TO = 0.6
"""Refined cameras are taken if the median distance of the matches falls to at most this share."""

AT_ONE_PLACE = Kind("The cameras were not refined: they are all at the same place.")
TOO_FEW_MATCHES = Kind("The cameras were not refined: too few matches were found between the images.")
LEFT_AS_THEY_ARE = Kind(
    "The cameras were left as they are: refining them on {matches} matches would change the median epipolar error from {before:.2f} to "
    "{after:.2f} px, which is no clear improvement."
)
REFINED = Kind(
    "The cameras were refined on {matches} matches: the median epipolar error fell from {before:.2f} to {after:.2f} px. Cameras were rotated by "
    "up to {turned:.2f} degrees, and moved by up to {moved:.1%} of the distance between neighbouring cameras.",
    "The cameras were slightly wrong and were corrected, by up to {turned:.2f} degrees.",
)


@final
@dataclass(frozen=True, eq=False)
class MatchedRays:
    """Points seen by two cameras each.

    Attributes:
        cameras: the two cameras of each match.
        rays: where each sees it, at depth 1 in the camera's frame; z is 1.
        focal: (fx, fy) of each of the two [px of the reduced images].
    """

    cameras: Int64[np.ndarray, "m 2"]
    rays: Float64[np.ndarray, "m 2 3"]
    focal: Float64[np.ndarray, "m 2 2"]


@final
@dataclass(frozen=True, eq=False)
class CameraRefinement:
    """Refined cameras, and what was refined.

    Attributes:
        frames: positions of the frames in the scene.
        given: world_from_camera of each before.
        poses: world_from_camera of each after; equal to `given` unless `accepted`.
        matches: how many matches there were.
        spacing: mean distance of a camera to the nearest other one [m, or the scene's unit].
        before_px: median distance of the matches from the epipolar geometry, with the cameras as given; NaN without matches.
        after_px: the same with the cameras that were found, accepted or not.
        accepted: whether the cameras were changed.
    """

    frames: tuple[int, ...]
    given: Float64[np.ndarray, "n 4 4"]
    poses: Float64[np.ndarray, "n 4 4"]
    matches: int
    spacing: float
    before_px: float
    after_px: float
    accepted: bool

    @property
    def turned_deg(self) -> Float64[np.ndarray, " n"]:
        """By how much each camera was rotated [degrees]."""
        turns = self.given[:, :3, :3].mT @ self.poses[:, :3, :3]
        return np.degrees(Rotation.from_matrix(turns).magnitude())

    @property
    def moved(self) -> Float64[np.ndarray, " n"]:
        """By how much each camera was moved, as a share of the spacing."""
        return np.linalg.norm(self.poses[:, :3, 3] - self.given[:, :3, 3], axis=1) / self.spacing

    def applied(self, scene: Scene) -> Scene:
        """The scene with the refined cameras."""
        frames = list(scene.frames)
        for index, pose in zip(self.frames, self.poses, strict=True):
            frames[index] = replace(frames[index], world_from_camera=pose)
        return replace(scene, frames=tuple(frames))

    def notes(self) -> list[Note]:
        """What happened, for the user."""
        if not self.spacing:
            return [AT_ONE_PLACE()]
        if not self.matches:
            return [TOO_FEW_MATCHES()]
        errors = {"matches": self.matches, "before": self.before_px, "after": self.after_px}
        if not self.accepted:
            return [LEFT_AS_THEY_ARE(**errors)]
        return [REFINED(**errors, turned=self.turned_deg.max(), moved=self.moved.max())]


def refine_cameras(scene: Scene, frames: Sequence[int]) -> CameraRefinement:
    """Refine the cameras of some frames on matches between their images; intrinsics stay.

    The cameras are taken only if the median distance of the matches falls to `FALLS_TO` of what it was. Frames without matches stay where they
    are.

    Args:
        scene: the scene.
        frames: positions of two or more frames.

    Raises:
        InputError: an image or a depth map cannot be read.
    """
    frames = tuple(frames)
    given = np.stack([scene.frames[index].world_from_camera for index in frames])
    spacing = _spacing(given)
    unchanged = CameraRefinement(frames, given, given, 0, spacing, np.nan, np.nan, accepted=False)
    if not spacing:
        return unchanged
    seen = sightings(scene, frames, find_matches(scene, frames))
    count = len(seen.cameras)
    if not count:
        return unchanged
    found = adjusted(given, seen, spacing)
    before, after = (float(np.median(np.abs(epipolar_px(poses, seen)))) for poses in (given, found))
    accepted = after <= FALLS_TO * before
    return CameraRefinement(frames, given, found if accepted else given, count, spacing, before, after, accepted)


def sightings(scene: Scene, frames: Sequence[int], matches: Matches) -> MatchedRays:
    """Matches as rays of the cameras of some frames.

    Args:
        scene, frames: as for `refine_cameras`.
        matches: between these frames.
    """
    place = {index: camera for camera, index in enumerate(frames)}
    pairs = np.array([[place[int(index)] for index in pair] for pair in matches.pairs], dtype=np.int64).reshape(-1, 2)
    cameras = pairs[matches.pair]
    focal = np.array([scene.frames[index].lens.focal for index in frames], dtype=np.float64)[cameras]
    centre = np.array([scene.frames[index].lens.centre for index in frames], dtype=np.float64)[cameras]
    rays = np.concatenate(((matches.points - centre) / focal, np.ones((len(cameras), 2, 1))), axis=-1)
    return MatchedRays(cameras, rays, focal * matches.shrink[..., None])


def adjusted(given: Float64[np.ndarray, "n 4 4"], seen: MatchedRays, spacing: float) -> Float64[np.ndarray, "n 4 4"]:
    """The most probable cameras.

    Args:
        given: world_from_camera of each.
        seen: the matches.
        spacing: `SHIFT` is a share of this.
    """
    step = np.zeros(6 * len(given))
    for loosened in (COARSE, 1.0):

        def residuals(step: np.ndarray, width: float = loosened) -> np.ndarray:
            distance = epipolar_px(_moved(given, step, spacing), seen) / (width * MATCH_PX)
            return np.concatenate((width * np.sign(distance) * np.sqrt(np.log1p(distance**2)), step))

        step = least_squares(residuals, step).x
    return _moved(given, step, spacing)


def epipolar_px(poses: Float64[np.ndarray, "n 4 4"], seen: MatchedRays) -> Float64[np.ndarray, " m"]:
    """The signed distance of each match from the epipolar geometry of its cameras, to first order [px of the reduced images]."""
    (first, second), (a, b) = poses[seen.cameras].swapaxes(0, 1), seen.rays.swapaxes(0, 1)
    baseline = second[:, :3, 3] - first[:, :3, 3]
    a = np.einsum("mij,mj->mi", first[:, :3, :3], a)
    b = np.einsum("mij,mj->mi", second[:, :3, :3], b)
    volume = (np.cross(baseline, a) * b).sum(1)
    # The volume is linear in each ray: these are its derivatives by the pixel positions in both images.
    by_first = np.einsum("mji,mj->mi", first[:, :3, :2], np.cross(b, baseline)) / seen.focal[:, 0]
    by_second = np.einsum("mji,mj->mi", second[:, :3, :2], np.cross(baseline, a)) / seen.focal[:, 1]
    return volume / np.maximum(np.sqrt((by_first**2).sum(1) + (by_second**2).sum(1)), 1e-12)


def _moved(given: Float64[np.ndarray, "n 4 4"], step: np.ndarray, spacing: float) -> Float64[np.ndarray, "n 4 4"]:
    """Cameras after a step: of each camera a rotation vector in its frame in `TURN_DEG`, and a shift in the world in `SHIFT` of the spacing."""
    turn, shift = step.reshape(-1, 2, 3).swapaxes(0, 1)
    poses = given.copy()
    poses[:, :3, :3] = given[:, :3, :3] @ Rotation.from_rotvec(np.radians(TURN_DEG) * turn).as_matrix()
    poses[:, :3, 3] += SHIFT * spacing * shift
    return poses


def _spacing(poses: Float64[np.ndarray, "n 4 4"]) -> float:
    """The mean distance of a camera to the nearest other one."""
    centres = poses[:, :3, 3]
    apart = np.linalg.norm(centres[:, None] - centres, axis=-1)
    np.fill_diagonal(apart, np.inf)
    return float(apart.min(axis=1).mean())

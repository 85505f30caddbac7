"""How well two photos show the motion between their cameras. A wrong motion may fit a few matches with little parallax as well as the right one."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from jaxtyping import Float64

MOST_DEG = 3.5
"""The direction of the motion has at most this standard deviation. Right directions of 256 px photos had up to 3; most wrong ones had 5 and more."""

LEAST_NOISE_PX = 0.15
"""Matches are not trusted to be more precise than this [px]."""

TURNED = 0.003
"""If a turn moves all pixels to within this share of the longer side of where they are, the camera only turned."""

STEP = 1e-5
"""Of the differences that derivatives are taken by."""


def matches_of(model: Any) -> Float64[np.ndarray, "2 n 2"]:
    """The points of a pycolmap model of two photos as seen in each, from its principal point, at the first one's focal length [px]. That has the smaller number."""
    first, second = (model.images[number] for number in sorted(model.images))
    pairs = [{one.image_id: one.point2D_idx for one in point.track.elements} for point in model.points3D.values()]
    found = []
    for image in (first, second):
        focal, *middle = model.cameras[image.camera_id].params[:3]
        seen = np.array([image.points2D[pair[image.image_id]].xy for pair in pairs], dtype=np.float64).reshape(-1, 2)
        found.append((seen - middle) * (model.cameras[first.camera_id].params[0] / focal))
    return np.stack(found)


def direction_error_deg(
    matches: Float64[np.ndarray, "2 n 2"], focal_px: float, second_from_first: Float64[np.ndarray, "4 4"]
) -> float:
    """The standard deviation of the direction in which the camera moved, along its least certain axis, from the distances of matches to their epipolar lines [degrees].

    It is infinite if the matches do not determine the direction.

    Args:
        matches: positions in both photos, from the principal point [px].
        focal_px: of both photos.
        second_from_first: coordinates of the first camera to those of the second.
    """
    if matches.shape[1] < 6:
        return float("inf")
    rays = np.concatenate((matches / focal_px, np.ones((*matches.shape[:2], 1))), axis=-1)
    rotation, motion = second_from_first[:3, :3], second_from_first[:3, 3] / np.linalg.norm(second_from_first[:3, 3])
    across = np.linalg.svd(motion[None])[2][1:]

    def distances(change: np.ndarray) -> np.ndarray:
        turned = cv2.Rodrigues(change[:3])[0] @ rotation
        essential = np.cross(motion + change[3:] @ across, turned, axisb=0, axisc=0)
        lines = rays[0] @ essential.T, rays[1] @ essential
        length = np.sqrt(sum((line[:, :2] ** 2).sum(1) for line in lines))
        return np.asarray(focal_px * (lines[0] * rays[1]).sum(1) / length)

    slopes = np.stack([(distances(one) - distances(-one)) / (2 * STEP) for one in STEP * np.eye(5)], axis=1)
    noise = max(1.48 * float(np.median(np.abs(distances(np.zeros(5))))), LEAST_NOISE_PX)
    normal = slopes.T @ slopes
    if np.linalg.cond(normal) > 1 / np.finfo(float).eps:
        return float("inf")
    return float(np.degrees(noise * np.sqrt(np.linalg.eigvalsh(np.linalg.inv(normal)[3:, 3:])[-1])))


def parallax_px(matches: Float64[np.ndarray, "2 n 2"], focal_px: float) -> float:
    """How far the median match is from where the turn of a camera whose focal length is unknown would move it [px]. Only motion leaves more than noise.

    Args:
        matches: positions in both photos, from the principal point [px].
        focal_px: where to start.
    """
    from scipy.optimize import least_squares  # takes a second to import, only for photos without cameras

    def off(values: np.ndarray) -> np.ndarray:
        focal = focal_px * np.exp(values[3])
        turned = np.concatenate((matches[0] / focal, np.ones((matches.shape[1], 1))), axis=1)
        turned = turned @ cv2.Rodrigues(values[:3])[0].T
        return np.asarray(focal * turned[:, :2] / turned[:, 2:] - matches[1])

    starts = [np.array([0.0, 0.0, 0.0, start]) for start in (-0.5, 0.0, 0.5)]
    fits = [least_squares(lambda values: off(values).ravel(), start, loss="soft_l1", max_nfev=50).x for start in starts]
    return min(float(np.median(np.linalg.norm(off(fit), axis=1))) for fit in fits)

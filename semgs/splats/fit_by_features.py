"""Where photos with cameras fit a splat that is in other coordinates: a similarity from features that photos and renderings share.

Features of a rendering have a place in the splat, by its depth. Those that a photo shares say where the photo was taken in the splat (perspective from n points); two such
places and the given cameras say a similarity. The one that most features of all photos agree with is refined on their reprojection error.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import permutations

import cv2
import numpy as np
import torch
from jaxtyping import Float32, Float64
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from torch import Tensor

from semgs.data.bounds.sift import mutual_matches, sift
from semgs.data.views import Views
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Gaussians, move_gaussians
from semgs.rendering.rendering import SEEN_ALPHA, Rendering
from semgs.splats.splat_cameras import cameras_around
from semgs.splats.splat_scene import render_plain

WITHIN = 0.02
"""A feature agrees if it is imaged within this share of the longer side; if it usually is without a motion, the cameras fit as they are."""

LEAST_EACH, LEAST = 10, 40
"""So many features of a photo, and of all photos, have to agree."""

LEAST_BASELINE = 0.01
"""Photos say a scale if they were taken at least this far apart, as a share of the distance to what they show."""

AROUND = (240, 320)
"""Size of renderings from around the splat [px]."""

ROUNDS = 3
"""Times that the splat is rendered anew where it was found."""


@dataclass(frozen=True)
class SharedFeatures:
    """What a photo shares with renderings of a splat: pixels [n 2], and their positions in the splat [n 3]."""

    pixels: Float64[np.ndarray, "n 2"]
    positions: Float64[np.ndarray, "n 3"]


def find_similarity(
    gaussians: Gaussians, views: Views, up: Iterable[Float64[Tensor, " 3"]]
) -> Float64[Tensor, "4 4"] | None:
    """From the coordinates of a splat to those of photos with cameras: [s R | t]. None if features say none; the unit matrix if the cameras fit as they are.

    The splat is rendered from the given cameras, and if that says nothing, from cameras around it.

    Args:
        gaussians: of the splat.
        views: at least two photos.
        up: directions that may be up in the splat.
    """
    photos = [
        _features(image, None if views.hidden is None else ~views.hidden[view])
        for view, image in enumerate(views.images)
    ]
    if sum(len(positions) >= LEAST_EACH for positions, _ in photos) < 2:
        return None
    nothing = torch.eye(4, dtype=torch.float64)
    found = _from_cameras(gaussians, views.cameras, photos, views.cameras)
    if found is None:
        for direction in up:
            found = _from_cameras(
                gaussians, cameras_around(gaussians, direction, AROUND).cameras, photos, views.cameras
            )
            if found is not None:
                break
        else:
            return None
    elif torch.equal(found, nothing):
        return nothing
    for _ in range(ROUNDS):
        again = _from_cameras(move_by(found, gaussians), views.cameras, photos, views.cameras, WITHIN / 2)
        if again is None or torch.equal(again, nothing):
            break
        found = again @ found
    return found


def move_by(similarity: Float64[Tensor, "4 4"], gaussians: Gaussians) -> Gaussians:
    """The Gaussians of one scene in another frame; [s R | t] leads there."""
    scale = scale_of(similarity)
    rigid = similarity.clone()
    rigid[:3, :3] /= scale
    return move_gaussians(rigid, gaussians, scale=scale)


def scale_of(similarity: Float64[Tensor, "4 4"]) -> float:
    """s of [s R | t]."""
    return float(torch.linalg.det(similarity[:3, :3])) ** (1 / 3)


def _from_cameras(
    gaussians: Gaussians,
    eyes: Cameras,
    photos: Sequence[tuple[np.ndarray, np.ndarray]],
    cameras: Cameras,
    within: float = WITHIN,
) -> Float64[Tensor, "4 4"] | None:
    """The similarity that photos share with renderings of a splat from some cameras; the unit matrix if it moves next to nothing in them."""
    shared = _share(photos, [_lift(view, eyes[place]) for place, view in enumerate(render_plain(gaussians, eyes))])
    return _fit(shared, cameras.world_from_camera.numpy(), cameras.intrinsics.numpy(), within * max(cameras.size))


def _features(image: Float32[Tensor, "3 h w"], usable: Tensor | None) -> tuple[np.ndarray, np.ndarray]:
    """Positions [n 2] and descriptors of an image where it is usable."""
    grey = (255 * image.clamp(0, 1).mean(0)).round().to(torch.uint8).numpy()
    positions, descriptors = sift(grey)
    if usable is not None:
        columns, rows = np.minimum(positions.T.astype(int), np.array(grey.shape[::-1])[:, None] - 1)
        seen = usable.numpy()[rows, columns]
        positions, descriptors = positions[seen], descriptors[seen]
    return positions, descriptors


def _lift(rendering: Rendering, camera: Cameras) -> tuple[np.ndarray, np.ndarray]:
    """Positions in the world [n 3] and descriptors of the features of a rendering."""
    depths = rendering.depths[0]
    pixels, descriptors = _features(rendering.images[0], (rendering.alphas[0] >= SEEN_ALPHA) & (depths > 0))
    z = depths.numpy()[tuple(pixels.T[::-1].astype(int))].astype(np.float64)
    rays = np.column_stack((pixels, np.ones(len(pixels)))) @ np.linalg.inv(camera.intrinsics.numpy()).T
    pose = camera.world_from_camera.numpy()
    return (z[:, None] * rays) @ pose[:3, :3].T + pose[:3, 3], descriptors


def _share(
    photos: Sequence[tuple[np.ndarray, np.ndarray]], lifted: Sequence[tuple[np.ndarray, np.ndarray]]
) -> list[SharedFeatures]:
    """What each photo shares with all renderings together."""
    shared = []
    for pixels, descriptors in photos:
        pairs = [(*mutual_matches(descriptors, there), positions) for positions, there in lifted]
        shared.append(
            SharedFeatures(
                np.concatenate([pixels[own] for own, _, _ in pairs]),
                np.concatenate([positions[other] for _, other, positions in pairs]),
            )
        )
    return shared


def _fit(
    shared: Sequence[SharedFeatures], poses: np.ndarray, intrinsics: np.ndarray, within: float
) -> Float64[Tensor, "4 4"] | None:
    """The similarity that most shared features agree with; the unit matrix if it moves them by less than `within` [px] in most photos."""
    taken = {}
    for view, own in enumerate(shared):
        if len(own.pixels) < LEAST_EACH:
            continue
        good, turn, shift, agree = cv2.solvePnPRansac(
            own.positions,
            own.pixels,
            intrinsics[view],
            None,
            reprojectionError=within,
            iterationsCount=500,
            flags=cv2.SOLVEPNP_SQPNP,
        )
        if good and agree is not None and len(agree) >= LEAST_EACH:
            # x_camera = R X + t in the splat. Its directions in the scene are those of the given camera.
            way = poses[view, :3, :3] @ shift.ravel()
            distance = float(
                np.median(
                    np.linalg.norm(own.positions[agree.ravel()] @ cv2.Rodrigues(turn)[0].T + shift.ravel(), axis=1)
                )
            )
            taken[view] = (poses[view, :3, :3] @ cv2.Rodrigues(turn)[0], way, distance)
    best: np.ndarray | None = None
    votes = 0
    for one, other in permutations(taken, 2):
        apart, given = taken[one][1] - taken[other][1], poses[other, :3, 3] - poses[one, :3, 3]
        if np.linalg.norm(apart) < LEAST_BASELINE * taken[one][2] or (scale := (given @ apart) / (apart @ apart)) <= 0:
            continue
        turn = Rotation.from_matrix(taken[one][0]).as_rotvec()
        trial = np.concatenate((turn, poses[one, :3, 3] + scale * taken[one][1], [np.log(scale)]))
        count = sum(
            int((_errors(trial, own, *camera) < within).sum())
            for own, camera in zip(shared, zip(poses, intrinsics, strict=True), strict=True)
        )
        best, votes = (trial, count) if count > votes else (best, votes)
    if best is None:
        return None
    for limit in (within, within / 2):
        kept = [_errors(best, own, pose, k) < limit for own, pose, k in zip(shared, poses, intrinsics, strict=True)]
        if sum(mask.sum() for mask in kept) < LEAST or sum(mask.sum() >= LEAST_EACH for mask in kept) < 2:
            return None
        usable = [
            (SharedFeatures(own.pixels[mask], own.positions[mask]), pose, k)
            for own, mask, pose, k in zip(shared, kept, poses, intrinsics, strict=True)
        ]
        best = _refine(best, usable)
    still = np.median(np.concatenate([_errors(np.zeros(7), *one) for one in usable]))
    similarity = np.eye(4)
    if still >= within:
        similarity[:3, :3], similarity[:3, 3] = np.exp(best[6]) * Rotation.from_rotvec(best[:3]).as_matrix(), best[3:6]
    return torch.from_numpy(similarity)


def _refine(trial: np.ndarray, usable: Sequence[tuple[SharedFeatures, np.ndarray, np.ndarray]]) -> np.ndarray:
    """The motion nearby with the least residuals; those of more than a pixel count less."""

    def residuals(motion: np.ndarray) -> np.ndarray:
        return np.concatenate([_residuals(motion, *one).ravel() for one in usable])

    return np.asarray(least_squares(residuals, trial, loss="soft_l1", x_scale="jac").x)


def _residuals(trial: np.ndarray, own: SharedFeatures, pose: np.ndarray, intrinsics: np.ndarray) -> np.ndarray:
    """By how much positions of a splat, moved by a rotation vector, a translation and a log scale, are imaged beside the pixels that share them [n 2]."""
    world = np.exp(trial[6]) * own.positions @ Rotation.from_rotvec(trial[:3]).as_matrix().T + trial[3:6]
    seen = (world - pose[:3, 3]) @ pose[:3, :3]
    depth = np.where(seen[:, 2:] > 1e-9, seen[:, 2:], 1e-9)
    return np.asarray((seen / depth) @ intrinsics[:2].T - own.pixels)


def _errors(trial: np.ndarray, own: SharedFeatures, pose: np.ndarray, intrinsics: np.ndarray) -> np.ndarray:
    """The lengths of residuals [px]."""
    return np.linalg.norm(_residuals(trial, own, pose, intrinsics), axis=1)

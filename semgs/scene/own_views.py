"""What the Gaussians of a scene show in their own input views: colours, and straight lines."""

from __future__ import annotations

from math import prod

import cv2
import numpy as np
import torch
from jaxtyping import Float, Float64, Int64
from torch import Tensor

from semgs.geometry.cameras import back_project, shrink_cameras
from semgs.geometry.harmonics import colours_from_harmonics
from semgs.rendering.rendering import class_numbers
from semgs.scene.scene_file import SavedScene

SHORTEST_PX = 8.0
"""Shorter line segments are not used."""

ENLARGED = 2
"""The detector sees images with one pixel for each Gaussian, enlarged by this: it smooths them first."""

OFFSET_PX = 0.5 / 0.8
"""The detector shrinks images to 0.8 of their size and counts from the centre of the first pixel there."""


def own_images(scene: SavedScene) -> Float[Tensor, "v rows columns 3"]:
    """What the Gaussians show in their own input views, a pixel for each place; merged scenes, which have gaps there, are rendered."""
    if scene.places is None:
        return own_colours(scene).reshape(*scene.grid, 3)
    images = scene.render(shrink_cameras(scene.cameras, scene.stride)).images
    return images.movedim(-3, -1)


def own_points(scene: SavedScene) -> Float64[Tensor, "v rows columns 3"]:
    """The surface at each place of the input views: the Gaussians, or, in merged scenes and splats, the depth of the views; NaN if it is unknown."""
    if scene.places is None:
        return scene.gaussians.means.double().reshape(*scene.grid, 3)
    depths = scene.depths.double()
    points = back_project(torch.where(depths > 0, depths, torch.nan), scene.cameras)
    return points[:, :: scene.stride, :: scene.stride]


def own_labels(scene: SavedScene) -> Int64[Tensor, "v rows columns"]:
    """The likeliest class at each place of the input views of a scene with classes; -1 for places without a Gaussian, `UNSEEN` for those whose Gaussian has no class."""
    assert scene.gaussians.semantic is not None
    labels, grid = class_numbers(scene.gaussians.semantic.features), scene.grid
    if scene.places is not None:
        every = torch.full((prod(grid),), -1)
        every[scene.places] = labels
        labels = every
    return labels.reshape(grid)


def own_colours(scene: SavedScene) -> Float[Tensor, "g 3"]:
    """The colour of each Gaussian as its own input view sees it, 0..1.

    Args:
        scene: with all of its Gaussians.
    """
    centres = scene.cameras.centres[scene.own_views]
    directions = torch.nn.functional.normalize(scene.gaussians.means.double() - centres, dim=-1)
    features = scene.gaussians.colour.features
    return colours_from_harmonics(features, directions.to(features)).clamp(max=1)


def lines(scene: SavedScene) -> Float64[Tensor, "n 3"]:
    """The straight lines that the input views see: for each, the normal of the plane through it and the camera, of the length of the line [px].

    A line in space is orthogonal to the normal. The lines are found by LSD (von Gioi et al., PAMI 2010).

    Args:
        scene: with all of its Gaussians.
    """
    images, stride = (255 * own_images(scene)).round().to(torch.uint8).numpy(), scene.stride
    detector = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD)
    found = [torch.zeros(0, 3, dtype=torch.float64)]
    for view, image in enumerate(images):
        grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
        grey = cv2.resize(grey, None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_CUBIC)
        segments = detector.detect(grey)[0]
        if segments is None:
            continue
        ends = torch.from_numpy(np.asarray(segments, np.float64).reshape(-1, 2, 2) + OFFSET_PX) * (stride / ENLARGED)
        lengths = (ends[:, 0] - ends[:, 1]).norm(dim=-1)
        ends, lengths = ends[lengths >= SHORTEST_PX], lengths[lengths >= SHORTEST_PX]
        rays = torch.nn.functional.pad(ends, (0, 1), value=1.0) @ torch.linalg.inv(scene.cameras.intrinsics[view]).T
        normals = torch.nn.functional.normalize(torch.linalg.cross(rays[:, 0], rays[:, 1]), dim=-1)
        found.append(lengths[:, None] * normals @ scene.cameras.world_from_camera[view, :3, :3].T)
    return torch.cat(found)

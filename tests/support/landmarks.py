"""Landmarks: bright spots drawn at known positions, and where they are found again. Independent of the project's own code."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

POINTS = np.array([[x, y, 0.25 * np.sin(3 * x + y)] for x in (-1.05, -0.35, 0.35, 1.05) for y in (-0.6, 0.0, 0.6)])
"""Twelve world points, within reach of cameras a few metres away."""


def drawn(size: tuple[int, int], positions: np.ndarray, sigma: float = 2.5) -> np.ndarray:
    """A dark picture uint8 [h w 3] with a spot at each (x, y) [px]; the centre of the first pixel is at (0.5, 0.5)."""
    picture = np.zeros(size)
    for u, v in positions:
        across = np.exp(-((np.arange(size[1]) + 0.5 - u) ** 2) / (2 * sigma**2))
        down = np.exp(-((np.arange(size[0]) + 0.5 - v) ** 2) / (2 * sigma**2))
        picture += np.outer(down, across)
    return np.repeat(np.round(30 + 220 * picture.clip(0, 1)).astype(np.uint8)[..., None], 3, axis=-1)


def found(image: torch.Tensor, expected: np.ndarray, reach: tuple[float, float] = (10, 10)) -> np.ndarray:
    """Where the spots of a picture [3 h w] are: their centres of brightness within `reach` (x, y) of the `expected` positions [px]."""
    picture = (image[0].double().numpy() * 255 - 30).clip(0)
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]] + 0.5
    centres = []
    for u, v in expected:
        weight = picture * ((np.abs(x - u) < reach[0]) & (np.abs(y - v) < reach[1]))
        centres.append(((weight * x).sum() / weight.sum(), (weight * y).sum() / weight.sum()))
    return np.array(centres)


def looking(eye: Sequence[float], at: Sequence[float], roll: float = 0.1) -> np.ndarray:
    """World from camera, OpenCV axes, of a camera at `eye` that looks at `at`, rolled by `roll` rad."""
    forward = np.subtract(at, eye) / np.linalg.norm(np.subtract(at, eye))
    right = np.cross([0.0, 1.0, 0.0], forward)
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    c, s = np.cos(roll), np.sin(roll)
    pose = np.eye(4)
    pose[:3] = np.stack((c * right + s * down, c * down - s * right, forward, np.asarray(eye, dtype=float)), axis=1)
    return pose

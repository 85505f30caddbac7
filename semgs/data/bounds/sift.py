"""SIFT features of an image, and which of two images are the same."""

from __future__ import annotations

import cv2
import numpy as np

LONGEST_SIDE = 480
"""Features are detected at this size [px]: it takes a few tens of milliseconds an image, and finds plenty."""

FEATURES = 1500
RATIO = 0.8


def sift(grey: np.ndarray, most: int = FEATURES) -> tuple[np.ndarray, np.ndarray]:
    """Positions [n 2] of the features of an image in grey, the corner of the first pixel at (0, 0) [px], and their descriptors [n 128]."""
    keypoints, descriptors = cv2.SIFT.create(nfeatures=most).detectAndCompute(grey, None)  # type: ignore[call-overload]
    # OpenCV's positions have the first pixel's centre at 0.
    positions = np.array([point.pt for point in keypoints], dtype=np.float64).reshape(-1, 2) + 0.5
    return positions, np.zeros((0, 128), np.float32) if descriptors is None else descriptors


def mutual_matches(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of descriptors that are each other's nearest neighbours and pass the ratio test."""
    none = np.zeros(0, dtype=np.int64)
    if len(first) < 2 or len(second) < 2:
        return none, none
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    forth = {
        best.queryIdx: best.trainIdx
        for best, next_best in matcher.knnMatch(first, second, k=2)
        if best.distance < RATIO * next_best.distance
    }
    back = {match.queryIdx: match.trainIdx for match in matcher.match(second, first)}
    pairs = np.array([(i, j) for i, j in forth.items() if back[j] == i], dtype=np.int64).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]

"""Fisheye lenses: OpenCV's and COLMAP's OPENCV_FISHEYE, undone to a pinhole on reading as other lenses are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import cv2
import numpy as np

from semgs.data.lens import HALF, AbstractLens, matrix, shifted


@final
@dataclass(frozen=True)
class FisheyeLens(AbstractLens):
    """A lens whose rays at an angle a from the axis come out at f a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8) from the principal point.

    Attributes:
        fisheye: (k1, k2, k3, k4).
        as_toolbox: undo it as ScanNet++'s toolbox does: cx and cy, which count from the corner of the first pixel, are handed to
            OpenCV, which counts from its centre, and the pinhole's principal point is put in the middle of the picture. What
            comes out is off by half a pixel less half the local enlargement: little in the middle, most in the corners.

    Raises:
        ValueError: as `AbstractLens`.
    """

    fisheye: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    as_toolbox: bool = False

    @property
    def coefficients(self) -> tuple[float, ...]:
        """(k1, k2, k3, k4)."""
        return self.fisheye

    @property
    def is_pinhole(self) -> bool:
        """Even without any k it is none."""
        return False

    @property
    def intrinsics(self) -> np.ndarray:
        """K [3 3] of the pictures as they are read: after undistortion, at the same size [px].

        The widest pinhole in which every pixel has been seen, as OpenCV estimates it (balance = 0).
        """
        size = self.size[::-1]
        ideal = cv2.fisheye.estimateNewCameraMatrixForUndistortRectify(
            self._opencv_matrix, np.array(self.fisheye), size, np.eye(3), balance=0.0
        )
        centre = (size[0] / 2, size[1] / 2) if self.as_toolbox else (ideal[0, 2] + HALF, ideal[1, 2] + HALF)
        return matrix((ideal[0, 0], ideal[1, 1]), centre)

    @property
    def invents_nothing(self) -> bool:
        """The toolbox does not ask whether all pixels have been seen."""
        return not self.as_toolbox

    def directions(self, positions: np.ndarray) -> np.ndarray:
        """Camera-frame directions [n 3], z = 1, of positions [n 2] in the picture as it is stored [px]."""
        if not len(positions):
            return np.zeros((0, 3))
        points = np.asarray(positions, dtype=np.float64)[:, None] - self._half
        plane = cv2.fisheye.undistortPoints(points, self._opencv_matrix, np.array(self.fisheye))[:, 0]
        return np.concatenate((plane, np.ones((len(plane), 1))), axis=1)

    def sources(self, pinhole: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Where in the stored picture the pixels of a pinhole K [3 3] of (height, width) come from, in OpenCV's positions."""
        x, y = cv2.fisheye.initUndistortRectifyMap(
            self._opencv_matrix,
            np.array(self.fisheye),
            np.eye(3),
            shifted(pinhole, -self._half),
            size[::-1],
            cv2.CV_32FC1,
        )
        return np.asarray(x), np.asarray(y)

    @property
    def _opencv_matrix(self) -> np.ndarray:
        """K as it is handed to OpenCV."""
        return matrix(self.focal, (self.centre[0] - self._half, self.centre[1] - self._half))

    @property
    def _half(self) -> float:
        """What lies between our pixel positions and those that are handed to OpenCV [px]."""
        return 0.0 if self.as_toolbox else HALF

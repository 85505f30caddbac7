"""Fisheye lenses (OPENCV_FISHEYE of OpenCV and COLMAP), undistorted to a pinhole on reading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, final

import cv2
import numpy as np

from semgs.data.cameras.lens import HALF, AbstractOpenCVLens, matrix


@final
@dataclass(frozen=True)
class FisheyeLens(AbstractOpenCVLens):
    """A lens that images a ray at the angle a from the axis at f a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8) from the principal point.

    Attributes:
        fisheye: (k1, k2, k3, k4).
        as_toolbox: undistort like ScanNet++'s toolbox. It passes cx and cy, which count from the corner of the first pixel, to OpenCV,
            which counts from its centre, and puts the pinhole's principal point in the middle of the image. The result is off by half a
            pixel less half the local magnification: little in the middle, most in the corners.

    Raises:
        ValueError: see `AbstractLens`.
    """

    fisheye: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    as_toolbox: bool = False
    is_pinhole: ClassVar[bool] = False
    _model: ClassVar[Any] = cv2.fisheye

    @property
    def coefficients(self) -> tuple[float, ...]:
        """(k1, k2, k3, k4)."""
        return self.fisheye

    @property
    def intrinsics(self) -> np.ndarray:
        """K [3 3] of the images after undistortion, at the same size [px].

        It is the widest pinhole without unseen pixels, as OpenCV estimates it (balance = 0).
        """
        size = self.size[::-1]
        ideal = cv2.fisheye.estimateNewCameraMatrixForUndistortRectify(
            self._opencv_matrix, np.array(self.fisheye), size, np.eye(3), balance=0.0
        )
        centre = (size[0] / 2, size[1] / 2) if self.as_toolbox else (ideal[0, 2] + HALF, ideal[1, 2] + HALF)
        return matrix((ideal[0, 0], ideal[1, 1]), centre)

    def directions(self, positions: np.ndarray) -> np.ndarray:
        """Directions in the camera [n 3], z = 1, of positions [n 2] in the stored image [px]."""
        if not len(positions):
            return np.zeros((0, 3))
        points = np.asarray(positions, dtype=np.float64)[:, None] - self._half
        plane = cv2.fisheye.undistortPoints(points, self._opencv_matrix, np.array(self.coefficients))[:, 0]
        return np.concatenate((plane, np.ones((len(plane), 1))), axis=1)

    @property
    def invents_nothing(self) -> bool:
        """The toolbox allows unseen pixels."""
        return not self.as_toolbox

    @property
    def _half(self) -> float:
        """Our pixel positions minus those passed to OpenCV [px]."""
        return 0.0 if self.as_toolbox else HALF

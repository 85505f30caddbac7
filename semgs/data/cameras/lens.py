"""Lenses: distortion models, undistorted to a pinhole on reading."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, final

import cv2
import numpy as np

from semgs.files.images.pictures import MOST_PIXELS

HALF = 0.5
"""OpenCV's first pixel centre is at 0, ours at 0.5. Subtracted from cx, cy and positions before calls to OpenCV, and added after."""

FOCAL = (0.01, 100.0)
"""Allowed focal lengths relative to the longer side: angles of view from 179 to half a degree."""

NORMALISED = 10.0
"""Refused focal lengths below this are probably divided by width and height."""

FURTHEST_CENTRE = 10.0
"""Largest distance of the principal point from the image corner, relative to the longer side."""

_STEPS, _CLOSE, _FOUND = 50, 1e-10, 1e-7
"""Newton's method for rays ends after so many steps, or this close, and has found them if they are closer than the last [image at focal length 1]."""

_STEP = 1e-6
"""Derivatives are differences over this much to both sides."""

_GRID = 32
"""Distortion is checked at this many places along each side."""

_MOST_ENLARGED = 4.0
"""Distortions that would magnify the image more than this are refused."""

_MOST_REDUCED = 4.0
"""So are those that would make its middle smaller than this: lenses of almost 180 degrees and more, which no pinhole shows."""


@dataclass(frozen=True)
class AbstractLens(ABC):
    """A camera as its file describes it, before undistortion.

    Attributes:
        size: (height, width) of its images [px].
        focal: (fx, fy) [px].
        centre: (cx, cy) [px], the centre of the first pixel at (0.5, 0.5).

    Raises:
        ValueError: the size is not positive or beyond `MOST_PIXELS`, a number is not finite, a focal length or the principal point
            is not within `FOCAL` and `FURTHEST_CENTRE`, or the distortion cannot be undone over the whole image.
    """

    size: tuple[int, int]
    focal: tuple[float, float]
    centre: tuple[float, float]

    def __post_init__(self) -> None:
        if min(self.size) < 1 or not min(self.focal) > 0:
            raise ValueError(
                f"size {self.size} (height, width) and focal lengths {self.focal} px; expected positive ones"
            )
        if not np.isfinite((*self.focal, *self.centre, *self.coefficients)).all():
            raise ValueError(
                f"focal {self.focal}, centre {self.centre}, distortion {self.coefficients}; expected finite numbers"
            )
        if self.size[0] * self.size[1] > MOST_PIXELS:
            raise ValueError(f"size {self.size} (height, width); expected at most {MOST_PIXELS:,} pixels")
        longer = max(self.size)
        if not all(FOCAL[0] * longer <= focal <= FOCAL[1] * longer for focal in self.focal):
            hint = "; they look as if divided by the image size" if max(self.focal) < NORMALISED else ""
            raise ValueError(
                f"focal lengths {self.focal} px; expected {FOCAL[0]:g} to {FOCAL[1]:g} times the longer side of {longer} px{hint}"
            )
        if max(map(abs, self.centre)) > FURTHEST_CENTRE * longer:
            raise ValueError(
                f"principal point {self.centre} px; expected it within {FURTHEST_CENTRE:g} times the longer side of {longer} px"
            )
        if not self.is_pinhole and not self._can_be_undone():
            raise ValueError(f"the distortion {self.coefficients} cannot be undone over the whole picture")

    @property
    @abstractmethod
    def coefficients(self) -> tuple[float, ...]:
        """The distortion coefficients."""

    @property
    @abstractmethod
    def is_pinhole(self) -> bool:
        """Whether there is no distortion."""

    @property
    @abstractmethod
    def intrinsics(self) -> np.ndarray:
        """K [3 3] of the images after undistortion, at the same size [px]."""

    @property
    @abstractmethod
    def invents_nothing(self) -> bool:
        """Whether every undistorted pixel has to come from a pixel of the stored image."""

    @abstractmethod
    def directions(self, positions: np.ndarray) -> np.ndarray:
        """Directions in the camera [n 3], z = 1, of positions [n 2] in the stored image [px]."""

    @abstractmethod
    def sources(self, pinhole: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Where the pixels of a pinhole K [3 3] of (height, width) come from in the stored image, in OpenCV's positions."""

    def maps(self) -> tuple[np.ndarray, np.ndarray]:
        """For every undistorted pixel its (x, y) in the stored image, in OpenCV's positions, float32 [h w] each."""
        return self.sources(self.intrinsics, self.size)

    def undistorted(
        self, values: np.ndarray, maps: tuple[np.ndarray, np.ndarray], *, nearest: bool = False
    ) -> np.ndarray:
        """An image [h w 3] or map [h w], undistorted by `maps()`; interpolated, or from the nearest pixel."""
        method = cv2.INTER_NEAREST if nearest else cv2.INTER_LINEAR
        return np.asarray(cv2.remap(values, *maps, method, borderMode=cv2.BORDER_REPLICATE))

    def empty(self, maps: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Undistorted pixels [h w] that the stored image has no colour for: their source, by `maps()`, is more than a pixel outside of it, or the model
        folds over there and images another ray, too, in the same place, as in the corners of wide lenses with k1 alone."""
        (x, y), (height, width) = maps, self.size
        outside = (x < -1) | (x > width) | (y < -1) | (y > height)
        return outside | _folded(x, y) if _folded(*self._coarse_sources()).any() else outside

    def _coarse_sources(self) -> tuple[np.ndarray, np.ndarray]:
        """As `maps`, at `_GRID` places along each side."""
        height, width = self.size
        return self.sources(np.diag((_GRID / width, _GRID / height, 1.0)) @ self.intrinsics, (_GRID, _GRID))

    def _can_be_undone(self) -> bool:
        """Whether every undistorted pixel has exactly one source in the image: the model does not fold over before the edge."""
        if not np.isfinite(self.intrinsics).all() or np.diagonal(self.intrinsics).min() <= 0:
            return False
        enlarged = np.diagonal(self.intrinsics)[:2] / self.focal
        if (enlarged < 1 / _MOST_REDUCED).any():
            return False
        if not self.invents_nothing:
            return True
        if (enlarged > _MOST_ENLARGED).any():
            return False
        height, width = self.size
        x, y = self._coarse_sources()
        slack = 0.01 * max(self.size)  # OpenCV's pinhole is only as accurate as its grid of points
        inside = min(x.min(), y.min()) > -slack and x.max() < width + slack and y.max() < height + slack
        return bool(inside and np.diff(x, axis=1).min() > 0 and np.diff(y, axis=0).min() > 0)


@dataclass(frozen=True)
class AbstractOpenCVLens(AbstractLens):
    """A camera whose distortion OpenCV removes."""

    @property
    @abstractmethod
    def _model(self) -> Any:
        """OpenCV's functions for this model of distortion."""

    @property
    @abstractmethod
    def _half(self) -> float:
        """Our pixel positions minus those passed to OpenCV [px]."""

    def sources(self, pinhole: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Where the pixels of a pinhole K [3 3] of (height, width) come from in the stored image, in OpenCV's positions."""
        target = shift_principal_point(pinhole, -self._half)
        x, y = self._model.initUndistortRectifyMap(
            self._opencv_matrix, np.array(self.coefficients), np.eye(3), target, size[::-1], cv2.CV_32FC1
        )
        return np.asarray(x), np.asarray(y)

    @property
    def _opencv_matrix(self) -> np.ndarray:
        """K as passed to OpenCV."""
        return matrix(self.focal, (self.centre[0] - self._half, self.centre[1] - self._half))


@final
@dataclass(frozen=True)
class Lens(AbstractOpenCVLens):
    """A pinhole with the distortion of OpenCV's radial-tangential model.

    Attributes:
        distortion: (k1, k2, p1, p2, k3), all 0 for a pinhole.

    Raises:
        ValueError: see `AbstractLens`.
    """

    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)
    invents_nothing: ClassVar[bool] = True
    _model: ClassVar[Any] = cv2
    _half: ClassVar[float] = HALF

    @property
    def coefficients(self) -> tuple[float, ...]:
        """(k1, k2, p1, p2, k3)."""
        return self.distortion

    def directions(self, positions: np.ndarray) -> np.ndarray:
        """Directions in the camera [n 3], z = 1, of positions [n 2] in the stored image [px]; NaN if the lens images no ray there.

        OpenCV's own function stops after five steps, which at the edges of a wide lens is pixels too early.
        """
        seen = (np.asarray(positions, dtype=np.float64).reshape(-1, 2) - self.centre) / self.focal
        return np.column_stack((seen, np.ones(len(seen)))) if self.is_pinhole else rays_seen_at(seen, self._image)

    def _image(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where the rays (x, y, 1) are in the image at focal length 1."""
        k1, k2, p1, p2, k3 = self.distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)

    @property
    def is_pinhole(self) -> bool:
        """Whether all coefficients are 0."""
        return not any(self.distortion)

    @property
    def intrinsics(self) -> np.ndarray:
        """K [3 3] of the images after undistortion, at the same size [px].

        It is the widest pinhole without unseen pixels (OpenCV's optimal camera matrix with alpha = 0).
        """
        if self.is_pinhole:
            return matrix(self.focal, self.centre)
        height, width = self.size
        ideal, _ = cv2.getOptimalNewCameraMatrix(
            self._opencv_matrix, np.array(self.distortion), (width, height), 0, (width, height)
        )
        return matrix((ideal[0, 0], ideal[1, 1]), (ideal[0, 2] + HALF, ideal[1, 2] + HALF))


def _folded(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Where a map of positions [h w] mirrors its surroundings."""
    if min(x.shape) < 2:
        return np.zeros(x.shape, np.bool_)
    (x_down, x_right), (y_down, y_right) = np.gradient(x), np.gradient(y)
    return x_right * y_down <= x_down * y_right


def rays_seen_at(
    seen: np.ndarray, image: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
) -> np.ndarray:
    """The rays (x, y, 1) [n 3] that a lens images at places [n 2] of the image at focal length 1; NaN where it images none before its model folds over.

    Newton's method, from the ray that an ideal pinhole would see.

    Args:
        seen: the places.
        image: from x and y of rays to their places.
    """
    x, y = seen[:, 0].copy(), seen[:, 1].copy()

    def slopes() -> tuple[np.ndarray, ...]:
        return tuple(
            (high - low) / (2 * _STEP)
            for plus, minus in (
                (image(x + _STEP, y), image(x - _STEP, y)),
                (image(x, y + _STEP), image(x, y - _STEP)),
            )
            for high, low in zip(plus, minus, strict=True)
        )

    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            u, v = image(x, y)
            error_u, error_v = u - seen[:, 0], v - seen[:, 1]
            if np.hypot(error_u, error_v).max(initial=0.0) < _CLOSE:
                break
            ux, vx, uy, vy = slopes()
            determinant = ux * vy - uy * vx
            x = x - (vy * error_u - uy * error_v) / determinant
            y = y - (ux * error_v - vx * error_u) / determinant
        u, v = image(x, y)
        ux, vx, uy, vy = slopes()
        found = np.hypot(u - seen[:, 0], v - seen[:, 1]) < _FOUND
        # Beyond its fold a model mirrors, and further out it turns to the other side of the image.
        found &= (ux * vy > uy * vx) & (x * seen[:, 0] + y * seen[:, 1] > -_FOUND)
    plane = np.where(found[:, None], np.stack((x, y), axis=1), np.nan)
    return np.concatenate((plane, np.ones((len(plane), 1))), axis=1)


def matrix(focal: tuple[float, float], centre: tuple[float, float]) -> np.ndarray:
    """K from focal lengths and principal point."""
    return np.array([[focal[0], 0.0, centre[0]], [0.0, focal[1], centre[1]], [0.0, 0.0, 1.0]])


def shift_principal_point(pinhole: np.ndarray, pixels: float) -> np.ndarray:
    """K [3 3] with its principal point moved along both axes [px]."""
    return pinhole + pixels * np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])


def carry_over(values: np.ndarray, source: AbstractLens, target: AbstractLens) -> np.ndarray:
    """A map [h w] of one pinhole as seen by another with the same pose; 0 outside.

    Each pixel gets the value of the pixel that its ray hits. Values are not interpolated, so z-depths stay valid.

    Args:
        values: the map of `source`, perhaps at another size.
        source: the pinhole of the map.
        target: the pinhole that should see it.
    """
    (height, width), (rows, columns) = target.size, values.shape
    x = (np.arange(width) + HALF - target.centre[0]) / target.focal[0] * source.focal[0] + source.centre[0]
    y = (np.arange(height) + HALF - target.centre[1]) / target.focal[1] * source.focal[1] + source.centre[1]
    column = np.floor(x * (columns / source.size[1])).astype(np.int64)
    row = np.floor(y * (rows / source.size[0])).astype(np.int64)
    inside = ((row >= 0) & (row < rows))[:, None] & (column >= 0) & (column < columns)
    met = values[row.clip(0, rows - 1)[:, None], column.clip(0, columns - 1)]
    return np.where(inside, met, values.dtype.type(0))

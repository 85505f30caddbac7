"""Lenses of COLMAP that OpenCV does not have, undistorted to a pinhole on reading, by COLMAP's own formulas.

Each formula takes the ray (x, y, 1) to its place in the image at focal length 1. With r^2 = x^2 + y^2, COLMAP's names of the coefficients in its order, and
(a, b) = (x, y) atan(r) / r for fisheye lenses (https://github.com/colmap/colmap/blob/main/src/colmap/sensor/models.h):

    FULL_OPENCV          (x, y) (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6), and tangential distortion p1, p2
    FOV                  (x, y) atan(2 r tan(omega / 2)) / (r omega)
    DIVISION             (x, y) / (1 + k r'^2) turned round: 1 + k r'^2 divides the place in the image
    EUCM                 (x, y) / (alpha sqrt(beta r^2 + 1) + 1 - alpha)
    THIN_PRISM_FISHEYE   radial k1..k4, tangential p1, p2 and prism sx1, sy1, all of (a, b)
    RAD_TAN_THIN_PRISM_FISHEYE   radial k0..k5 of atan(r), then tangential p0, p1 and prism s0..s3 of the result (Project Aria's lens)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar, final

import numpy as np

from semgs.data.cameras.lens import HALF, AbstractLens, matrix, rays_seen_at

Formula = Callable[[np.ndarray, np.ndarray, tuple[float, ...]], tuple[np.ndarray, np.ndarray]]
"""From (x, y) of rays and coefficients to the place in the image at focal length 1."""

_ALONG = 65
"""Positions along each side of the image that decide how wide the pinhole is."""


def _full_opencv(x: np.ndarray, y: np.ndarray, values: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    k1, k2, p1, p2, k3, k4, k5, k6 = values
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)


def _fov(x: np.ndarray, y: np.ndarray, values: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    (omega,) = values
    if abs(omega) < 1e-6:  # then it is a pinhole, to the accuracy of float64
        return x, y
    r, wide = np.hypot(x, y), 2 * np.tan(omega / 2)
    factor = np.where(r > 1e-9, np.arctan(wide * r) / np.maximum(r, 1e-9), wide) / omega
    return x * factor, y * factor


def _division(x: np.ndarray, y: np.ndarray, values: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    (k,) = values
    # r' / (1 + k r'^2) = r, solved for the r' that is r where k is 0.
    factor = 2 / (1 + np.sqrt(1 - 4 * k * (x * x + y * y)))
    return x * factor, y * factor


def _eucm(x: np.ndarray, y: np.ndarray, values: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    alpha, beta = values
    factor = 1 / (alpha * np.sqrt(beta * (x * x + y * y) + 1) + 1 - alpha)
    return x * factor, y * factor


def _thin_prism(x: np.ndarray, y: np.ndarray, values: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    k1, k2, p1, p2, k3, k4, sx1, sy1 = values
    a, b = _equidistant(x, y)
    r2 = a * a + b * b
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)))
    return (
        a * radial + 2 * p1 * a * b + p2 * (r2 + 2 * a * a) + sx1 * r2,
        b * radial + 2 * p2 * a * b + p1 * (r2 + 2 * b * b) + sy1 * r2,
    )


def _aria(x: np.ndarray, y: np.ndarray, values: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
    *radials, p0, p1, s0, s1, s2, s3 = values
    a, b = _equidistant(x, y)
    angle2, radial = a * a + b * b, np.ones_like(a)
    for power, k in enumerate(radials, 1):
        radial = radial + k * angle2**power
    a, b = a * radial, b * radial
    r2, tangential = a * a + b * b, 2 * (a * p0 + b * p1)
    return (
        a + tangential * a + r2 * p0 + s0 * r2 + s1 * r2 * r2,
        b + tangential * b + r2 * p1 + s2 * r2 + s3 * r2 * r2,
    )


def _equidistant(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rays as an ideal fisheye images them."""
    r = np.hypot(x, y)
    factor = np.where(r > 1e-9, np.arctan(r) / np.maximum(r, 1e-9), 1.0)
    return x * factor, y * factor


FORMULAS: MappingProxyType[str, tuple[int, Formula]] = MappingProxyType(
    {
        "FULL_OPENCV": (8, _full_opencv),
        "FOV": (1, _fov),
        "DIVISION": (1, _division),
        "EUCM": (2, _eucm),
        "THIN_PRISM_FISHEYE": (8, _thin_prism),
        "RAD_TAN_THIN_PRISM_FISHEYE": (12, _aria),
    }
)
"""The number of coefficients and the formula of each lens, by COLMAP's name."""


@final
@dataclass(frozen=True)
class FormulaLens(AbstractLens):
    """A lens of one of the `FORMULAS`.

    Attributes:
        model: its name.
        values: its coefficients, in COLMAP's order.

    Raises:
        ValueError: there is no such model, or it has another number of coefficients; or see `AbstractLens`.
    """

    model: str = "FULL_OPENCV"
    values: tuple[float, ...] = (0.0,) * 8
    is_pinhole: ClassVar[bool] = False
    invents_nothing: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if self.model not in FORMULAS or len(self.values) != FORMULAS[self.model][0]:
            raise ValueError(
                f"lens {self.model} with {len(self.values)} coefficients; expected "
                + ", ".join(f"{name} with {count}" for name, (count, _) in FORMULAS.items())
            )
        super().__post_init__()

    @property
    def coefficients(self) -> tuple[float, ...]:
        """The coefficients."""
        return self.values

    @property
    def intrinsics(self) -> np.ndarray:
        """K [3 3] of the images after undistortion, at the same size [px].

        It is the widest pinhole without unseen pixels: the largest upright rectangle of rays inside of those that the sides of the image see. NaN if a side sees no ray.
        """
        height, width = self.size
        across, down = np.linspace(0, width, _ALONG), np.linspace(0, height, _ALONG)
        left, right, top, bottom = (
            self.directions(np.stack(np.broadcast_arrays(x, y), axis=1))
            for x, y in ((0.0, down), (float(width), down), (across, 0.0), (across, float(height)))
        )
        x_range, y_range = (left[:, 0].max(), right[:, 0].min()), (top[:, 1].max(), bottom[:, 1].min())
        fx, fy = width / (x_range[1] - x_range[0]), height / (y_range[1] - y_range[0])
        return matrix((fx, fy), (-fx * x_range[0], -fy * y_range[0]))

    def directions(self, positions: np.ndarray) -> np.ndarray:
        """Directions in the camera [n 3], z = 1, of positions [n 2] in the stored image [px]; NaN if the lens images no ray there."""
        return rays_seen_at(
            (np.asarray(positions, dtype=np.float64).reshape(-1, 2) - self.centre) / self.focal, self._image
        )

    def sources(self, pinhole: np.ndarray, size: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Where the pixels of a pinhole K [3 3] of (height, width) come from in the stored image, in OpenCV's positions."""
        column, row = np.arange(size[1]) + HALF, np.arange(size[0]) + HALF
        x = np.broadcast_to((column - pinhole[0, 2]) / pinhole[0, 0], size)
        y = np.broadcast_to(((row - pinhole[1, 2]) / pinhole[1, 1])[:, None], size)
        with np.errstate(invalid="ignore"):
            u, v = self._image(x, y)
        in_x, in_y = self.focal[0] * u + self.centre[0] - HALF, self.focal[1] * v + self.centre[1] - HALF
        return in_x.astype(np.float32), in_y.astype(np.float32)

    def _image(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where the rays (x, y, 1) are in the image at focal length 1."""
        return FORMULAS[self.model][1](x, y, self.values)

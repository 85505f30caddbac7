"""Camera effects: exposure, white balance, tone, vignette, blur, noise, JPEG. They change images only, not labels or depths."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, UInt8


@dataclass(frozen=True)
class Film:
    """Settings of a camera.

    Attributes:
        exposure: factor from radiance to sensor values in 0..1.
        balance: factors for red, green and blue.
        contrast: exponent of the tone curve, about 1.
        curve: weight of an S-shaped tone curve, 0..1.
        vignette: share of light lost in the corners.
        blur: standard deviation of the blur, as a share of the image's longer side.
        motion: maximum length of motion blur, as a share of the image's longer side.
        noise: standard deviation of the noise, on values of 0..1.
        jitter: relative standard deviation of the exposure between frames.
        quality: of the JPEG compression, None for none.
    """

    exposure: float
    balance: tuple[float, float, float]
    contrast: float
    curve: float
    vignette: float
    blur: float
    motion: float
    noise: float
    jitter: float
    quality: int | None


def draw_film(rng: np.random.Generator, radiance: Float32[np.ndarray, "h w 3"]) -> Film:
    """Random settings whose exposure roughly suits a first frame, and whose white balance removes part of the light's colour."""
    grey = radiance.mean(axis=-1)
    level = 0.65 * float(np.median(grey)) + 0.35 * float(np.quantile(grey, 0.9))
    mean = np.maximum(radiance.reshape(-1, 3).mean(axis=0), 1e-4)
    undone = (mean.mean() / mean) ** rng.uniform(0.2, 0.8) * rng.uniform(0.95, 1.05, 3)
    red, green, blue = (float(x) for x in undone)
    return Film(
        exposure=float(np.exp(rng.uniform(np.log(0.14), np.log(0.65)))) / max(level, 1e-3),
        balance=(red, green, blue),
        contrast=float(rng.uniform(0.85, 1.25)),
        curve=float(rng.choice([0.0, rng.uniform(0.0, 1.0)])),
        vignette=float(rng.choice([0.0, rng.uniform(0.05, 0.4)])),
        blur=float(rng.choice([0.0, rng.uniform(0.0005, 0.004)])),
        motion=float(rng.choice([0.0, 0.0, rng.uniform(0.002, 0.012)])),
        noise=float(rng.uniform(0.0, 0.025)),
        jitter=float(rng.choice([0.0, rng.uniform(0.0, 0.05)])),
        quality=int(rng.integers(40, 96)) if rng.random() < 0.7 else None,
    )


def develop(rng: np.random.Generator, film: Film, radiance: Float32[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
    """The sRGB image of a frame."""
    height, width = radiance.shape[:2]
    longer = max(height, width)
    gains = np.array(film.balance, np.float32) * np.float32(film.exposure * (1 + film.jitter * rng.standard_normal()))
    sensor = radiance * gains
    if film.blur or film.motion:
        sensor = np.minimum(sensor, 4.0)
    if film.motion:
        kernel = _streak(rng.uniform(0, film.motion * longer), rng.normal(0, 0.6))
        sensor = cv2.filter2D(sensor, -1, kernel, borderType=cv2.BORDER_REPLICATE)
    if film.blur:
        sensor = cv2.GaussianBlur(sensor, (0, 0), max(0.25, film.blur * longer))
    if film.vignette:
        rows = (np.arange(height, dtype=np.float32) + 0.5) / height * 2 - 1
        columns = (np.arange(width, dtype=np.float32) + 0.5) / width * 2 - 1
        sensor = sensor * (1 - np.float32(film.vignette / 2) * (rows[:, None] ** 2 + columns**2))[..., None]
    rolled = np.where(sensor < 0.7, sensor, 0.7 + 0.3 * (1 - np.exp(-(np.maximum(sensor, 0.7) - 0.7) / 0.3)))
    picture = np.clip(rolled, 0, 1) ** np.float32(film.contrast / 2.2)
    if film.curve:
        picture = picture + np.float32(film.curve) * (picture * picture * (3 - 2 * picture) - picture)
    if film.noise:
        noise = rng.standard_normal(picture.shape, dtype=np.float32)
        picture = picture + np.float32(film.noise) * noise
    pixels = np.clip(picture * 255 + 0.5, 0, 255).astype(np.uint8)
    if film.quality is None:
        return pixels
    _, coded = cv2.imencode(".jpg", pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, film.quality])
    kept = cv2.imdecode(coded, cv2.IMREAD_COLOR)
    assert kept is not None
    return np.ascontiguousarray(kept[..., ::-1])


def _streak(length: float, angle: float) -> Float32[np.ndarray, "k k"]:
    """Blur kernel of a straight motion of `length` pixels, from 16 points along it."""
    half = int(np.ceil(length / 2)) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    for share in (np.arange(16) + 0.5) / 16 - 0.5:
        x, y = half + share * length * np.cos(angle), half + share * length * np.sin(angle)
        column, row = int(x), int(y)
        a, b = x - column, y - row
        kernel[row : row + 2, column : column + 2] += np.outer((1 - b, b), (1 - a, a)).astype(np.float32)
    return kernel / kernel.sum()

"""What a real camera does to a picture: exposure, white balance, response, vignette, blur, noise. Labels and depth know nothing of it."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, UInt8


@dataclass(frozen=True)
class Lens:
    """A camera's character.

    Attributes:
        exposure: factor from radiance to the sensor's 0..1.
        balance: factors of red, green and blue.
        contrast: exponent on the developed picture, about 1.
        vignette: share of light lost in the corners.
        blur: standard deviation of its blur in shares of the image's longer side.
        noise: standard deviation of its noise at mid grey.
        jitter: relative change of exposure from frame to frame.
    """

    exposure: float
    balance: tuple[float, float, float]
    contrast: float
    vignette: float
    blur: float
    noise: float
    jitter: float


def draw_lens(rng: np.random.Generator, radiance: Float32[np.ndarray, "h w 3"]) -> Lens:
    """A camera whose exposure suits a first frame, more or less, and whose white balance undoes most of the light's colour."""
    grey = radiance.mean(axis=-1)
    level = 0.65 * float(np.median(grey)) + 0.35 * float(np.quantile(grey, 0.9))
    mean = np.maximum(radiance.reshape(-1, 3).mean(axis=0), 1e-4)
    undone = (mean.mean() / mean) ** rng.uniform(0.2, 0.8) * rng.uniform(0.95, 1.05, 3)
    red, green, blue = (float(x) for x in undone)
    return Lens(
        exposure=float(rng.uniform(0.2, 0.6)) / max(level, 1e-3),
        balance=(red, green, blue),
        contrast=float(rng.uniform(0.85, 1.25)),
        vignette=float(rng.choice([0.0, rng.uniform(0.05, 0.4)])),
        blur=float(rng.choice([0.0, rng.uniform(0.0005, 0.004)])),
        noise=float(rng.uniform(0.0, 0.02)),
        jitter=float(rng.choice([0.0, rng.uniform(0.0, 0.05)])),
    )


def develop(rng: np.random.Generator, lens: Lens, radiance: Float32[np.ndarray, "h w 3"]) -> UInt8[np.ndarray, "h w 3"]:
    """The picture that the camera makes of a frame, sRGB."""
    height, width = radiance.shape[:2]
    gains = np.array(lens.balance, np.float32) * np.float32(lens.exposure * (1 + lens.jitter * rng.standard_normal()))
    sensor = radiance * gains
    if lens.blur:
        sensor = cv2.GaussianBlur(np.minimum(sensor, 4.0), (0, 0), max(0.25, lens.blur * max(height, width)))
    if lens.vignette:
        rows = (np.arange(height, dtype=np.float32) + 0.5) / height * 2 - 1
        columns = (np.arange(width, dtype=np.float32) + 0.5) / width * 2 - 1
        sensor = sensor * (1 - np.float32(lens.vignette / 2) * (rows[:, None] ** 2 + columns**2))[..., None]
    rolled = np.where(sensor < 0.7, sensor, 0.7 + 0.3 * (1 - np.exp(-(np.maximum(sensor, 0.7) - 0.7) / 0.3)))
    picture = np.clip(rolled, 0, 1) ** np.float32(lens.contrast / 2.2)
    if lens.noise:
        noise = rng.standard_normal(picture.shape, dtype=np.float32)
        picture = picture + np.float32(lens.noise) * noise
    return np.clip(picture * 255 + 0.5, 0, 255).astype(np.uint8)

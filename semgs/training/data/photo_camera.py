"""Imitation of a photo camera: lens, sensor and file format change the image; labels and geometry stay the same."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import Float

from semgs.data.views import Views

Image = Float[np.ndarray, "h w 3"]
"""RGB in 0..1, float32."""

GREY = (0.299, 0.587, 0.114)
"""Shares of red, green and blue in brightness (ITU-R BT.601)."""

MOTION = 0.03
"""Longest motion blur, relative to the image's height."""


@dataclass(frozen=True)
class Photo:
    """How one photo is taken; the defaults change nothing.

    Attributes:
        blur: standard deviation of defocus, relative to the image's height.
        motion: length of a straight motion blur, relative to the image's height.
        direction: of that motion [rad].
        vignetting: share of the light that is lost in the corners.
        balance: factor of each channel.
        noise: standard deviation of noise in each channel of each pixel.
        gamma: exponent.
        grey: without colour.
        jpeg: quality from 1 to 100; None is uncompressed.
    """

    blur: float = 0.0
    motion: float = 0.0
    direction: float = 0.0
    vignetting: float = 0.0
    balance: tuple[float, float, float] = (1.0, 1.0, 1.0)
    noise: float = 0.0
    gamma: float = 1.0
    grey: bool = False
    jpeg: int | None = None

    @staticmethod
    def drawn(strength: float, rng: np.random.Generator) -> Photo:
        """A random photo; strength 1 is about an old phone in bad light."""
        balance = np.exp(strength * rng.uniform(-0.22, 0.22, 3))
        gamma = np.exp(strength * rng.uniform(-0.3, 0.3))
        blurred, shaken, direction = rng.uniform(), rng.uniform(), rng.uniform(0, np.pi)
        blur, motion = rng.uniform(0.002, 0.007), rng.uniform(0.01, MOTION)
        has_vignetting, vignetting = rng.uniform() < 0.25, rng.uniform(0.05, 0.45)
        has_noise, noise = rng.uniform() < 0.5, abs(rng.normal(0, 0.027))
        compressed, loss = rng.uniform() < 0.35, rng.uniform(10, 75)
        return Photo(
            blur=strength * float(blur) * (blurred < 0.15),
            motion=strength * float(motion) * (shaken < 0.15),
            direction=float(direction),
            vignetting=strength * float(vignetting) * bool(has_vignetting),
            balance=(float(balance[0]), float(balance[1]), float(balance[2])),
            noise=strength * float(noise) * bool(has_noise),
            gamma=float(gamma),
            grey=bool(rng.uniform() < 0.1),
            jpeg=round(100 - strength * float(loss)) if compressed else None,
        )

    def taken(self, image: Image, rng: np.random.Generator) -> Image:
        """The image as this photo shows it, processed in the order of a camera; the generator is only for the noise."""
        image = blur(image, self.blur * image.shape[0])
        image = shake(image, self.motion * image.shape[0], self.direction)
        image = darken_corners(image, self.vignetting)
        image = image * np.array(self.balance, dtype=np.float32)
        image = np.clip(add_noise(image, self.noise, rng), 0, 1)
        if self.gamma != 1:
            image = cv2.pow(image, self.gamma)
        if self.grey:
            image = remove_colour(image)
        return image if self.jpeg is None else compress(image, self.jpeg)


def photograph(views: Views, strength: float, rng: np.random.Generator) -> Views:
    """The views as one camera takes them: all with the same settings, but with different noise.

    Args:
        views: with any leading axes, on the CPU.
        strength: 0..1.
        rng: random numbers; the same state gives the same photos.
    """
    photo = Photo.drawn(strength, rng)
    flat = views.images.flatten(end_dim=-4)
    images = torch.empty_like(flat)
    for index, image in enumerate(flat):
        picture = np.ascontiguousarray(image.permute(1, 2, 0).numpy(), dtype=np.float32)
        images[index] = torch.from_numpy(photo.taken(picture, rng)).permute(2, 0, 1)
    return views.changed(images=images.reshape(views.images.shape))


def blur(image: Image, deviation: float) -> Image:
    """The image with Gaussian blur of that standard deviation [px]."""
    return cv2.GaussianBlur(image, (0, 0), deviation, borderType=cv2.BORDER_REFLECT_101) if deviation > 0 else image


def shake(image: Image, length: float, direction: float) -> Image:
    """The image with motion blur: the mean along a line of that length [px] and direction [rad], centred on each pixel."""
    reach = round(length / 2)
    if reach < 1:
        return image
    kernel = np.zeros((2 * reach + 1, 2 * reach + 1), dtype=np.float32)
    x, y = round(reach * np.cos(direction)), round(reach * np.sin(direction))
    cv2.line(kernel, (reach - x, reach - y), (reach + x, reach + y), 1)
    return cv2.filter2D(image, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REFLECT_101)


def darken_corners(image: Image, loss: float) -> Image:
    """The image darkened with the square of the distance from its centre; the corners lose that share of their light."""
    if loss == 0:
        return image
    height, width = image.shape[:2]
    y, x = ((2 * np.arange(side, dtype=np.float32) + 1) / side - 1 for side in (height, width))
    light = 1 - np.float32(loss / 2) * (x * x + (y * y)[:, None])
    return image * light[..., None]


def add_noise(image: Image, deviation: float, rng: np.random.Generator) -> Image:
    """The image with normal noise of that standard deviation in each channel of each pixel; not clipped to 0..1."""
    if deviation == 0:
        return image
    return image + np.float32(deviation) * rng.standard_normal(image.shape, dtype=np.float32)


def remove_colour(image: Image) -> Image:
    """The image without colour: its brightness in all three channels."""
    return np.repeat((image @ np.array(GREY, dtype=np.float32))[..., None], 3, axis=2)


def compress(image: Image, quality: int) -> Image:
    """The image after JPEG compression with that quality, 1 to 100."""
    pixels = np.rint(255 * image).astype(np.uint8)
    _, data = cv2.imencode(".jpg", pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    back = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))[..., ::-1]
    return back.astype(np.float32) / 255

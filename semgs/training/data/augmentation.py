"""Augmentation: random changes to a sample, cameras included."""

from __future__ import annotations

import cv2
import numpy as np
import torch
from torch import Tensor

from semgs.data.resampling import cropped, resized
from semgs.data.tables.classes import IGNORE
from semgs.data.views import Views
from semgs.geometry.cameras import Cameras
from semgs.training.data.data_settings import Augmentation
from semgs.training.data.photo_camera import photograph


def crop_to_size(
    views: Views, size: tuple[int, int], share: float = 1.0, place: tuple[float, float] = (0.5, 0.5)
) -> Views:
    """The views at another size without stretching: a window with the new aspect ratio is cropped, then resized.

    Args:
        views: with any leading axes.
        size: the new (height, width) [px].
        share: side of the window, relative to the largest window with that aspect ratio.
        place: position of the window, from top and left (0) to bottom and right (1).
    """
    if share == 1 and views.size == size:
        return views
    scale = share * min(views.size[0] / size[0], views.size[1] / size[1])
    height, width = (min(max(1, round(scale * side)), limit) for side, limit in zip(size, views.size, strict=True))
    top, left = (
        round(part * (limit - side)) for part, side, limit in zip(place, (height, width), views.size, strict=True)
    )
    return resized(cropped(views, top, left, (height, width)), size)


def flip(views: Views) -> Views:
    """The views of the mirrored world, whose x axis points the other way: images are mirrored, and so are their cameras.

    A point p of the world becomes M p with M = diag(-1, 1, 1). A camera with pose R, t becomes one with M R M, M t, so that a pixel at u
    moves to width - u.
    """
    width = views.size[1]
    mirror = torch.diag(torch.tensor([-1.0, 1.0, 1.0, 1.0], dtype=torch.float64))
    intrinsics = views.cameras.intrinsics.clone()
    intrinsics[..., 0, 1] = -intrinsics[..., 0, 1]
    intrinsics[..., 0, 2] = width - intrinsics[..., 0, 2]
    poses = mirror @ views.cameras.world_from_camera @ mirror
    return views.map(lambda maps: maps.flip(-1), cameras=Cameras.trusted(poses, intrinsics, views.size))


def recolour(views: Views, strength: float, rng: np.random.Generator) -> Views:
    """The views with another exposure, white balance and saturation, the same for all of them.

    Factors are exp(s), with s uniform in -strength to strength for exposure and saturation, and in a third of that range for each channel.
    """
    exposure, saturation = np.exp(rng.uniform(-strength, strength, 2))
    balance = np.exp(rng.uniform(-strength, strength, 3) / 3)
    images = views.images
    grey = images.mean(-3, keepdim=True)
    images = grey + (images - grey) * saturation
    images = images * torch.from_numpy(exposure * balance).to(images)[:, None, None]
    return views.changed(images=images.clamp(0, 1))


def vary_exposure(views: Views, strength: float, rng: np.random.Generator) -> Views:
    """The views as a camera on automatic takes them: `recolour`, but each view by itself.

    Args:
        views: with one leading axis.
        strength: as in `recolour`.
        rng: random numbers; the same state gives the same colours.
    """
    each = [recolour(views.select([index]), strength, rng).images for index in range(len(views.images))]
    return views.changed(images=torch.cat(each))


def roll(views: Views, degrees: float) -> Views:
    """The views of cameras rotated clockwise about their optical axes; images rotate the other way about the principal point.

    Where a rotated camera would see past the borders, images and hidden pixels continue mirrored, labels are 255 and depths 0.

    Args:
        views: with any leading axes, on the CPU.
        degrees: the angle.
    """
    radians = np.radians(degrees)
    turn = torch.eye(4, dtype=torch.float64)
    turn[:2, :2] = torch.tensor([[np.cos(radians), -np.sin(radians)], [np.sin(radians), np.cos(radians)]])
    half = torch.eye(3, dtype=torch.float64)  # OpenCV counts from the centre of the first pixel
    half[:2, 2] = 0.5
    intrinsics = views.cameras.intrinsics.flatten(end_dim=-3)
    there_from_here = (half.inverse() @ intrinsics @ turn[:3, :3] @ intrinsics.inverse() @ half)[:, :2].numpy()

    def warp(maps: Tensor, interpolation: int, border: int, value: int = 0) -> Tensor:
        turned = maps.contiguous().clone()
        planes, flags = turned.view(-1, *views.size).numpy(), interpolation | cv2.WARP_INVERSE_MAP
        channels = max(1, len(planes) // max(1, len(there_from_here)))
        for plane, matrix in zip(planes, there_from_here.repeat(channels, axis=0), strict=True):
            plane[:] = cv2.warpAffine(plane, matrix, views.size[::-1], None, flags, border, value)
        return turned

    nearest, filled, mirrored = cv2.INTER_NEAREST, cv2.BORDER_CONSTANT, cv2.BORDER_REFLECT_101
    hidden = views.hidden
    return views.changed(
        images=warp(views.images, cv2.INTER_LINEAR, mirrored),
        hidden=None if hidden is None else warp(hidden.float(), cv2.INTER_LINEAR, mirrored) > 0,
        labels=None if views.labels is None else warp(views.labels, nearest, filled, IGNORE),
        depths=None if views.depths is None else warp(views.depths, nearest, filled),
        cameras=Cameras.trusted(views.cameras.world_from_camera @ turn, views.cameras.intrinsics, views.size),
    )


class Variation:
    """The random changes to one sample, the same for all of its views (but for `exposure`).

    Args:
        settings: how strong the changes are.
        seed, sample: the seed and the number of the sample; the same ones give the same changes.
    """

    def __init__(self, settings: Augmentation, seed: int, sample: int) -> None:
        rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, sample, 6))))
        self._settings = settings
        self._share = float(rng.uniform(settings.crop, 1))
        self._place = (float(rng.uniform()), float(rng.uniform()))
        self._flip = settings.flip and bool(rng.integers(2))
        self._colours = int(rng.integers(2**63))
        self._roll = settings.roll and float(rng.uniform(-settings.roll, settings.roll)) * int(rng.integers(2))
        self._camera = int(rng.integers(2**63))
        self._exposure = int(rng.integers(2**63))

    def __call__(self, views: Views, size: tuple[int, int]) -> Views:
        """The changed views at a size (height, width) [px]; without augmentation, the middle of each view."""
        views = self.move(views, size)
        if self._settings.colour:
            views = recolour(views, self._settings.colour, np.random.Generator(np.random.PCG64(self._colours)))
        if self._settings.exposure:
            views = vary_exposure(views, self._settings.exposure, np.random.Generator(np.random.PCG64(self._exposure)))
        if self._settings.camera:
            views = photograph(views, self._settings.camera, np.random.Generator(np.random.PCG64(self._camera)))
        return views

    def move(self, views: Views, size: tuple[int, int]) -> Views:
        """The views rolled, cropped, resized and mirrored, with unchanged colours."""
        if self._roll:
            views = roll(views, self._roll)
        views = crop_to_size(views, size, self._share, self._place if self._settings.crop < 1 else (0.5, 0.5))
        return flip(views) if self._flip else views

"""Inputs of the bench: the included room, networks, and a generated scene to render."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import torch

from semgs.data.demo_scene import demo_scene
from semgs.data.scenes import open_scene
from semgs.data.views import Batch, Views, stack
from semgs.geometry.cameras import Cameras, back_project
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.model.networks import base
from semgs.model.semgs import SemGS
from semgs.model.weights.load import load, untrained

TARGET = 5
"""Frame of the included room that is rendered."""

SIGMA_PX = 1.0
"""Median size of the Gaussians of `base`, which has random weights."""

COLOUR_SIGMA_PX, CLASSES_SIGMA_PX = 0.6, 1.0
"""Sizes of the generated scene's Gaussians in the image."""

FAINTEST, DENSEST = 0.3, 0.95
"""Range of their opacities."""


@cache
def load_network(name: str) -> SemGS:
    """A network: `small` with the included weights, or `base` with random ones whose Gaussians have a median size of 1 px."""
    if name == "small":
        return load("small")
    return untrained(replace(base(), initial_sigma=SIGMA_PX), seed=0).eval()


@cache
def context_views(count: int, size: tuple[int, int]) -> Views:
    """The first frames of the included room, without labels and depths."""
    return open_scene(demo_scene()).read(list(range(count)), size).changed(labels=None, depths=None)


@cache
def target_camera(size: tuple[int, int]) -> Cameras:
    """The camera of the rendered frame, as one view."""
    return open_scene(demo_scene()).read([TARGET], size).cameras


def training_batch(count: int, size: tuple[int, int], targets: int) -> Batch:
    """A batch of one scene: the first frames of the included room as contexts, the last ones as targets."""
    scene = open_scene(demo_scene())
    last = range(len(scene) - targets, len(scene))
    return Batch(stack([scene.read(list(range(count)), size)]), stack([scene.read(list(last), size)]), (scene.name,))


def generated_scene(
    views: int = 2, size: tuple[int, int] = (240, 320), classes: int = 20, seed: int = 0
) -> tuple[Gaussians, Cameras]:
    """One Gaussian per pixel of some views, at random smooth depths, and a camera between those views.

    Colour Gaussians have a standard deviation of 0.6 px in their own view, semantic ones of 1 px. Opacities are uniform in
    0.3..0.95, rotations and harmonics random. A seed gives the same scene on every machine.
    """
    generator = torch.Generator().manual_seed(seed)

    def uniform(*shape: int) -> torch.Tensor:
        return torch.rand(*shape, generator=generator)

    height, width = size
    focal = 1.1 * width
    poses = torch.eye(4, dtype=torch.float64).repeat(views + 1, 1, 1)
    poses[:, 0, 3] = torch.tensor([*(0.2 * view for view in range(views)), 0.1 * (views - 1)])
    intrinsics = torch.tensor([[focal, 0, 0.49 * width], [0, focal, 0.52 * height], [0, 0, 1]], dtype=torch.float64)
    cameras = Cameras(poses, intrinsics.expand(views + 1, 3, 3), size)
    coarse = 1 / (1 / 5.0 + (1 / 1.5 - 1 / 5.0) * uniform(views, 1, 7, 9))
    depths = torch.nn.functional.interpolate(coarse, size, mode="bilinear", align_corners=False)[:, 0]
    means = back_project(depths, cameras[:views]).reshape(-1, 3).float()
    pixel = depths.reshape(-1, 1) / focal
    count = len(means)

    def appearance(sigma: float, features: torch.Tensor) -> Appearance:
        turns = torch.nn.functional.normalize(torch.randn(count, 4, generator=generator), dim=-1)
        return Appearance(turns, (sigma * pixel).expand(-1, 3).contiguous(), features)

    harmonics = torch.randn(count, 16, 3, generator=generator) * 0.2 / math.sqrt(16)
    gaussians = Gaussians(
        means,
        FAINTEST + (DENSEST - FAINTEST) * uniform(count),
        appearance(COLOUR_SIGMA_PX, harmonics),
        appearance(CLASSES_SIGMA_PX, torch.randn(count, classes, generator=generator).softmax(-1)),
    )
    return gaussians, cameras[views:]

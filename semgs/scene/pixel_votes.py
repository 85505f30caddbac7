"""Pixel votes: classes of given Gaussians from the class maps of photos, without a network for geometry and without optimisation. Not in the paper.

A pixel of a photo is a sum of Gaussians, each with its blending weight there. Each pixel gives its class distribution to its Gaussians by these weights,
and a Gaussian adds up what it gets from all pixels of all photos. A rendered pixel is linear in the features of the Gaussians, with the blending weights
as factors, so one backward pass of the renderer with the class map as gradient gives the sums exactly.
"""

from __future__ import annotations

from dataclasses import replace
from types import ModuleType

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.rendering.pinhole import Pinhole
from semgs.rendering.render import render_each_view
from semgs.rendering.splats import Splats

LEAST_WEIGHT = 0.001
"""Gaussians that contribute less than this to all photos together, in pixels, are unseen: of so little, classes are noise."""


class PixelVotes:
    """The class distributions that Gaussians collect from photos, one photo after the other; memory does not grow with photos.

    Args:
        gaussians: of one scene, without a batch axis.
        classes: number of classes.
        near: Gaussians closer to a camera than this are not rendered; as for `semgs.render`.

    Attributes:
        sums: of the distributions of the pixels, weighted by the Gaussian's blending weight in each.
    """

    def __init__(self, gaussians: Gaussians, classes: int, near: float | None = None) -> None:
        self._gaussians, self._near = gaussians, near
        self.sums: Float[Tensor, "g class"] = gaussians.means.new_zeros(len(gaussians), classes)

    def add(self, camera: Cameras, distributions: Float[Tensor, "class h w"]) -> None:
        """Add what a photo says.

        Args:
            camera: of the photo, at the size of the map, with a leading axis of 1.
            distributions: over the classes of each pixel; pixels of zeros say nothing.

        Raises:
            ValueError: the map has another size than the camera, or another number of classes; or as `semgs.render`.
        """
        expected = (self.sums.shape[1], *camera.size)
        if tuple(distributions.shape) != expected:
            raise ValueError(
                f"distributions are {tuple(distributions.shape)}; expected {expected}: classes, height, width"
            )

        def collect(scene: Gaussians, pinhole: Pinhole, near: float | None, backend: ModuleType) -> Tensor:
            order = backend.depth_order(scene.means, pinhole, near)
            features = scene.means.new_zeros(self.sums.shape, requires_grad=True)
            shape = scene.colour
            with torch.enable_grad():
                splats = Splats(scene.means, shape.quaternions, shape.scales, scene.opacities, features)
                picture = backend.splat(splats, order, pinhole).picture
                return torch.autograd.grad(picture, features, distributions.to(picture))[0]

        plain = replace(self._gaussians, semantic=None)
        self.sums += render_each_view(plain, camera, self._near, "auto", collect)[0].to(self.sums)

    @property
    def weights(self) -> Float[Tensor, " g"]:
        """How much each Gaussian contributed to the pixels of all photos [px]."""
        return self.sums.sum(1)

    @property
    def unseen(self) -> Bool[Tensor, " g"]:
        """The Gaussians of which no photo says a class."""
        return self.weights < LEAST_WEIGHT

    def labelled(self) -> Gaussians:
        """The Gaussians with the mean of their votes as class distribution, in the shapes that they have; those that are unseen have a uniform one."""
        weights = self.weights[:, None].clamp(min=LEAST_WEIGHT)
        even = torch.full_like(self.sums, 1 / self.sums.shape[1])
        features = torch.where(self.unseen[:, None], even, self.sums / weights)
        shape = self._gaussians.colour
        return replace(self._gaussians, semantic=Appearance(shape.quaternions, shape.scales, features))

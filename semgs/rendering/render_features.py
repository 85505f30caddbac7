"""Renders features of any kind, with the shapes of the semantic Gaussians; and the transpose of rendering, from pixels to Gaussians."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import ModuleType

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Gaussians
from semgs.rendering.pinhole import Pinhole
from semgs.rendering.render import render_each_view
from semgs.rendering.splats import Splats

LEAST_ALPHA = 0.05
"""Pixels with a smaller alpha have no feature: a sum of so little weight says nothing."""

AT_A_TIME = 32
"""Channels of one pass."""


@dataclass(frozen=True)
class FeatureRendering:
    """Features as seen by cameras.

    Attributes:
        features: sum(w f) / sum(w) of every pixel; NaN where alpha < 0.05.
        alphas: sum(w), 0..1.
    """

    features: Float[Tensor, "v c h w"]
    alphas: Float[Tensor, "v h w"]


@torch.no_grad()
def render_features(
    gaussians: Gaussians,
    features: Float[Tensor, "g c"],
    cameras: Cameras,
    *,
    near: float | Tensor | None = None,
    backend: str = "auto",
) -> FeatureRendering:
    """Splat features into cameras. Gaussians without a semantic branch take the shapes of colour.

    Args:
        gaussians: of one scene, without a batch axis.
        features: of each Gaussian.
        cameras: the views [v].
        near, backend: as for `semgs.render`.

    Raises:
        ValueError: there is not one feature for each Gaussian, or as for `semgs.render`.
        ImportError: as for `semgs.render`.
    """
    if gaussians.means.ndim != 2 or features.shape[:-1] != gaussians.opacities.shape:
        raise ValueError(
            f"features are {tuple(features.shape)} for {tuple(gaussians.opacities.shape)} Gaussians; expected [g c]"
        )

    def render_view(scene: Gaussians, camera: Pinhole, bound: float | None, back_end: ModuleType) -> FeatureRendering:
        shape = scene.semantic or scene.colour
        order = back_end.depth_order(scene.means, camera, bound)
        pictures = []
        for part in features.to(scene.means).split(AT_A_TIME, dim=1):
            layer = back_end.splat(
                Splats(scene.means, shape.quaternions, shape.scales, scene.opacities, part), order, camera
            )
            pictures.append(layer.picture)
        alphas = 1 - layer.transmittance
        mean = torch.cat(pictures) / alphas.clamp(min=LEAST_ALPHA)
        return FeatureRendering(
            torch.where(alphas < LEAST_ALPHA, torch.nan, mean).to(features)[None], alphas.to(features)[None]
        )

    views = render_each_view(gaussians, cameras, near, backend, render_view)
    return FeatureRendering(torch.cat([view.features for view in views]), torch.cat([view.alphas for view in views]))


def gather_maps(
    gaussians: Gaussians, maps: Float[Tensor, "v c h w"], cameras: Cameras, *, near: float | Tensor | None = None
) -> list[Float[Tensor, "g c"]]:
    """For each view and each Gaussian the sum of the pixels of its maps, weighted by the Gaussian's blending weight in each, in the shapes of colour.

    Rendered pixels are linear in the features of the Gaussians, so the gradient of one rendering gives the sums exactly.

    Args:
        gaussians: of one scene, without a batch axis.
        maps: of each view; ones give the pixels that a Gaussian covers.
        cameras: the views [v], at the size of the maps.
        near: as for `semgs.render`.

    Raises:
        ValueError: as for `semgs.render`.
    """
    remaining = iter(maps)

    def gather(scene: Gaussians, camera: Pinhole, bound: float | None, back_end: ModuleType) -> Tensor:
        order = back_end.depth_order(scene.means, camera, bound)
        pixels, shape = next(remaining), scene.colour
        features = scene.means.new_zeros(len(scene), len(pixels), requires_grad=True)
        with torch.enable_grad():
            splats = Splats(scene.means, shape.quaternions, shape.scales, scene.opacities, features)
            picture = back_end.splat(splats, order, camera).picture
            return torch.autograd.grad(picture, features, pixels.to(picture))[0]

    return render_each_view(replace(gaussians, semantic=None), cameras, near, "auto", gather)

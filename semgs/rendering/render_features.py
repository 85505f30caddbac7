"""Renders features of any kind, with the shapes of the semantic Gaussians; the uncertainty of depth; and the transpose of rendering, from pixels to Gaussians."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import ModuleType

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.geometry.cameras import Cameras, project
from semgs.geometry.gaussians import Gaussians
from semgs.rendering.render import render_each_view
from semgs.rendering.rendering import SEEN_ALPHA
from semgs.rendering.splats import Pinhole, Splats

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


def render_depth_spread(
    gaussians: Gaussians,
    depth_spread: Float[Tensor, " g"],
    cameras: Cameras,
    *,
    near: float | None = None,
    backend: str = "auto",
) -> Float[Tensor, "v h w"]:
    """The standard deviation of log depth at every pixel: 0.1 is about 10 % of the depth; NaN for unseen pixels.

    The variance is sum(w (s^2 + (log z - m)^2)) / sum(w), with m = sum(w log z) / sum(w): how uncertain the Gaussians of a pixel are, and how far their depths are apart.

    Args:
        gaussians: of one scene, without a batch axis.
        depth_spread: s of each Gaussian, the standard deviation of its log depth in its own input view.
        cameras: the views [v].
        near, backend: as for `semgs.render`.

    Raises:
        ValueError, ImportError: as `semgs.render`.
    """
    as_colour = replace(gaussians, semantic=None)  # depth is that of the colour pass
    spreads = []
    for index in range(cameras.batch[0]):
        camera = cameras[index]
        log = project(gaussians.means.double(), camera)[:, 2].clamp(min=1e-6).log().to(depth_spread)
        features = torch.stack((log, log.square() + depth_spread.square()), 1)
        found = render_features(as_colour, features, cameras[index : index + 1], near=near, backend=backend)
        mean, square = found.features[0]
        spread = (square - mean.square()).clamp(min=0).sqrt()
        spreads.append(torch.where(found.alphas[0] < SEEN_ALPHA, torch.nan, spread))
    return torch.stack(spreads)

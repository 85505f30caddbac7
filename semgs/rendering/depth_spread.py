"""The uncertainty of rendered depth."""

from __future__ import annotations

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.geometry.cameras import Cameras, project
from semgs.geometry.gaussians import Gaussians
from semgs.rendering.render_features import render_features
from semgs.rendering.rendering import SEEN_ALPHA


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

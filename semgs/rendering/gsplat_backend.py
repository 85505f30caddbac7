"""Splatting on CUDA with gsplat 1.5.3. It follows the rules of `reference` and differs from it only by float32 rounding.

Three steps before gsplat make sure that it decides as `reference` does. Positions are computed relative to the optical centre in
float64, because float32 would lose digits far from the world's origin. The near plane is applied (gsplat keeps Gaussians on it).
Gaussians are sorted by depth: gsplat sorts float32 depths with a stable sort, so Gaussians of equal float32 depth keep this order.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import torch
from filelock import FileLock
from jaxtyping import Float, Int64
from torch import Tensor

from semgs.files.errors import needs_extra
from semgs.files.paths import cache_folder
from semgs.geometry.rotations import covariance
from semgs.rendering.rules import BLUR_PX2
from semgs.rendering.splats import Layer, Pinhole, Splats, near_plane

COMPILED = "gsplat.cuda._backend"
"""The module that compiles gsplat when it is imported."""


def depth_order(means: Float[Tensor, "g 3"], camera: Pinhole, near: float | None) -> Int64[Tensor, " drawn"]:
    """The Gaussians to render, nearest first; those of equal depth stay in the order of their index."""
    with torch.no_grad():
        depths = (means.double() - camera.centre.to(means.device)) @ camera.axes[2].to(means.device)
        drawn = (depths > near_plane(depths, near)).nonzero()[:, 0]
        return drawn[torch.argsort(depths[drawn], stable=True)]


def splat(splats: Splats, order: Int64[Tensor, " drawn"], camera: Pinhole) -> Layer:
    """The features blended at every pixel, and the transmittance that is left there.

    Raises:
        ImportError: gsplat is not installed, or could not be compiled.
    """
    height, width = camera.size
    features = splats.features[order]
    if not len(order):  # gsplat divides by the number of Gaussians
        picture = features.sum(0)[:, None, None].expand(-1, height, width)
        return Layer(picture, features.new_ones(height, width))
    view = torch.eye(4, dtype=torch.float64)
    view[:3, :3] = camera.axes
    (fx, fy), (cx, cy) = camera.focal_px, camera.principal_px
    pictures, alphas, _ = rasterizer()(
        means=camera.offsets(splats.means[order]),
        quats=None,
        scales=None,
        covars=covariance(splats.quaternions[order], splats.scales[order]),
        opacities=splats.opacities[order],
        colors=features,
        viewmats=view[None].to(features),
        Ks=features.new_tensor([[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]]),
        width=width,
        height=height,
        near_plane=0.0,
        far_plane=math.inf,
        eps2d=BLUR_PX2,
        packed=False,
    )
    return Layer(pictures[0].permute(2, 0, 1), 1 - alphas[0, ..., 0])


def rasterizer() -> Callable:
    """gsplat's function. The first call on a machine compiles its extension, which takes minutes.

    Only one process compiles, because several at once would delete each other's build folder. The others wait and load the result.

    Raises:
        ImportError: gsplat is not installed, or could not be compiled.
    """
    lock = nullcontext() if COMPILED in sys.modules else FileLock(_lock_path())
    with needs_extra("cuda", "splatting on CUDA needs gsplat", "gsplat"), lock:
        from gsplat import rasterization
        from gsplat.cuda._backend import _C
    if _C is None:
        raise ImportError(
            "gsplat found no CUDA toolkit (nvcc) to compile itself with; install one, or uninstall gsplat to render on the CPU",
            name="gsplat",
        )
    return rasterization


def _lock_path() -> Path:
    """The lock file for all processes of this user, in the cache or, if that cannot be written, in the folder for temporary files."""
    folder = cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        folder = Path(tempfile.gettempdir())
    return folder / "gsplat.lock"

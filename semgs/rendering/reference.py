"""Splatting in plain PyTorch: slow, exact, differentiable by autograd, in any dtype. It is the specification of every back-end.

A Gaussian at camera position (x, y, z) with covariance Sigma (world) is rendered as a 2D Gaussian at (fx x/z + cx, fy y/z + cy)
with covariance J R Sigma R^T J^T + 0.3 I (EWA splatting: J is the Jacobian of the projection, R rotates world to camera).
At a pixel centre p its alpha is min(0.999, opacity exp(-sigma)), sigma = d^T C^-1 d / 2 with d = p - centre; front to back
the pixel adds w_i f_i with w_i = alpha_i T_i, T_i = prod_(j < i) (1 - alpha_j).

There is no radius: gsplat renders up to min(3.33, sqrt(2 ln(255 opacity))) standard deviations. At the second, alpha falls below
1/255. It is the smaller one up to an opacity of exp(3.33^2 / 2) / 255 = 1.003, so gsplat loses no contribution that the 1/255 rule
admits.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int64
from torch import Tensor

from semgs.geometry.cameras import pixel_centres
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.rendering.rules import BLUR_PX2, MAX_ALPHA, MIN_ALPHA, MIN_TRANSMITTANCE
from semgs.rendering.splats import Layer, Pinhole, Splats, near_plane

CHUNK = 1 << 22
"""Numbers in one pixel-by-Gaussian matrix; more pixels are rendered in several chunks."""


def depth_order(means: Float[Tensor, "g 3"], camera: Pinhole, near: float | None) -> Int64[Tensor, " drawn"]:
    """The Gaussians to render, nearest first; those of equal depth stay in the order of their index."""
    with torch.no_grad():
        depths = camera.offsets(means) @ camera.axes[2].to(means)
        drawn = (depths > near_plane(depths, near)).nonzero()[:, 0]
        return drawn[torch.argsort(depths[drawn], stable=True)]


def splat(splats: Splats, order: Int64[Tensor, " drawn"], camera: Pinhole) -> Layer:
    """The features blended at every pixel, and the transmittance that is left there."""
    ellipses = project(splats, camera)
    order = order[ellipses.visible[order]]
    opacities, features = splats.opacities[order], splats.features[order]
    height, width = camera.size
    pixels = pixel_centres(camera.size, features.dtype).to(features.device).reshape(-1, 2)
    blended, left = [], []
    for chunk in pixels.split(max(1, CHUNK // max(1, len(order)))):
        alpha, light = alphas_and_light(chunk, ellipses.centres[order], ellipses.conics[order], opacities)
        blended.append((alpha * light[:, :-1]) @ features)
        left.append(light[:, -1])
    return Layer(
        picture=torch.cat(blended).mT.reshape(-1, height, width),
        transmittance=torch.cat(left).reshape(height, width),
    )


def alphas_and_light(
    pixels: Float[Tensor, "p 2"],
    centres: Float[Tensor, "g 2"],
    conics: Float[Tensor, "g 3"],
    opacities: Float[Tensor, " g"],
) -> tuple[Float[Tensor, "p g"], Float[Tensor, "p g_and_1"]]:
    """The alphas of Gaussians at points of the image, and the light that arrives at each one and behind the last.

    Args:
        pixels: any points [px].
        centres, conics: of visible ellipses, nearest first.
        opacities: of the same Gaussians.
    """
    dx, dy = (pixels[:, None] - centres).unbind(-1)
    xx, xy, yy = conics.unbind(-1)
    sigma = 0.5 * (xx * dx * dx + yy * dy * dy) + xy * dx * dy
    alpha = (opacities * torch.exp(-sigma)).clamp(max=MAX_ALPHA)
    alpha = torch.where((sigma >= 0) & (alpha >= MIN_ALPHA), alpha, 0)
    # Transmittance only falls, so Gaussians that leave enough of it come before the pixel is finished.
    alpha = torch.where(torch.cumprod(1 - alpha.detach(), dim=1) > MIN_TRANSMITTANCE, alpha, 0)
    return alpha, torch.cat((alpha.new_ones(len(pixels), 1), torch.cumprod(1 - alpha, dim=1)), dim=1)


@dataclass(frozen=True)
class Ellipses:
    """Gaussians in the image plane.

    Attributes:
        centres: [px].
        conics: xx, xy and yy of the inverse covariances [px^-2].
        visible: false at or behind the camera's plane, and without a finite ellipse.
    """

    centres: Float[Tensor, "g 2"]
    conics: Float[Tensor, "g 3"]
    visible: Bool[Tensor, " g"]


def project(splats: Splats, camera: Pinhole) -> Ellipses:
    """The ellipses of EWA splatting."""
    means = splats.means
    inside = camera.offsets(means) @ camera.axes.to(means).mT
    in_front = inside[:, 2] > 0
    depths = torch.where(in_front, inside[:, 2], 1)
    slopes = inside[:, :2] / depths[:, None]
    focal = means.new_tensor(camera.focal_px)
    centres = focal * slopes + means.new_tensor(camera.principal_px)

    limits = means.new_tensor(camera.slope_limits)
    clamped = slopes.clamp(limits[:, 0], limits[:, 1])
    jacobian = torch.cat((torch.eye(2).to(means).expand(len(means), 2, 2), -clamped[..., None]), dim=-1)
    jacobian = jacobian * focal[:, None] / depths[:, None, None]

    axes = matrix_from_quaternion(splats.quaternions) * splats.scales[:, None, :]
    flat = jacobian @ camera.axes.to(means) @ axes
    covariances = flat @ flat.mT + BLUR_PX2 * torch.eye(2).to(means)
    (xx, xy), (_, yy) = (row.unbind(-1) for row in covariances.unbind(-2))
    determinants = xx * yy - xy * xy
    visible = in_front & (determinants > 0) & torch.isfinite(determinants) & torch.isfinite(centres).all(-1)
    adjugates = torch.stack((yy, -xy, xx), dim=-1)
    return Ellipses(centres, adjugates / torch.where(visible, determinants, 1)[:, None], visible)

"""Splatting in plain PyTorch: slow, exact, differentiable by autograd, any dtype. The specification of every back-end.

A Gaussian at camera position (x, y, z) with covariance Sigma (world) is drawn as a 2D Gaussian at (fx x/z + cx, fy y/z + cy)
with covariance J R Sigma R^T J^T + 0.3 I (EWA splatting: J is the Jacobian of the projection, R rotates world to camera).
At a pixel centre p its alpha is min(0.999, opacity exp(-sigma)), sigma = d^T C^-1 d / 2 with d = p - centre; front to back
the pixel adds w_i f_i with w_i = alpha_i T_i, T_i = prod_(j < i) (1 - alpha_j).

No radius enters: gsplat draws to min(3.33, sqrt(2 ln(255 opacity))) standard deviations, and the second is where alpha falls
below 1/255. It is the smaller one up to an opacity of exp(3.33^2 / 2) / 255 = 1.003, so no contribution that the 1/255 rule
admits is lost there.
"""

from __future__ import annotations

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from semgs.geometry.cameras import pixel_centres
from semgs.geometry.rotations import matrix_from_quaternion
from semgs.rendering.pinhole import Pinhole, near_plane
from semgs.rendering.rules import BLUR_PX2, MAX_ALPHA, MIN_ALPHA, MIN_TRANSMITTANCE
from semgs.rendering.splats import Layer, Splats

CHUNK = 1 << 22
"""Numbers in one pixel-by-Gaussian matrix; more pixels are drawn in several."""


def depth_order(means: Float[Tensor, "g 3"], camera: Pinhole, near: float | None) -> Int64[Tensor, " drawn"]:
    """The Gaussians that are drawn, nearest first; equal depths keep the order of their index."""
    with torch.no_grad():
        depths = camera.offsets(means) @ camera.axes[2].to(means)
        drawn = (depths > near_plane(depths, near)).nonzero()[:, 0]
        return drawn[torch.argsort(depths[drawn], stable=True)]


def splat(splats: Splats, order: Int64[Tensor, " drawn"], camera: Pinhole) -> Layer:
    """Features blended at every pixel, and the light that is left there."""
    centres, inverses, visible = project(splats, camera)
    order = order[visible[order]]
    centres, inverses = centres[order], inverses[order]
    opacities, features = splats.opacities[order], splats.features[order]

    height, width = camera.size
    pixels = pixel_centres(camera.size, features.dtype).to(features.device).reshape(-1, 2)
    blended, left = [], []
    for chunk in pixels.split(max(1, CHUNK // max(1, len(order)))):
        offsets = chunk[:, None] - centres
        sigma = 0.5 * torch.einsum("pgi,gij,pgj->pg", offsets, inverses, offsets)
        alpha = (opacities * torch.exp(-sigma)).clamp(max=MAX_ALPHA)
        alpha = torch.where((sigma >= 0) & (alpha >= MIN_ALPHA), alpha, 0)
        # Transmittance only falls, so those that leave enough of it are the ones before the pixel is finished.
        alpha = torch.where(torch.cumprod(1 - alpha.detach(), dim=1) > MIN_TRANSMITTANCE, alpha, 0)
        behind = torch.cat((alpha.new_ones(len(chunk), 1), torch.cumprod(1 - alpha, dim=1)), dim=1)
        blended.append((alpha * behind[:, :-1]) @ features)
        left.append(behind[:, -1])
    return Layer(
        picture=torch.cat(blended).mT.reshape(-1, height, width),
        transmittance=torch.cat(left).reshape(height, width),
    )


def project(splats: Splats, camera: Pinhole) -> tuple[Float[Tensor, "g 2"], Float[Tensor, "g 2 2"], Tensor]:
    """Centres [px], inverse covariances [px^-2] and visibility of the Gaussians in the image plane.

    Not visible is what lies at or behind the camera's plane and what no finite ellipse describes.
    """
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
    adjugates = torch.stack((yy, -xy, -xy, xx), dim=-1).unflatten(-1, (2, 2))
    return centres, adjugates / torch.where(visible, determinants, 1)[:, None, None], visible

"""Heads: from features to dual Gaussians: depth and opacity, colour, semantics, and their placement in the world.

In `base` and `mvsplat` layer shapes and names are MVSplat's, so that its weights load.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.geometry.cameras import Cameras, pixel_centres
from semgs.geometry.gaussians import Appearance
from semgs.geometry.harmonics_rotation import rotated_harmonics
from semgs.geometry.rotations import quaternion_from_matrix, quaternion_product
from semgs.model.conventions import Conventions
from semgs.model.layout import beside
from semgs.model.precision import outside_autocast
from semgs.model.unet import GROUPS, UNet

SMALLEST_SIGMA, LARGEST_SIGMA = 0.5, 15.0
"""Range of a Gaussian's size before `SIGMA_UNIT`."""

SIGMA_UNIT = 0.1
"""Share of (1 / fx + 1 / fy) that a size of 1 means: sizes are 0.1 to 3 pixels where fx = fy."""

RENDERED_HARMONICS = 16
"""Coefficients a colour that are ever drawn: degrees 0 to 3."""

HARMONICS_DC = 0.28209479177387814
"""The constant basis function of degree 0."""


class Upsampler(nn.Module):
    """gelu(upsample(conv(x))): features from the network's scale to the Gaussians'."""

    def __init__(self, inputs: int, outputs: int, factor: int, pixel_centres: bool = True) -> None:
        super().__init__()
        self.conv = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.factor = factor
        self.pixel_centres = pixel_centres

    def forward(self, x: Float[Tensor, "n c h w"]) -> Float[Tensor, "n d h2 w2"]:
        """Features `factor` times as large."""
        return nn.functional.gelu(upsampled(self.conv(x), self.factor, self.pixel_centres))


class CostRegressor(nn.Module):
    """The probability of each depth candidate from cost and features: U-Net, then two convolutions.

    Args:
        channels: of the features.
        candidates: L.
        width: of the U-Net.
        hidden: width between the two last convolutions.
        levels, decoder_blocks: of the U-Net.
        cost_prior: the logits are a correction of the cost itself, from normalised features.
    """

    def __init__(
        self,
        channels: int,
        candidates: int,
        width: int,
        hidden: int,
        levels: int = 3,
        decoder_blocks: int = 2,
        cost_prior: bool = False,
    ) -> None:
        super().__init__()
        self.norm = nn.GroupNorm(GROUPS, candidates) if cost_prior else None
        inputs = channels + candidates
        self.refine = nn.ModuleList(
            [
                nn.Conv2d(inputs, width, 3, padding=1),
                nn.GroupNorm(GROUPS, width),
                nn.GELU(),
                UNet(width, levels, decoder_blocks),
                nn.Conv2d(width, candidates, 3, padding=1),
            ]
        )
        self.residual = nn.Conv2d(inputs, candidates, 1)
        self.head = nn.Sequential(
            nn.Conv2d(candidates, hidden, 3, padding=1), nn.GELU(), nn.Conv2d(hidden, candidates, 3, padding=1)
        )

    def forward(
        self, cost: Float[Tensor, "n l h w"], features: Float[Tensor, "n c h w"], views: int
    ) -> Float[Tensor, "n l h w"]:
        """Logits over the candidates; `views` of them belong to a scene."""
        x = beside(cost, features)
        conv, norm, activation, unet, last = self.refine
        refined = last(unet(activation(norm(conv(x))), views)) + self.residual(x)
        if self.norm is None:
            return self.head(refined)
        return cost + self.head(self.norm(refined))


class DepthRefinement(nn.Module):
    """Full-size correction of disparity, and opacity: a U-Net over picture, features, disparity and its probability.

    Args:
        features: channels of the upsampled features.
        projected: channels that `project` reduces them to.
        width, levels, decoder_blocks: of the U-Net.
    """

    def __init__(self, features: int, projected: int, width: int, levels: int, decoder_blocks: int = 2) -> None:
        super().__init__()
        self.project = nn.Conv2d(features, projected, 3, padding=1)
        self.refine = nn.ModuleList(
            [
                nn.Conv2d(3 + projected + 2, width, 3, padding=1),
                nn.GroupNorm(4, width),
                nn.GELU(),
                UNet(width, levels, decoder_blocks),
            ]
        )
        self.to_disparity = nn.Sequential(
            nn.Conv2d(width, 2 * width, 3, padding=1), nn.GELU(), nn.Conv2d(2 * width, 2, 3, padding=1)
        )

    def forward(
        self,
        images: Float[Tensor, "n 3 h w"],
        projected: Float[Tensor, "n p h w"],
        disparities: Float[Tensor, "n h w"],
        confidences: Float[Tensor, "n h w"],
        views: int,
    ) -> tuple[Float[Tensor, "n d h w"], Float[Tensor, "n 2 h w"]]:
        """Features of the refinement, and (correction of disparity, logit of opacity) in the dtype of the disparities.

        `projected` is what `project` makes of the upsampled features.
        """
        x = beside(images, projected, disparities[:, None], confidences[:, None])
        conv, norm, activation, unet = self.refine
        refined = unet(activation(norm(conv(x))), views)
        return refined, self.to_disparity(refined).to(disparities.dtype)


class Head(nn.Sequential):
    """The two-layer CNN that predicts one branch's attributes."""

    def __init__(self, inputs: int, hidden: int, outputs: int, last_kernel: int = 3) -> None:
        super().__init__(
            nn.Conv2d(inputs, hidden, 3, padding=1),
            nn.GELU(),
            nn.Conv2d(hidden, outputs, last_kernel, padding=last_kernel // 2),
        )


def drawn_attributes(head: Head, harmonics: int, x: Float[Tensor, "n c h w"]) -> Float[Tensor, "n d h w"]:
    """The output of a head whose last channels are `harmonics` coefficients a colour, without those never drawn."""
    if harmonics <= RENDERED_HARMONICS:
        return head(x)
    first, activation, last = head
    assert isinstance(last, nn.Conv2d)
    assert last.bias is not None
    start = last.out_channels - 3 * harmonics
    live = [*range(start), *(start + harmonics * c + k for c in range(3) for k in range(RENDERED_HARMONICS))]
    return nn.functional.conv2d(
        activation(first(x)), last.weight[live], last.bias[live], padding=last.kernel_size[0] // 2
    )


def start_at(head: Head, channels: slice, sigma: float) -> None:
    """Set the bias of a head's size channels so that Gaussians start at `sigma` pixels."""
    share = (sigma / (2 * SIGMA_UNIT) - SMALLEST_SIGMA) / (LARGEST_SIGMA - SMALLEST_SIGMA)
    last = head[-1]
    assert isinstance(last, nn.Conv2d)
    assert last.bias is not None
    with torch.no_grad():
        last.bias[channels] = torch.logit(torch.tensor(share))


@dataclass(frozen=True)
class Decoded:
    """What both forms of the heads predict for each Gaussian of n views.

    Attributes:
        depths: [m].
        opacities: 0..1.
        attributes: raw sizes, quaternions and harmonics of the colour Gaussians.
        offsets: raw (x, y) shifts from the pixel's centre; None for none.
    """

    depths: Float[Tensor, "n h w"]
    opacities: Float[Tensor, "n h w"]
    attributes: Float[Tensor, "n d h w"]
    offsets: Float[Tensor, "n 2 h w"] | None = None


@dataclass(frozen=True)
class Rays:
    """What placing a Gaussian per pixel needs of the cameras, on the features' device and in their dtype.

    Attributes:
        rotation: world from camera.
        centre: optical centre in the world.
        inverse_k: K^-1.
        pixel: 1 / fx + 1 / fy.
        quaternion: of the rotation, (w, x, y, z).
    """

    rotation: Float[Tensor, "n 3 3"]
    centre: Float[Tensor, "n 3"]
    inverse_k: Float[Tensor, "n 3 3"]
    pixel: Float[Tensor, " n"]
    quaternion: Float[Tensor, "n 4"]

    @staticmethod
    def of(cameras: Cameras, like: Tensor) -> Rays:
        """Of cameras [n], computed in float64."""
        poses = cameras.world_from_camera
        numbers = (
            poses[..., :3, :3],
            poses[..., :3, 3],
            torch.linalg.inv(cameras.intrinsics),
            (1 / cameras.focal_px).sum(-1),
            quaternion_from_matrix(poses[..., :3, :3]),
        )
        return Rays(*(number.to(like) for number in numbers))

    def __getitem__(self, at: slice) -> Rays:
        """Those of some of the cameras."""
        return Rays(self.rotation[at], self.centre[at], self.inverse_k[at], self.pixel[at], self.quaternion[at])


@outside_autocast
def points(
    depths: Float[Tensor, "n h w"], offsets: Float[Tensor, "n 2 h w"] | None, rays: Rays, conventions: Conventions
) -> Float[Tensor, "n h w 3"]:
    """Means: pixel centres, moved by up to half a pixel, back-projected to their depth (section III-C of the paper).

    Args:
        depths: z-depth, or distance along the ray by convention [m].
        offsets: raw (x, y) shifts; a sigmoid keeps them within half a pixel. None leaves the points on the centres.
        rays: of the cameras.
        conventions: of geometry.
    """
    centres = pixel_centres((depths.shape[-2], depths.shape[-1]), depths.dtype).to(depths.device)
    if offsets is None:
        shifted = centres.expand(len(depths), -1, -1, -1)
    else:
        shifted = centres + (offsets.sigmoid() - 0.5).permute(0, 2, 3, 1)
    homogeneous = torch.cat((shifted, torch.ones_like(shifted[..., :1])), dim=-1)
    directions = torch.einsum("nij,nhwj->nhwi", rays.inverse_k, homogeneous)
    if not conventions.z_depth:
        directions = nn.functional.normalize(directions, dim=-1)
    world = torch.einsum("nij,nhwj->nhwi", rays.rotation, directions)
    return world * depths[..., None] + rays.centre[:, None, None]


def shapes(
    scales: Float[Tensor, "n 3 h w"], quaternions: Float[Tensor, "n 4 h w"], depths: Float[Tensor, "n h w"], rays: Rays
) -> tuple[Float[Tensor, "n h w 3"], Float[Tensor, "n h w 4"]]:
    """Standard deviations [m] and world quaternions (w, x, y, z) from raw sizes and raw camera-frame (x, y, z, w)."""
    size = SMALLEST_SIGMA + (LARGEST_SIGMA - SMALLEST_SIGMA) * scales.sigmoid()
    unit = SIGMA_UNIT * rays.pixel[:, None, None] * depths
    length = quaternions.square().sum(1, keepdim=True).clamp(min=1e-16).sqrt()  # far faster than a norm over this axis
    own = (quaternions / length).roll(1, dims=1).permute(0, 2, 3, 1)
    return size.permute(0, 2, 3, 1) * unit[..., None], quaternion_product(rays.quaternion[:, None, None], own)


@outside_autocast
def colour_appearance(
    raw: Float[Tensor, "n c h w"],
    images: Float[Tensor, "n 3 h w"] | None,
    depths: Float[Tensor, "n h w"],
    rays: Rays,
    conventions: Conventions,
) -> Appearance:
    """Colour Gaussians of n views, [n (h w) ...].

    Args:
        raw: channels (3 sizes, 4 quaternion, 3 k harmonics), harmonics by colour, then by k.
        images: added to the constant harmonic, so that the network predicts a correction; None adds nothing.
        depths: of the Gaussians [m].
        rays: of the cameras.
        conventions: of geometry; says in which basis the harmonics are.
    """
    raw = raw.to(depths.dtype)
    scales, quaternions = shapes(raw[:, :3], raw[:, 3:7], depths, rays)
    harmonics = raw[:, 7:].unflatten(1, (3, -1)).permute(0, 3, 4, 2, 1)
    terms = harmonics.shape[-2]
    degrees = torch.arange(terms, device=raw.device, dtype=raw.dtype).sqrt().floor()
    damping = torch.where(degrees == 0, 1, 0.1 * 0.25**degrees)
    harmonics = rotated_harmonics(
        (harmonics * damping[:, None]).flatten(1, 2), rays.rotation, mvsplat_basis=not conventions.standard_harmonics
    )
    if images is not None:
        base = ((images - 0.5) / HARMONICS_DC).permute(0, 2, 3, 1).flatten(1, 2)
        harmonics = torch.cat((harmonics[..., :1, :] + base[..., None, :], harmonics[..., 1:, :]), dim=-2)
    return Appearance(quaternions.flatten(1, 2), scales.flatten(1, 2), harmonics)


@outside_autocast
def semantic_appearance(raw: Float[Tensor, "n c h w"], depths: Float[Tensor, "n h w"], rays: Rays) -> Appearance:
    """Semantic Gaussians of n views, [n (h w) ...]: channels (3 sizes, 4 quaternion, logits of the classes)."""
    raw = raw.to(depths.dtype)
    scales, quaternions = shapes(raw[:, :3], raw[:, 3:7], depths, rays)
    classes = raw[:, 7:].softmax(1).permute(0, 2, 3, 1)
    return Appearance(quaternions.flatten(1, 2), scales.flatten(1, 2), classes.flatten(1, 2))


def upsampled(x: Float[Tensor, "n c h w"], factor: int, pixel_centres: bool) -> Float[Tensor, "n c h2 w2"]:
    """Bilinear upsampling that keeps image corners, or the centres of the corner texels."""
    return nn.functional.interpolate(x, scale_factor=factor, mode="bilinear", align_corners=not pixel_centres)

"""Placing: from the heads' predictions for each pixel to Gaussians in the world."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from semgs.geometry.cameras import Cameras, pixel_centres, shrink_cameras
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.harmonics import rotate_harmonics
from semgs.geometry.rotations import quaternion_from_matrix, quaternion_product
from semgs.model.gaussians.heads import RawGaussians
from semgs.model.layers.network_input import NetworkInput, widen
from semgs.model.settings import Conventions
from semgs.rendering.rules import BLUR_PX2
from semgs.runtime.precision import outside_autocast
from semgs.scene.encoding import Encoding
from semgs.scene.overlap import PAIR, Others, seen_by, shrinkage

SMALLEST_SIGMA, LARGEST_SIGMA = 0.5, 15.0
"""Range of a Gaussian's size, in units of `SIGMA_UNIT`."""

SIGMA_UNIT = 0.1
"""A size of 1, as a fraction of (1 / fx + 1 / fy): sizes are 0.1 to 3 pixels if fx = fy."""

HARMONICS_DC = 0.28209479177387814
"""The constant basis function of degree 0."""


@dataclass(frozen=True)
class Rays:
    """Camera data for placing one Gaussian per pixel, on the features' device and in their dtype.

    Attributes:
        rotation: world from camera.
        centre: optical centre in the world.
        inverse_k: K^-1.
        pixel: 1 / fx + 1 / fy.
        quaternion: of the rotation, (w, x, y, z).
        others: projections to the other views of the scene; None if they are not needed.
    """

    rotation: Float[Tensor, "n 3 3"]
    centre: Float[Tensor, "n 3"]
    inverse_k: Float[Tensor, "n 3 3"]
    pixel: Float[Tensor, " n"]
    quaternion: Float[Tensor, "n 4"]
    others: Others | None = None

    @staticmethod
    def of(cameras: Cameras, like: Tensor) -> Rays:
        """From cameras [n], computed in float64."""
        rotation = cameras.world_from_camera[..., :3, :3]
        return Rays(
            rotation.to(like),
            cameras.centres.to(like),
            torch.linalg.inv(cameras.intrinsics).to(like),
            (1 / cameras.focal_px).sum(-1).to(like),
            quaternion_from_matrix(rotation).to(like),
        )

    def __getitem__(self, at: slice) -> Rays:
        """The data of some of the cameras."""
        others = None if self.others is None else self.others[at]
        return Rays(self.rotation[at], self.centre[at], self.inverse_k[at], self.pixel[at], self.quaternion[at], others)


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
    world = torch.einsum("nij,nhwj->nhwi", rays.rotation, directions(depths, offsets, rays, conventions))
    return world * depths[..., None] + rays.centre[:, None, None]


@outside_autocast
def directions(
    depths: Float[Tensor, "n h w"], offsets: Float[Tensor, "n 2 h w"] | None, rays: Rays, conventions: Conventions
) -> Float[Tensor, "n h w 3"]:
    """Means at a depth of 1, in the frames of their own cameras."""
    centres = pixel_centres((depths.shape[-2], depths.shape[-1]), depths.dtype).to(depths.device)
    if offsets is None:
        shifted = centres.expand(len(depths), -1, -1, -1)
    else:
        shifted = centres + (offsets.sigmoid() - 0.5).permute(0, 2, 3, 1)
    homogeneous = torch.cat((shifted, torch.ones_like(shifted[..., :1])), dim=-1)
    found = torch.einsum("nij,nhwj->nhwi", rays.inverse_k, homogeneous)
    if not conventions.z_depth:
        found = nn.functional.normalize(found, dim=-1)
    return found


def shapes(
    scales: Float[Tensor, "n 3 h w"], quaternions: Float[Tensor, "n 4 h w"], depths: Float[Tensor, "n h w"], rays: Rays
) -> tuple[Float[Tensor, "n h w 3"], Float[Tensor, "n h w 4"]]:
    """Standard deviations [m] and world quaternions (w, x, y, z) from raw sizes and raw camera-frame (x, y, z, w)."""
    size = SMALLEST_SIGMA + (LARGEST_SIGMA - SMALLEST_SIGMA) * scales.sigmoid()
    unit = SIGMA_UNIT * rays.pixel[:, None, None] * depths
    length = quaternions.square().sum(1, keepdim=True).clamp(min=1e-16).sqrt()  # much faster than a norm over this axis
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
        images: colours to add to the constant harmonic, so that the network predicts a correction; None adds nothing.
        depths: of the Gaussians [m].
        rays: of the cameras.
        conventions: of geometry; they define the basis of the harmonics.
    """
    raw = raw.to(depths.dtype)
    scales, quaternions = shapes(raw[:, :3], raw[:, 3:7], depths, rays)
    harmonics = torch.unflatten(raw[:, 7:], 1, (3, -1)).permute(0, 3, 4, 2, 1)
    terms = harmonics.shape[-2]
    degrees = torch.arange(terms, device=raw.device, dtype=raw.dtype).sqrt().floor()
    damping = torch.where(degrees == 0, 1, 0.1 * 0.25**degrees)
    harmonics = rotate_harmonics(
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


@outside_autocast
def footprints(means: Float[Tensor, "n h w 3"], rays: Rays, stride: int) -> Float[Tensor, "n h w"]:
    """The variance in the world of the blur that splatting adds in each Gaussian's own view, without a gradient [m^2].

    Args:
        means: of the Gaussians, by their own view, row and column.
        rays: of the cameras at the Gaussians' scale.
        stride: pixels of the image along each side of a Gaussian's block.
    """
    away = means.detach() - rays.centre[:, None, None]
    depths = (away * rays.rotation[:, None, None, :, 2]).sum(-1)
    pixels = rays.inverse_k[:, 0, 0] * rays.inverse_k[:, 1, 1] / stride**2
    return BLUR_PX2 * depths.square() * pixels[:, None, None]


@dataclass(frozen=True)
class Placer:
    """Gives Gaussians their position, shape and appearance in the world.

    Attributes:
        stride: pixels per Gaussian along each side.
        from_image: add the image's own colour to the predicted one.
        conventions: of geometry.
        shrink_seen: exponent of `semgs.scene.overlap.shrinkage` for the sizes of colour Gaussians; 0 for no shrinkage.
    """

    stride: int
    from_image: bool
    conventions: Conventions
    shrink_seen: float = 0.0

    def rays(self, inputs: NetworkInput, size: tuple[int, int], like: Tensor) -> Rays:
        """Camera data of all views, at the Gaussians' scale.

        Args:
            inputs: the views.
            size: (height, width) of the images before padding [px].
            like: a tensor with the device and dtype of the result.
        """
        rays = Rays.of(shrink_cameras(inputs.cameras, self.stride).flatten(), like)
        if self.shrink_seen == 0 or inputs.views <= PAIR:
            return rays
        return replace(rays, others=Others.of(inputs.cameras, size, like))

    def __call__(
        self,
        decoded: RawGaussians,
        raw: Float[Tensor, "n channel h w"] | None,
        small: Float[Tensor, "n 3 h w"],
        rays: Rays,
        depth_range: Float[Tensor, "n 2"],
        size: tuple[int, int],
    ) -> Encoding:
        """Each view as a scene of its own, cropped.

        Args:
            decoded: of the n views.
            raw: output of the semantic head; None for Gaussians without semantics.
            small: the images at the Gaussians' scale.
            rays: of their cameras.
            depth_range: near and far of the views [m].
            size: (height, width) of the images before padding [px].
        """
        depths = decoded.depths
        means = points(depths, decoded.offsets, rays, self.conventions)
        shown = small if self.from_image else None
        appearance = colour_appearance(decoded.attributes, shown, depths, rays, self.conventions)
        if rays.others is not None:
            own = directions(depths, decoded.offsets, rays, self.conventions) * depths[..., None]
            factors = shrinkage(seen_by(own, rays.others), self.shrink_seen)
            appearance = replace(appearance, scales=appearance.scales * factors.flatten(1)[..., None])
        semantic = None if raw is None else semantic_appearance(raw, depths, rays)
        kept = tuple((side + self.stride - 1) // self.stride for side in size)

        def gathered(tensor: Tensor) -> Tensor:
            maps = tensor.reshape(*depths.shape, *tensor.shape[2:])
            return maps[:, : kept[0], : kept[1]].flatten(1, 2)

        blurs = footprints(means, rays, self.stride).flatten(1)
        flat = Gaussians(means.flatten(1, 2), decoded.opacities.flatten(1), appearance, semantic, blurs)
        return Encoding(
            flat.map(gathered),
            self._full(depths, size),
            self._full(decoded.confidences, size),
            self._full(decoded.depth_spread, size),
            depth_range[:, None],
            stride=self.stride,
        )

    def _full(self, maps: Float[Tensor, "n h w"], size: tuple[int, int]) -> Float[Tensor, "n 1 height width"]:
        """Maps at the images' own scale."""
        return widen(maps, self.stride)[:, None, : size[0], : size[1]]

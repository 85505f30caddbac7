"""Input and output of one pass of splatting, in the form that back-ends take: one scene's Gaussians with one appearance, one camera with its near plane, and one view of them."""

from __future__ import annotations

from dataclasses import dataclass

from jaxtyping import Float, Float64
from torch import Tensor

from semgs.geometry.cameras import Cameras
from semgs.rendering.rules import CLAMP_MARGIN, MEDIAN_FRACTION, NEAR_FRACTION


@dataclass(frozen=True)
class Splats:
    """One scene's Gaussians with the features that one pass blends.

    Attributes:
        means: positions in the world [m].
        quaternions: axes in the world (w, x, y, z).
        scales: standard deviations along the axes [m].
        opacities: 0..1.
        features: to blend: colour and depth, or a class distribution.
    """

    means: Float[Tensor, "g 3"]
    quaternions: Float[Tensor, "g 4"]
    scales: Float[Tensor, "g 3"]
    opacities: Float[Tensor, " g"]
    features: Float[Tensor, "g c"]


@dataclass(frozen=True)
class Layer:
    """One view of splats, without a background.

    Attributes:
        picture: sum_i w_i f_i.
        transmittance: 1 - sum_i w_i, the light that passes all Gaussians; a back-end may use a finer dtype.
    """

    picture: Float[Tensor, "c h w"]
    transmittance: Float[Tensor, "h w"]


@dataclass(frozen=True)
class Pinhole:
    """One pinhole camera without skew. Its pose is float64, so that precision does not suffer far from the world's origin.

    Attributes:
        axes: rows are the camera's x, y and z axes in the world (the rotation from world to camera).
        centre: optical centre in the world [m].
        focal_px: (fx, fy).
        principal_px: (cx, cy), from the corner of the first pixel.
        size: (height, width) [px].
    """

    axes: Float64[Tensor, "3 3"]
    centre: Float64[Tensor, " 3"]
    focal_px: tuple[float, float]
    principal_px: tuple[float, float]
    size: tuple[int, int]

    @classmethod
    def of(cls, camera: Cameras) -> Pinhole:
        """The camera of a `Cameras` without leading axes.

        Raises:
            ValueError: its intrinsics have skew.
        """
        k = camera.intrinsics
        if k[0, 1] != 0:
            raise ValueError(f"intrinsics have skew {float(k[0, 1]):g}; expected 0, splatting projects without skew")
        pose = camera.world_from_camera
        return cls(
            axes=pose[:3, :3].mT,
            centre=pose[:3, 3],
            focal_px=(float(k[0, 0]), float(k[1, 1])),
            principal_px=(float(k[0, 2]), float(k[1, 2])),
            size=camera.size,
        )

    @property
    def slope_limits(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(lowest, highest) x/z and y/z that the Jacobian of the projection may see."""
        (fx, fy), (cx, cy), (height, width) = self.focal_px, self.principal_px, self.size
        margin_x, margin_y = CLAMP_MARGIN * width, CLAMP_MARGIN * height
        return (
            ((-cx - margin_x) / fx, (width - cx + margin_x) / fx),
            ((-cy - margin_y) / fy, (height - cy + margin_y) / fy),
        )

    def offsets(self, means: Float[Tensor, "g 3"]) -> Float[Tensor, "g 3"]:
        """Positions relative to the optical centre, along the world's axes [m].

        The subtraction is done in float64: a kilometre from the world's origin, float32 would be off by a tenth of a millimetre.
        """
        return (means.double() - self.centre.to(means.device)).to(means.dtype)


def near_plane(depths: Float[Tensor, " g"], near: float | None) -> float:
    """The z-depth [m] up to which nothing is rendered: a fraction of the near bound or, without one, of the median depth."""
    if near is not None:
        return NEAR_FRACTION * near
    in_front = depths[depths > 0]
    return MEDIAN_FRACTION * float(in_front.median()) if len(in_front) else 0.0

"""Gaussians: the content of a scene, as activated quantities, independent of how a network or file encodes them; and the same in another frame."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import torch
from jaxtyping import Float, Float64
from torch import Tensor

from semgs.geometry.cameras import Cameras
from semgs.geometry.harmonics import rotate_harmonics
from semgs.geometry.rotations import quaternion_from_matrix, quaternion_product
from semgs.geometry.summaries import describe, describe_tensor


@dataclass(frozen=True)
class Appearance:
    """One branch's part of each Gaussian: shape and features.

    Attributes:
        quaternions: axes in the world as unit quaternions (w, x, y, z).
        scales: standard deviations along the axes [m].
        features: colour harmonics [... g k 3] in the standard 3DGS basis, degree order, k = 1, 4, 9 or 16 (colour is
            0.5 + their sum, clamped below at 0), or a class distribution [... g class] that sums to 1.
    """

    quaternions: Float[Tensor, "*batch g 4"]
    scales: Float[Tensor, "*batch g 3"]
    features: Float[Tensor, " ..."]

    def __post_init__(self) -> None:
        leading = self.quaternions.shape[:-1]
        if self.scales.shape[:-1] != leading or self.features.shape[: len(leading)] != leading:
            raise ValueError(
                f"quaternions are {tuple(self.quaternions.shape)}, scales {tuple(self.scales.shape)}, features "
                f"{tuple(self.features.shape)}; their leading axes [... gaussian] must be equal"
            )
        if self.quaternions.shape[-1:] != (4,) or self.scales.shape[-1:] != (3,):
            raise ValueError(
                f"quaternions are {tuple(self.quaternions.shape)} and scales {tuple(self.scales.shape)}; expected [... g 4] and [... g 3]"
            )

    def __repr__(self) -> str:
        return f"Appearance(features {describe_tensor(self.features)}; scales {describe_tensor(self.scales)})"


@dataclass(frozen=True)
class Gaussians:
    """Dual Gaussians: colour and semantic appearance with shared positions and opacities.

    Attributes:
        means: positions in the world [m].
        opacities: 0..1.
        colour: appearance whose features are harmonics [... g k 3].
        semantic: appearance whose features are class distributions [... g class]; None for a colour-only model.
        footprints: variance in the world of the blur that splatting added in each Gaussian's own input view [m^2]; None for splats of other programs.
            No shape contains it. A camera with smaller pixels has to add what its own blur lacks (`render` with `footprint`).
    """

    means: Float[Tensor, "*batch g 3"]
    opacities: Float[Tensor, "*batch g"]
    colour: Appearance
    semantic: Appearance | None = None
    footprints: Float[Tensor, "*batch g"] | None = None

    def __post_init__(self) -> None:
        leading = self.means.shape[:-1]
        if self.footprints is not None and self.footprints.shape != leading:
            raise ValueError(
                f"footprints are {tuple(self.footprints.shape)}; expected {tuple(leading)}, one for each Gaussian"
            )
        if self.means.shape[-1:] != (3,) or self.opacities.shape != leading:
            raise ValueError(
                f"means are {tuple(self.means.shape)} and opacities {tuple(self.opacities.shape)}; expected [... g 3] and [... g]"
            )
        for name, appearance in (("colour", self.colour), ("semantic", self.semantic)):
            if appearance is not None and appearance.quaternions.shape[:-1] != leading:
                raise ValueError(
                    f"{name} has {tuple(appearance.quaternions.shape[:-1])} Gaussians but means has {tuple(leading)}"
                )
        harmonics = self.colour.features.shape[len(leading) :]
        if len(harmonics) != 2 or harmonics[0] not in (1, 4, 9, 16) or harmonics[1] != 3:
            raise ValueError(
                f"colour.features are {tuple(self.colour.features.shape)}; expected [... g k 3] with k = 1, 4, 9 or 16"
            )
        if self.semantic is not None and self.semantic.features.ndim != len(leading) + 1:
            raise ValueError(f"semantic.features are {tuple(self.semantic.features.shape)}; expected [... g class]")

    def __repr__(self) -> str:
        return describe(
            "Gaussians", means=self.means, opacities=self.opacities, colour=self.colour, semantic=self.semantic
        )

    @classmethod
    def check_type(cls, value: object) -> None:
        """Refuse what is given for Gaussians and is none.

        Raises:
            TypeError: it has another type.
        """
        if not isinstance(value, cls):
            raise TypeError(
                f"gaussians are {type(value).__name__}; expected semgs.Gaussians, such as encoding.gaussians or load_scene(...).gaussians"
            )

    def checked(self) -> Gaussians:
        """These Gaussians, every number checked.

        Raises:
            ValueError: one is not finite, an opacity is not in 0..1, a scale is negative, or the length of a quaternion is not 1 (to
                0.001).
        """
        for name, tensor in self.tensors().items():
            if not torch.isfinite(tensor).all():
                raise ValueError(f"{name} contain a number that is not finite")
            for part, good, expected in (
                ("opacities", (tensor >= 0) & (tensor <= 1), "0 to 1"),
                ("scales", tensor >= 0, "0 or more"),
                ("footprints", tensor >= 0, "0 or more"),
                ("quaternions", (tensor.norm(dim=-1) - 1).abs() < 1e-3, "a length of 1"),
            ):
                if name.endswith(part) and not good.all():
                    raise ValueError(f"{name} contain {tensor[~good][0].tolist()}; expected {expected}")
        return self

    def tensors(self) -> dict[str, Tensor]:
        """Every tensor by its name, such as "colour.scales"."""
        branches = {"colour": self.colour, "semantic": self.semantic}
        shapes = {
            f"{branch}.{name}": one for branch, shape in branches.items() if shape for name, one in vars(shape).items()
        }
        footprints = {} if self.footprints is None else {"footprints": self.footprints}
        return {"means": self.means, "opacities": self.opacities, **shapes, **footprints}

    def __len__(self) -> int:
        """The number of Gaussians of one scene."""
        return self.means.shape[-2]

    def map(self, function) -> Gaussians:
        """The same Gaussians with `function` applied to each tensor (to move, cast, index or detach them all)."""

        def mapped(appearance: Appearance) -> Appearance:
            return Appearance(*(function(getattr(appearance, field.name)) for field in fields(Appearance)))

        return replace(
            self,
            means=function(self.means),
            opacities=function(self.opacities),
            colour=mapped(self.colour),
            semantic=None if self.semantic is None else mapped(self.semantic),
            footprints=None if self.footprints is None else function(self.footprints),
        )

    def blurred(self, variances: Float[Tensor, "*batch g"]) -> Gaussians:
        """The same Gaussians, wider in all directions, and without footprints.

        Args:
            variances: added to the squares of all scales [m^2].
        """

        def widened(shape: Appearance) -> Appearance:
            return replace(shape, scales=(shape.scales.square() + variances[..., None]).sqrt())

        semantic = None if self.semantic is None else widened(self.semantic)
        return replace(self, colour=widened(self.colour), semantic=semantic, footprints=None)

    def with_footprints(self) -> Gaussians:
        """The same Gaussians with their footprints in their shapes, for files and viewers, whose pixels are not known; unchanged without footprints."""
        return self if self.footprints is None else self.blurred(self.footprints)

    def to(self, *args, **kwargs) -> Gaussians:
        """The same Gaussians on another device or in another dtype; arguments as for `Tensor.to`."""
        return self.map(lambda tensor: tensor.to(*args, **kwargs))

    def detach(self) -> Gaussians:
        """The same Gaussians without their gradient."""
        return self.map(torch.Tensor.detach)


def move_gaussians(b_from_a: Float64[Tensor, "4 4"], gaussians: Gaussians, *, scale: float = 1.0) -> Gaussians:
    """The Gaussians of one scene in another frame: positions, axes, sizes and the harmonics of their colours.

    Positions x become scale R x + t, computed in float64 and rounded once.

    Args:
        b_from_a: R and t, rotation and translation from the frame of the Gaussians to the other.
        gaussians: without a batch axis.
        scale: length of a unit of the Gaussians' frame in the other.
    """
    rotation = b_from_a[:3, :3]
    turn = quaternion_from_matrix(rotation)
    means = scale * gaussians.means.double() @ rotation.T + b_from_a[:3, 3]
    harmonics = rotate_harmonics(gaussians.colour.features[None], rotation[None])[0]

    def turned(shape: Appearance) -> Appearance:
        scales = shape.scales if scale == 1 else (scale * shape.scales.double()).to(shape.scales)
        return Appearance(quaternion_product(turn.to(shape.quaternions), shape.quaternions), scales, shape.features)

    return replace(
        gaussians,
        means=means.to(gaussians.means),
        colour=replace(turned(gaussians.colour), features=harmonics),
        semantic=None if gaussians.semantic is None else turned(gaussians.semantic),
        footprints=None if gaussians.footprints is None else scale**2 * gaussians.footprints,
    )


def move_cameras(b_from_a: Float64[Tensor, "4 4"], cameras: Cameras) -> Cameras:
    """The cameras in another frame; arguments as for `move_gaussians`."""
    return Cameras.trusted(b_from_a @ cameras.world_from_camera, cameras.intrinsics, cameras.size)

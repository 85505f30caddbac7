"""Encoding: the output of the network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import torch
from jaxtyping import Bool, Float, Int64, Shaped
from numpy import ndindex
from torch import Tensor

from semgs.data.tables.classes import ClassTable
from semgs.files.images.notebook import depth_row, html
from semgs.geometry.cameras import Cameras
from semgs.geometry.fusion import fuse_classes
from semgs.geometry.gaussians import Appearance, Gaussians
from semgs.geometry.summaries import array_of, describe
from semgs.rendering.render import render
from semgs.rendering.rendering import Rendering
from semgs.rendering.temperatures import Temperatures

SUMS_TO_1 = 1e-3
"""Probabilities sum to 1 up to this."""


@dataclass(frozen=True)
class Encoding:
    """The network's output for a set of input views.

    Attributes:
        gaussians: in the order view, row, column.
        depths: z-depth of every pixel of the input views, at their full size [m].
        confidences: the largest probability among the depth candidates, at the same size, 0..1; 1 where a sensor measured the depth.
        depth_spread: standard deviation of log depth under the candidates' distribution, at the same size: 0.1 is about 10 % of the
            depth. It carries no gradient.
        depth_range: near and far of the input views, unchanged, in float64 on the CPU [m].
        classes: the class table of the Gaussians; None for a colour-only network, or if unknown.
        temperatures: calibrate the class distributions; None if unknown.
        stride: pixels along each side of the block that a Gaussian stands for.
        places: of each Gaussian the number of its block, in the order view, row, column, in scenes merged from several windows or without
            hidden pixels; None if every block has a Gaussian.
    """

    gaussians: Gaussians
    depths: Float[Tensor, "*batch v h w"]
    confidences: Float[Tensor, "*batch v h w"]
    depth_spread: Float[Tensor, "*batch v h w"]
    depth_range: Float[Tensor, "*batch v 2"]
    classes: ClassTable | None = None
    temperatures: Temperatures | None = None
    stride: int = 1
    places: Int64[Tensor, " g"] | None = None

    def __repr__(self) -> str:
        return describe(
            "Encoding",
            gaussians=self.gaussians,
            depths=self.depths,
            confidences=self.confidences,
            depth_spread=self.depth_spread,
            depth_range=self.depth_range,
            classes=self.classes and f"{self.classes.name}, {len(self.classes)} classes",
        )

    def _repr_html_(self) -> str:
        """Depth and its confidence, for notebooks; `render` gives the images."""
        return html(
            repr(self),
            [depth_row("depths", array_of(self.depths)), depth_row("confidences", array_of(self.confidences))],
        )

    def render(self, cameras: Cameras, **options: Any) -> Rendering:
        """Render the Gaussians from cameras. The near bound is the smallest of each scene's input views.

        Args:
            cameras: the views of each scene, [v] or [*batch v].
            options: as for `semgs.render`; `near` overrides that bound.

        Raises:
            ValueError, ImportError: as `semgs.render`.
        """
        near = self.depth_range[..., 0].amin(-1, keepdim=True)
        rendering = render(self.gaussians, cameras, **({"near": near} | options))
        temperature = None if self.temperatures is None else self.temperatures.rendered
        return replace(rendering, classes=self.classes, temperature=temperature)

    def with_classes(self, distributions: Float[Tensor, "*batch v class h w"], classes: ClassTable) -> Encoding:
        """The same Gaussians with other classes: each takes the distribution of the pixels that it stands for.

        Semantic Gaussians keep their shapes. Without a semantic branch they take those of the colour Gaussians. The temperatures of the
        former classes are dropped.

        Args:
            distributions: over the classes of every pixel of the context views, at their size; summing to 1.
            classes: the table.

        Raises:
            ValueError: the maps are not of the context views' size, have other classes than the table, or do not sum to 1.
        """
        height, width = self.depths.shape[-2:]
        expected = (*self.depths.shape[:-2], len(classes), height, width)
        if tuple(distributions.shape) != expected:
            raise ValueError(
                f"distributions are {tuple(distributions.shape)}; expected {expected}: views, the {len(classes)} classes of {classes.name}, height, width"
            )
        if not torch.isfinite(distributions).all() or (distributions.sum(-3) - 1).abs().max() > SUMS_TO_1:
            raise ValueError("the distributions do not sum to 1 over the classes")
        features = self.per_gaussian(distributions)
        features = features / features.sum(-1, keepdim=True)
        return self._with_features(features, classes)

    def _with_features(self, features: Float[Tensor, "*batch g class"], classes: ClassTable) -> Encoding:
        """The same Gaussians with class distributions over a table."""
        semantic = replace(self.gaussians.semantic or self.gaussians.colour, features=features)
        return replace(self, gaussians=replace(self.gaussians, semantic=semantic), classes=classes, temperatures=None)

    def regrouped(self, classes: ClassTable) -> Encoding:
        """The same Gaussians in a coarser table: the probabilities of classes that it does not tell apart add up. Temperatures are dropped.

        Args:
            classes: the table.

        Raises:
            ValueError: the Gaussians have no classes, or the table does not contain theirs (`ClassTable.within`).
        """
        of = None if self.classes is None else self.classes.within(classes)
        if of is None or self.gaussians.semantic is None:
            raise ValueError(f"the classes of the Gaussians are not in the table {classes.name}")
        features = self.gaussians.semantic.features
        member = torch.nn.functional.one_hot(torch.tensor(of), len(classes)).to(features)
        return self._with_features(features @ member, classes)

    def per_gaussian(self, maps: Shaped[Tensor, "*batch v c h w"]) -> Float[Tensor, "*batch g c"]:
        """For each Gaussian the mean over the pixels that it stands for.

        Args:
            maps: of the context views, at their size; numbers or booleans.
        """
        return per_gaussian(maps.to(self.gaussians.means), self.stride, self.places)

    def with_depths(
        self,
        depths: Float[Tensor, "*batch v h w"],
        cameras: Cameras,
        *,
        opacities: Float[Tensor, "*batch v h w"] | None = None,
        confidences: Float[Tensor, "*batch v h w"] | None = None,
        depth_spread: Float[Tensor, "*batch v h w"] | None = None,
    ) -> Encoding:
        """The same Gaussians at other depths: each moves along its own ray and grows with its depth, as the network's sizes do.

        A Gaussian that stands for several pixels takes the lower median of their depths, so that it lies on one of their surfaces, and the
        mean of the other maps.

        Args:
            depths: z-depth of every pixel of the context views, at their size [m].
            cameras: of the context views.
            opacities: of the Gaussian at each pixel, 0..1; None leaves them unchanged.
            confidences, depth_spread: for the encoding; None leaves them unchanged.

        Raises:
            ValueError: a map is not of the context views' size, or a depth is not a positive number.
        """
        given = {"depths": depths, "opacities": opacities, "confidences": confidences, "depth_spread": depth_spread}
        for name, maps in given.items():
            if maps is not None and maps.shape != self.depths.shape:
                raise ValueError(
                    f"{name} are {tuple(maps.shape)}; expected {tuple(self.depths.shape)}: views, height, width"
                )
        if not (torch.isfinite(depths).all() and (depths > 0).all()):
            raise ValueError("depths contain a number that is not finite or not positive; expected a depth everywhere")
        stride = self.stride
        means = self.gaussians.means
        own_depths = _lower_median(depths.to(means), stride)
        ratios = (own_depths / self._z_depths(cameras)).flatten(-3)
        centres = cameras.centres.to(means).repeat_interleave(own_depths.shape[-2] * own_depths.shape[-1], -2)

        def resize(shape: Appearance) -> Appearance:
            return replace(shape, scales=shape.scales * ratios[..., None])

        def block_means(maps: Tensor) -> Tensor:
            return self.per_pixel(_means(maps, stride))

        gaussians = replace(
            self.gaussians,
            means=centres + (means - centres) * ratios[..., None],
            colour=resize(self.gaussians.colour),
            semantic=None if self.gaussians.semantic is None else resize(self.gaussians.semantic),
            footprints=None if self.gaussians.footprints is None else self.gaussians.footprints * ratios.square(),
        )
        if opacities is not None:
            gaussians = replace(gaussians, opacities=_means(opacities, stride).flatten(-3).to(means))
        return replace(
            self,
            gaussians=gaussians,
            depths=self.per_pixel(own_depths),
            confidences=self.confidences if confidences is None else block_means(confidences),
            depth_spread=self.depth_spread if depth_spread is None else block_means(depth_spread),
        )

    def hide(self, hidden: Bool[Tensor, "*batch v h w"] | None) -> Encoding:
        """The same Gaussians, those that stand for a hidden pixel without opacity.

        Args:
            hidden: pixels of the context views, as `Views.hidden`; None hides nothing.
        """
        if hidden is None:
            return self
        opacities = self.gaussians.opacities.masked_fill(self._stand_for(hidden), 0)
        return replace(self, gaussians=replace(self.gaussians, opacities=opacities))

    def without(self, hidden: Bool[Tensor, "v h w"] | None) -> Encoding:
        """The Gaussians of one scene that stand for no hidden pixel; arguments as for `hide`."""
        if hidden is None:
            return self
        keep = ~self._stand_for(hidden)
        return replace(self, gaussians=self.gaussians.map(lambda tensor: tensor[keep]), places=self.blocks[keep.cpu()])

    @property
    def grid(self) -> tuple[int, int]:
        """Rows and columns of blocks in each context view."""
        height, width = self.depths.shape[-2:]
        return -(-height // self.stride), -(-width // self.stride)

    @property
    def blocks(self) -> Int64[Tensor, " g"]:
        """The block of each Gaussian of one scene: `places`, also where every block has a Gaussian."""
        return torch.arange(len(self.gaussians)) if self.places is None else self.places

    @property
    def own_views(self) -> Int64[Tensor, " g"]:
        """The context view of each Gaussian of one scene."""
        rows, columns = self.grid
        return self.blocks // (rows * columns)

    def _stand_for(self, pixels: Bool[Tensor, "*batch v h w"]) -> Bool[Tensor, "*batch g"]:
        """Whether each Gaussian stands for one of some pixels of the context views."""
        return self.per_gaussian(pixels[..., None, :, :])[..., 0] > 0

    def placed_depths(self, cameras: Cameras) -> Float[Tensor, "*batch v h w"]:
        """The z-depth of the Gaussian at each pixel of the context views [m].

        This is `depths`, but for MVSplat's conventions, where `depths` are distances along the rays.
        """
        return self.per_pixel(self._z_depths(cameras))

    def opacity_maps(self) -> Float[Tensor, "*batch v h w"]:
        """The opacity of the Gaussian at each pixel of the context views."""
        return self.per_pixel(self._maps(self.gaussians.opacities))

    def _maps(self, numbers: Float[Tensor, "*batch g"]) -> Float[Tensor, "*batch v rows columns"]:
        """A number of each Gaussian, by view, row and column.

        Raises:
            ValueError: the Gaussians are not those of whole views.
        """
        if self.places is not None:
            raise ValueError("expected Gaussians for each pixel or block of pixels of the views")
        return numbers.reshape(*numbers.shape[:-1], self.depths.shape[-3], *self.grid)

    def _z_depths(self, cameras: Cameras) -> Float[Tensor, "*batch v rows columns"]:
        """The z-depth of each Gaussian in its own view [m]."""
        maps = torch.stack([self._maps(one) for one in self.gaussians.means.unbind(-1)], -1)
        pose = cameras.world_from_camera.to(maps)[..., None, None, :3, :]
        return ((maps - pose[..., 3]) * pose[..., 2]).sum(-1)

    def per_pixel(self, maps: Float[Tensor, "*batch v rows columns"]) -> Float[Tensor, "*batch v h w"]:
        """A number for each Gaussian, repeated for the pixels that it stands for."""
        height, width = self.depths.shape[-2:]
        return maps.repeat_interleave(self.stride, -2).repeat_interleave(self.stride, -1)[..., :height, :width]

    def class_maps(self) -> Float[Tensor, "*batch v class h w"]:
        """The class distribution of the Gaussian at each pixel of the input views: what `with_classes` takes.

        Raises:
            ValueError: the Gaussians have no classes.
        """
        if self.gaussians.semantic is None:
            raise ValueError("the Gaussians have no classes")
        return self.per_pixel(self._class_grid(self.gaussians.semantic.features))

    def fused(self, cameras: Cameras) -> Encoding:
        """The same Gaussians with classes on which the input views agree, by the rule of `semgs.geometry.fusion`.

        Each Gaussian asks for the class at its place in every other view that sees it there, and takes the mean of the log probabilities.

        Args:
            cameras: of the input views.

        Raises:
            ValueError: the Gaussians have no classes, or are not those of whole views.
        """
        semantic = self.gaussians.semantic
        if semantic is None or self.places is not None:
            raise ValueError("expected Gaussians with classes, one for each pixel or block of pixels of the views")
        grid, depths = self._class_grid(semantic.features), self._z_depths(cameras)
        spread = _means(self.depth_spread, self.stride)
        scale = torch.diag(torch.tensor([1 / self.stride, 1 / self.stride, 1.0], dtype=torch.float64))
        small = cameras.adjusted(scale, (grid.shape[-2], grid.shape[-1]))
        scenes = ndindex(*grid.shape[:-4])
        agreed = torch.stack([fuse_classes(grid[at], depths[at], spread[at], small[at]) for at in scenes])
        features = agreed.movedim(-3, -1).reshape(semantic.features.shape)
        return replace(self, gaussians=replace(self.gaussians, semantic=replace(semantic, features=features)))

    def _class_grid(self, features: Float[Tensor, "*batch g class"]) -> Float[Tensor, "*batch v class rows columns"]:
        """The class distribution of each Gaussian, by view, row and column."""
        return torch.stack([self._maps(share) for share in features.unbind(-1)], -3)

    def map(self, function: Callable[[Tensor], Tensor]) -> Encoding:
        """The same encoding with `function` applied to each tensor, those of the Gaussians included."""
        return replace(
            self,
            gaussians=self.gaussians.map(function),
            depths=function(self.depths),
            confidences=function(self.confidences),
            depth_spread=function(self.depth_spread),
            depth_range=function(self.depth_range),
        )

    def tensors(self) -> list[Tensor]:
        """Every tensor, those of the Gaussians included."""
        return [*self.gaussians.tensors().values(), self.depths, self.confidences, self.depth_spread, self.depth_range]

    def to(self, device: torch.device | str, dtype: torch.dtype) -> Encoding:
        """The same encoding on a device and in a dtype; the near and far bounds stay as they are."""
        moved = self.map(lambda tensor: tensor.to(device, dtype))
        return replace(moved, depth_range=self.depth_range)


def per_gaussian(
    maps: Float[Tensor, "*batch v c h w"], stride: int, places: Int64[Tensor, " g"] | None = None
) -> Float[Tensor, "*batch g c"]:
    """For each of a scene's Gaussians the mean over the pixels that it stands for.

    Args:
        maps: of the context views.
        stride, places: of the scene, as in `Encoding`.
    """
    blocks = _means(maps, stride).flatten(-2).mT.reshape(*maps.shape[:-4], -1, maps.shape[-3])
    return blocks if places is None else blocks[..., places.to(blocks.device), :]


def _means(maps: Float[Tensor, "*batch c h w"], stride: int) -> Float[Tensor, "*batch c rows columns"]:
    """The mean of the pixels that each Gaussian stands for."""
    pooled = torch.nn.functional.avg_pool2d(maps.reshape(-1, *maps.shape[-3:]), stride, ceil_mode=True)
    return pooled.reshape(*maps.shape[:-2], *pooled.shape[-2:])


def _lower_median(maps: Float[Tensor, "*batch v h w"], stride: int) -> Float[Tensor, "*batch v rows columns"]:
    """The lower median of the pixels that each Gaussian stands for; at the border only those inside count."""
    height, width = maps.shape[-2:]
    padded = torch.nn.functional.pad(maps, (0, -width % stride, 0, -height % stride), value=torch.nan)
    rows, columns = (side // stride for side in padded.shape[-2:])
    blocks = padded.reshape(*maps.shape[:-2], rows, stride, columns, stride).transpose(-3, -2)
    return blocks.flatten(-2).nanmedian(-1).values

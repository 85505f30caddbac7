"""Encoding: the output of the network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from semgs.data.classes import ClassTable
from semgs.files.notebook import depth_row, html
from semgs.geometry.cameras import Cameras
from semgs.geometry.gaussians import Gaussians
from semgs.geometry.summaries import array_of, summary
from semgs.rendering.render import render
from semgs.rendering.rendering import Rendering

SUMS_TO_1 = 1e-3
"""Probabilities sum to 1 up to this."""


@dataclass(frozen=True)
class Encoding:
    """The network's output for a set of input views.

    Attributes:
        gaussians: in the order view, row, column.
        depths: z-depth of every pixel of the input views, at their full size [m].
        confidences: the largest probability among the depth candidates, at the same size, 0..1.
        depth_spread: standard deviation of log depth under the candidates' distribution, at the same size: 0.1 is about 10 % of the
            depth. It carries no gradient.
        depth_range: near and far of the input views, unchanged, in float64 on the CPU [m].
        classes: the class table of the Gaussians; None for a colour-only network, or if unknown.
    """

    gaussians: Gaussians
    depths: Float[Tensor, "*batch v h w"]
    confidences: Float[Tensor, "*batch v h w"]
    depth_spread: Float[Tensor, "*batch v h w"]
    depth_range: Float[Tensor, "*batch v 2"]
    classes: ClassTable | None = None

    def __repr__(self) -> str:
        return summary(
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
        return replace(rendering, classes=self.classes)

    def with_classes(self, distributions: Float[Tensor, "*batch v class h w"], classes: ClassTable) -> Encoding:
        """The same Gaussians with other classes: each takes the distribution of the pixels that it stands for.

        Semantic Gaussians keep their shapes. Without a semantic branch they take those of the colour Gaussians.

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
        shape = self.gaussians.semantic or self.gaussians.colour
        semantic = replace(shape, features=features)
        return replace(self, gaussians=replace(self.gaussians, semantic=semantic), classes=classes)

    def per_gaussian(self, maps: Float[Tensor, "*batch v c h w"]) -> Float[Tensor, "*batch g c"]:
        """For each Gaussian the mean over the pixels that it stands for.

        Args:
            maps: of the context views, at their size.
        """
        stride = _stride(len(self.gaussians), *self.depths.shape[-3:])
        values = maps.to(self.gaussians.means)
        places = torch.nn.functional.avg_pool2d(values.flatten(end_dim=-4), stride, ceil_mode=True)
        return places.flatten(-2).mT.reshape(*self.gaussians.opacities.shape, maps.shape[-3])

    def class_maps(self) -> Float[Tensor, "*batch v class h w"]:
        """The class distribution of the Gaussian at each pixel of the input views: what `with_classes` takes.

        Raises:
            ValueError: the Gaussians have no classes.
        """
        if self.gaussians.semantic is None:
            raise ValueError("the Gaussians have no classes")
        views, height, width = self.depths.shape[-3:]
        stride = _stride(len(self.gaussians), views, height, width)
        rows, columns = -(-height // stride), -(-width // stride)
        features = self.gaussians.semantic.features
        maps = features.reshape(*features.shape[:-2], views, rows, columns, features.shape[-1]).movedim(-1, -3)
        return maps.repeat_interleave(stride, -2).repeat_interleave(stride, -1)[..., :height, :width]

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


def _stride(gaussians: int, views: int, height: int, width: int) -> int:
    """Pixels along each side of a Gaussian's place, from how many there are of both.

    Raises:
        ValueError: they do not stand on a grid of the views' pixels.
    """
    for stride in range(1, min(height, width) + 1):
        if views * -(-height // stride) * -(-width // stride) == gaussians:
            return stride
    raise ValueError(
        f"{gaussians} Gaussians for {views} views of {height}x{width}; expected one for each pixel or block of pixels"
    )

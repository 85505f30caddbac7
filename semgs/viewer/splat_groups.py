"""A scene as the splats of a viewer, one group for each class."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log10
from typing import Literal

import numpy as np
import torch
from jaxtyping import Bool, Float, Float32, Int64, UInt8
from torch import Tensor

from semgs.figures.class_images import UNKNOWN_GREY
from semgs.files.images.colours import Colour, depth_limits, depth_picture, heat_picture
from semgs.geometry.gaussians import Appearance
from semgs.geometry.rotations import covariance
from semgs.rendering.render_features import gather_maps
from semgs.rendering.rendering import UNSEEN, class_numbers
from semgs.scene.confidence import class_confidences
from semgs.scene.own_views import own_colours
from semgs.scene.scene_file import SavedScene

Mode = Literal["colour", "classes", "confidence", "depth", "things"]
"""What splats show: the photos' colours; the classes; the probability of the class; the depth in their own input view; the thing that each belongs to."""

TYPICAL_DEPTH = 10.0
"""The median depth of the input views in the viewer's units. Viewers store covariances in float16, which has its first normal number at a
standard deviation of 8 mm, is zero below 0.2 mm and ends at 255 m."""

LARGEST_VARIANCE = 60_000.0
"""In the viewer's units; just below the largest float16."""

GOLDEN = (5**0.5 - 1) / 2
"""Multiples of it, modulo 1, spread evenly."""

STEPS = 10
"""Of confidence: viewers hide what is less sure in steps of 10 %."""

ALL = "scene"
"""The group of a scene without classes."""

UNKNOWN_NAME = "unknown"
"""The group of the Gaussians without a class, or whose class is not sure enough."""


@dataclass(frozen=True)
class Group:
    """The Gaussians of one class.

    Attributes:
        name: of the class.
        colour: of the class.
        members: which Gaussians, in the order of the scene.
        share: of all Gaussians, 0..1.
    """

    name: str
    colour: Colour
    members: Int64[np.ndarray, " n"]
    share: float


@dataclass(frozen=True)
class SplatArrays:
    """Splats as viser takes them, in the viewer's units."""

    centres: Float32[np.ndarray, "n 3"]
    covariances: Float32[np.ndarray, "n 3 3"]
    colours: UInt8[np.ndarray, "n 3"]
    opacities: Float32[np.ndarray, "n 1"]

    def of(self, members: Int64[np.ndarray, " n"]) -> SplatArrays:
        """Some of the splats."""
        return SplatArrays(*(array[members] for array in vars(self).values()))


@dataclass(frozen=True)
class SceneSplats:
    """A scene as splats.

    Attributes:
        scene: the scene.
        scale: the viewer's units per unit of the scene.
        labels: the class of each Gaussian; the number of classes for unknown ones, and 0 for a scene without classes.
        groups: the classes that occur, the most frequent first.
        colours: of each Gaussian as its own input view sees it, because splats of viewers look the same from everywhere.
        confidences: as `class_confidences`.
        depths: along the optical axis of its own input view [unit of the scene].
        instances: the number of the thing that each Gaussian belongs to, 0 for none; None if things were not searched.
    """

    scene: SavedScene
    scale: float
    labels: Int64[np.ndarray, " g"]
    groups: tuple[Group, ...]
    colours: UInt8[np.ndarray, "g 3"]
    confidences: Float32[np.ndarray, " g"]
    depths: Float32[np.ndarray, " g"]
    instances: Int64[np.ndarray, " g"] | None = None

    @classmethod
    def of(
        cls,
        scene: SavedScene,
        min_confidence: float = 0.0,
        at_most: int | None = None,
        instances: Int64[np.ndarray, " g"] | None = None,
    ) -> SceneSplats:
        """The splats of a scene.

        Args:
            scene: the scene.
            min_confidence: Gaussians whose likeliest class is less likely are unknown.
            at_most: how many Gaussians the groups contain in total: those that cover most pixels of the input views. None is all.
            instances: the number of the thing that each Gaussian belongs to.
        """
        count = len(scene.gaussians)
        confidences = class_confidences(scene).numpy()
        depths = scene.per_gaussian(scene.depths).numpy()
        known = depths[depths > 0]
        labels, names, colours = np.zeros(count, np.int64), [ALL], [UNKNOWN_GREY]
        if scene.classes is not None and scene.gaussians.semantic is not None:
            labels = class_numbers(scene.gaussians.semantic.features).numpy()
            names, colours = [*scene.classes.names, UNKNOWN_NAME], [*scene.classes.colours, UNKNOWN_GREY]
            labels = np.where((confidences < min_confidence) | (labels == UNSEEN), len(scene.classes), labels)
        return cls(
            scene=scene,
            scale=TYPICAL_DEPTH / float(np.median(known)) if known.size else 1.0,
            labels=labels,
            groups=_groups(labels, names, colours, _covering(scene, at_most)),
            colours=np.rint(255 * own_colours(scene).numpy()).astype(np.uint8),
            confidences=confidences,
            depths=depths,
            instances=instances,
        )

    @property
    def modes(self) -> tuple[Mode, ...]:
        """What can be shown."""
        modes: tuple[Mode, ...] = ("colour", "classes", "confidence", "depth", "things")
        missing = {"classes": self.scene.classes is None, "things": self.instances is None}
        return tuple(mode for mode in modes if not missing.get(mode, False))

    @property
    def decimals(self) -> int:
        """Digits after the point of positions: centimetres, or, if the unit is unknown, at least a thousandth of the typical depth."""
        return 2 if self.scene.unit == "metric" else max(0, ceil(log10(1000 * self.scale / TYPICAL_DEPTH)))

    @property
    def depth_limits(self) -> tuple[float, float]:
        """The range of the colours of depth [unit of the scene]."""
        return depth_limits([self.scene.depths.numpy()])

    @property
    def steps(self) -> Int64[np.ndarray, " g"]:
        """The step of confidence of each Gaussian, 0..9."""
        return np.clip((STEPS * self.confidences).astype(np.int64), 0, STEPS - 1)

    def splats(self, mode: Mode, tint: float = 0.0, least: int = 0) -> SplatArrays:
        """All Gaussians in a mode, each with the shape that belongs to it: of the semantic Gaussians for classes, confidence and things.

        Args:
            mode: what the colours show.
            tint: strength of the class colours over the photos' colours, 0..1, if the mode is colour.
            least: Gaussians of lower steps of confidence are transparent.
        """
        gaussians = self.scene.gaussians.with_footprints()
        semantic = gaussians.semantic or gaussians.colour
        shape = semantic if mode in ("classes", "confidence", "things") else gaussians.colour
        return SplatArrays(
            centres=self.scale * gaussians.means.numpy(),
            covariances=_covariances(shape, self.scale),
            colours=self._shown(mode, tint),
            opacities=np.where(self.steps < least, np.float32(0), gaussians.opacities.numpy())[:, None],
        )

    def visible(self, hidden: Sequence[str], least: int = 0) -> Bool[np.ndarray, " g"]:
        """The Gaussians outside of some groups and of at least a step of confidence, those that were thinned out included."""
        visible = self.steps >= least
        for group in self.groups:
            if group.name in hidden:
                visible &= self.labels != self.labels[group.members[0]]
        return visible

    def _shown(self, mode: Mode, tint: float) -> UInt8[np.ndarray, "g 3"]:
        """The colour of each Gaussian."""
        if mode == "depth":
            return depth_picture(self.depths[None], self.depth_limits)[0]
        if mode == "things" and self.instances is not None:
            return thing_colours(self.instances)
        if mode == "confidence":
            return heat_picture(self.confidences[None], (0.0, 1.0))[0]
        strength = 1.0 if mode == "classes" else tint
        if self.scene.classes is None or strength == 0:
            return self.colours
        palette = np.array([*self.scene.classes.colours, UNKNOWN_GREY], np.float32)
        return np.rint(self.colours + strength * (palette[self.labels] - self.colours)).astype(np.uint8)


def thing_colours(instances: Int64[np.ndarray, " g"]) -> UInt8[np.ndarray, "g 3"]:
    """A colour for each number of a thing; grey for 0. Hues a golden angle apart, so that things with close numbers differ."""
    hues = (instances * GOLDEN % 1.0)[:, None]
    waves = np.cos(2 * np.pi * (hues - np.arange(3) / 3))
    colours = np.rint(140 + 100 * waves).astype(np.uint8)
    return np.where(instances[:, None] == 0, np.array(UNKNOWN_GREY, np.uint8), colours)


def _groups(
    labels: Int64[np.ndarray, " g"], names: Sequence[str], colours: Sequence[Colour], kept: Bool[np.ndarray, " g"]
) -> tuple[Group, ...]:
    """The classes that occur, the most frequent first; of each, the members that are kept."""
    counts = np.bincount(labels, minlength=len(names))
    order = sorted(np.flatnonzero(counts).tolist(), key=lambda label: -counts[label])
    groups = [
        Group(
            names[label], colours[label], np.flatnonzero((labels == label) & kept), float(counts[label] / len(labels))
        )
        for label in order
    ]
    return tuple(group for group in groups if len(group.members))


def _covering(scene: SavedScene, at_most: int | None) -> Bool[np.ndarray, " g"]:
    """The Gaussians that cover most pixels of the input views, counted by the light that each stops there; the first of equal ones."""
    kept = np.ones(len(scene.gaussians), np.bool_)
    if at_most is not None and at_most < len(kept):
        ones = torch.ones(1, 1, 1, 1).expand(len(scene.frames), 1, *scene.cameras.size)
        covered = torch.stack(gather_maps(scene.gaussians, ones, scene.cameras, near=scene.near)).sum((0, 2)).numpy()
        kept[np.argsort(-covered, kind="stable")[at_most:]] = False
    return kept


def _covariances(shape: Appearance, scale: float) -> Float[np.ndarray, "g 3 3"]:
    """Covariances in the viewer's units, smaller where float16 would overflow."""
    found: Tensor = covariance(shape.quaternions, scale * shape.scales)
    largest = found.diagonal(dim1=-2, dim2=-1).amax(-1)
    return (found * (LARGEST_VARIANCE / largest.clamp(min=LARGEST_VARIANCE))[:, None, None]).numpy()

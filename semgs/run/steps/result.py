"""A reconstruction: in the making, as a draft to which each step adds what it knows; and what it gives: the Gaussians, and what they look like from the cameras of their frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float, Float32, UInt8
from torch import Tensor

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.choosing.choice import Choice
from semgs.data.scene import Scene
from semgs.data.tables.classes import ClassTable
from semgs.data.views import Views
from semgs.depth_maps.map_depth import MapPlacement
from semgs.depth_maps.sensor_depth import DepthSource, Placement
from semgs.model.memory.memory_plan import MemoryPlan
from semgs.objectives.metrics import ViewScores
from semgs.scene.encoding import Encoding
from semgs.scene.exposure import Exposures
from semgs.scene.photo_refinement import Refined
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import UpDirection
from semgs.segmenters.features.scene_features import SceneFeatures
from semgs.segmenters.labelling import Labelling

Role = Literal["context", "target"]
"""Input views and held-out views."""


@dataclass(frozen=True)
class RenderedViews:
    """Views of the scene, and the Gaussians rendered from their cameras.

    Attributes:
        role: whether they are the input views ("context") or the held-out ones ("target").
        positions: of the frames in the scene.
        names: of the frames.
        views: the true views, at the size of the reconstruction.
        images: of the Gaussians from the same cameras; these and the next two as in `semgs.rendering.rendering.Rendering`.
        depths: z-depth [m].
        alphas: how much of each pixel the Gaussians cover.
        scores: one per view.
        depth_spread: standard deviation of log depth at every pixel, as `rendered_depth_spread` gives it.
        labels: the class maps, with unseen (255) and unknown (254) pixels; None for a colour-only model.
        confidences: the calibrated probability of each of these classes, 0 where unseen; None for a colour-only model.
    """

    role: Role
    positions: tuple[int, ...]
    names: tuple[str, ...]
    views: Views
    images: Float[Tensor, "v 3 h w"]
    depths: Float[Tensor, "v h w"]
    alphas: Float[Tensor, "v h w"]
    scores: tuple[ViewScores, ...]
    depth_spread: Float[Tensor, "v h w"]
    labels: UInt8[np.ndarray, "v h w"] | None
    confidences: Float32[np.ndarray, "v h w"] | None

    @property
    def titles(self) -> list[str]:
        """Position and name of each frame, as text."""
        return [f"{position} ({name})" for position, name in zip(self.positions, self.names, strict=True)]


@dataclass(frozen=True)
class OnePassViews:
    """What views looked like before their Gaussians were refined.

    Attributes:
        role: of the views.
        images: rendered.
        scores: one per view.
    """

    role: Role
    images: Float[Tensor, "v 3 h w"]
    scores: tuple[ViewScores, ...]


@dataclass(frozen=True)
class PhotoRefinement:
    """What refining the Gaussians changed.

    Attributes:
        passes: steps for each photo.
        kept: the passes after which the result was taken; less than `passes` if the view that decides was best earlier.
        check: name of the frame that decided; None without one. It is no target of the reconstruction.
        curve: PSNR of that frame before the first pass and after each [dB]; empty without one.
        before: what the same views looked like before.
        check_taught: whether that frame decided in a trial of half the passes, and taught with the others afterwards.
    """

    passes: int
    kept: int
    check: str | None
    curve: tuple[float, ...]
    before: tuple[OnePassViews, ...]
    check_taught: bool = False


@dataclass(frozen=True)
class GivenSplat:
    """The splat of another program that was labelled.

    Attributes:
        name: of its file.
        format: of its file, such as "PLY".
        photos: how many photos said classes.
        notes: what else to know about it.
    """

    name: str
    format: str
    photos: int
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reconstruction:
    """A scene reconstructed from some of its frames; all tensors are on the CPU.

    Attributes:
        scene: the source of the frames.
        choice: which frames, and why.
        encoding: the Gaussians, in the world of the views, relative to the scene's `origin`.
        model: name of the model.
        context: the input frames.
        target: the held-out frames; None if there are none.
        saved: the scene as `scene.safetensors` stores it.
        up: which way is up.
        notes: for the user.
        plan: how memory was used; None for a network that `memory_plan` does not support.
        labelling: where the classes come from; None for the model.
        features: of the Gaussians; None for none.
        placement: how the Gaussians were placed at a sensor's depth, or with the help of depth maps; None if their depth is the model's.
        min_confidence: seen pixels with less are unknown in label maps.
        refinement: what refining changed; None without it.
        splat: whose Gaussians these are, with new classes; None if they are the network's.
    """

    scene: Scene
    choice: Choice
    encoding: Encoding
    model: str
    context: RenderedViews
    target: RenderedViews | None
    saved: SavedScene
    up: UpDirection
    notes: tuple[str, ...]
    plan: MemoryPlan | None = None
    labelling: Labelling | None = None
    features: SceneFeatures | None = None
    placement: Placement | MapPlacement | None = None
    min_confidence: float = 0.0
    refinement: PhotoRefinement | None = None
    splat: GivenSplat | None = None

    @property
    def classes(self) -> ClassTable | None:
        """The class table of the Gaussians; None for a colour-only model."""
        return self.encoding.classes

    @property
    def depth_range(self) -> DepthRange:
        """Near and far bounds of the model's depth, and why."""
        return self.choice.depth_range

    @property
    def native_size(self) -> tuple[int, int]:
        """(height, width) of the first context frame on disk [px]."""
        return self.scene.frames[self.choice.context[0]].lens.size

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) of the frames as read [px]."""
        return self.context.views.size

    @property
    def rendered_views(self) -> list[RenderedViews]:
        """The context views and, if there are any, the target views."""
        return [self.context] if self.target is None else [self.context, self.target]

    @property
    def label_maps(self) -> list[UInt8[np.ndarray, "v h w"]]:
        """The class maps of all views by role; empty for a colour-only model."""
        return [part.labels for part in self.rendered_views if part.labels is not None]

    @property
    def metric(self) -> bool:
        """Whether lengths are metres."""
        return self.scene.unit == "metric"

    @property
    def segmenter(self) -> str | None:
        """Where the classes come from, in a sentence; None for the model."""
        return None if self.labelling is None else self.labelling.description

    @property
    def depth_source(self) -> DepthSource | Literal["maps"]:
        """Where the depth of the Gaussians comes from."""
        return "network" if self.placement is None else self.placement.source

    @property
    def depth_fits(self) -> tuple[str, ...]:
        """How the depth of a sensor or of maps fits, a line for each input view; empty without either."""
        return () if self.placement is None else self.placement.lines(self.context.names)


@dataclass(frozen=True)
class Refining:
    """How Gaussians were refined on photos.

    Attributes:
        passes: steps for each photo that were allowed.
        done: the refined Gaussians, and after how many passes they were best.
        before: the Gaussians before.
        check: name of the frame that decided when to stop; None without one.
        check_taught: whether it decided in a trial, and taught with the others afterwards.
    """

    passes: int
    done: Refined
    before: Encoding
    check: str | None = None
    check_taught: bool = False


@dataclass(frozen=True)
class Draft:
    """What is known of a reconstruction so far.

    Attributes:
        scene: the source of the frames.
        choice: input frames and held-out ones.
        context, target: the same as read; `target` is None if none is held out.
        encoding: the Gaussians.
        model: name of the model, or the format of a splat.
        labelling: where the classes come from; None for the model.
        placement: how the Gaussians were placed at a sensor's depth, or with the help of depth maps; None if their depth is the model's.
        plan: how memory was used; None for a network that `memory_plan` does not support.
        exposures: of the input photos; None if they are as taken.
        refining: how the Gaussians were refined; None if they were not.
        features: of the Gaussians; None for none.
        splat: whose Gaussians these are, with new classes; None if they are the network's.
    """

    scene: Scene
    choice: Choice
    context: Views
    target: Views | None
    encoding: Encoding
    model: str
    labelling: Labelling | None = None
    placement: Placement | MapPlacement | None = None
    plan: MemoryPlan | None = None
    exposures: Exposures | None = None
    refining: Refining | None = None
    features: SceneFeatures | None = None
    splat: GivenSplat | None = None

    @property
    def names(self) -> list[str]:
        """The names of the input frames."""
        return [self.scene.frames[position].name for position in self.choice.context]

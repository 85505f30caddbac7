"""Reconstructs a scene from some of its frames: Gaussians, renderings and scores."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.choosing.choice import Choice
from semgs.data.frames import Frame
from semgs.data.resampling import default_size, kept_size
from semgs.data.scene import Scene
from semgs.data.tables.classes import ClassTable
from semgs.data.views import Views
from semgs.geometry.cameras import back_project, project
from semgs.model.encode import Network, encode
from semgs.model.memory.memory_plan import MemoryPlan
from semgs.reconstruction.scores import ViewScores, scores
from semgs.reconstruction.sensor_depth import DepthSource, Placed, check_listed, check_measured, placed
from semgs.rendering.depth_spread import rendered_depth_spread
from semgs.rendering.rendering import Rendering, check_may_be_unknown, label_maps
from semgs.runtime.stopwatch import Stages
from semgs.scene.encoding import Encoding
from semgs.segmenters.features.scene_features import Featuring, SceneFeatures
from semgs.segmenters.labelling import Labelling
from semgs.segmenters.networks.cost import cost_of

GRID = 24
"""Grid points along each side of an image for the test whether views can overlap."""

NO_PARALLAX = 0.01
"""Context cameras that are closer together than this share of the near bound have no parallax."""


@dataclass(frozen=True)
class Shown:
    """Views of the scene, and the Gaussians rendered from their cameras.

    Attributes:
        positions: of the frames in the scene.
        names: of the frames.
        views: the true views, at the size of the reconstruction.
        rendering: of the Gaussians from the same cameras.
        scores: one per view.
        depth_spread: standard deviation of log depth at every pixel, as `rendered_depth_spread` gives it.
    """

    positions: tuple[int, ...]
    names: tuple[str, ...]
    views: Views
    rendering: Rendering
    scores: tuple[ViewScores, ...]
    depth_spread: Float[Tensor, "v h w"]

    @property
    def titles(self) -> list[str]:
        """Position and name of each frame, as text."""
        return [f"{position} ({name})" for position, name in zip(self.positions, self.names, strict=True)]


@dataclass(frozen=True)
class Reconstruction:
    """A scene reconstructed from some of its frames; all tensors are on the CPU.

    Attributes:
        scene: the source of the frames.
        choice: which frames, and why.
        native_size: (height, width) of the first context frame on disk [px].
        encoding: the output of the model. Its Gaussians are in the world of the views, relative to the scene's `origin`.
        classes: the class table of the Gaussians; None for a colour-only model.
        model: name of the model.
        context: the input frames.
        target: the held-out frames; None if there are none.
        notes: for the user, a sentence each.
        plan: how memory was used; None for a network that `memory_plan` does not support.
        labelling: where the classes come from; None for the model.
        features: of the Gaussians; None for none.
        placed: how the Gaussians were placed at a sensor's depth; None if their depth is the model's.
        min_confidence: seen pixels with less are unknown in label maps.
    """

    scene: Scene
    choice: Choice
    native_size: tuple[int, int]
    encoding: Encoding
    classes: ClassTable | None
    model: str
    context: Shown
    target: Shown | None
    notes: tuple[str, ...]
    plan: MemoryPlan | None = None
    labelling: Labelling | None = None
    features: SceneFeatures | None = None
    placed: Placed | None = None
    min_confidence: float = 0.0

    @property
    def depth_range(self) -> DepthRange:
        """Near and far bounds of the model's depth, and why."""
        return self.choice.depth_range

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) of the frames as read [px]."""
        return self.context.views.size

    @property
    def shown(self) -> list[Shown]:
        """The context views and, if there are any, the target views."""
        return [self.context] if self.target is None else [self.context, self.target]

    def label_maps(self, shown: Shown) -> UInt8[np.ndarray, "v h w"] | None:
        """The class map of each view, with unseen (255) and unknown (254) pixels; None for a colour-only model."""
        return None if self.classes is None else label_maps(shown.rendering, self.min_confidence)

    @property
    def metric(self) -> bool:
        """Whether lengths are metres."""
        return self.scene.unit == "metric"

    @property
    def segmenter(self) -> str | None:
        """Where the classes come from, in a sentence; None for the model."""
        return None if self.labelling is None else self.labelling.description

    @property
    def depth_source(self) -> DepthSource:
        """Where the depth of the Gaussians comes from."""
        return "network" if self.placed is None else self.placed.source

    @property
    def depth_fits(self) -> tuple[str, ...]:
        """How the sensor's depth fits the model's, a line for each input view; empty without a sensor."""
        return () if self.placed is None else self.placed.lines(self.context.names)


def reconstruct(
    scene: Scene,
    choice: Choice,
    model: Network,
    size: Sequence[int] | None = None,
    *,
    depth: DepthSource = "network",
    labelling: Labelling | None = None,
    featuring: Featuring | None = None,
    min_confidence: float = 0.0,
    stages: Stages | None = None,
    notes: Sequence[str] = (),
) -> Reconstruction:
    """Reconstruct a scene from its context frames, and render it from these and from the held-out ones.

    If memory is short, fewer views are encoded at a time, as for `semgs.model.encode.encode`.

    Args:
        scene: an open scene.
        choice: input frames and held-out frames.
        model: in evaluation mode, on the device to compute on; `render` chooses its own device.
        size: (height, width) of the frames as read [px]; None is `default_size` of the first one. Other aspect ratios are cropped.
        depth: where the depth of the Gaussians comes from: the model, the sensor that measured the frames' depth maps, or both.
        labelling: gives the Gaussians their classes; None for those of the model.
        featuring: gives the Gaussians features; None for none.
        min_confidence: seen pixels with less are unknown in label maps; scores do not change.
        stages: shows and times the stages read, encode, place, segment, features and render.
        notes: further notes for the user, a sentence each.

    Raises:
        InputError: a frame cannot be read, or the sensor measured too little of an input frame.
        NotEnoughMemoryError: it would not fit in memory.
        ValueError: fewer than two context frames, or a position outside the scene; a least confidence without classes, or with too many;
            or as `Labelling`.
    """
    stages = stages or Stages()
    if min_confidence > 0:
        table = model.classes if labelling is None else labelling.source.classes
        if table is None:
            raise ValueError("the model predicts colour only; expected one with classes for a least confidence")
        check_may_be_unknown(len(table))
    if depth != "network":
        check_listed(scene, choice.context)
    native = scene.frames[choice.context[0]].lens.size
    wanted = default_size(native) if size is None else tuple(size)
    count = len(choice.context) + len(choice.targets)
    cost = "" if labelling is None else _cost(labelling, [scene.frames[place] for place in choice.context], stages)
    with stages("read", f"Reading {count} frames at {wanted[0]}x{wanted[1]} (height x width)"):
        context = scene.read(choice.context, wanted, choice.depth_range)
        target = scene.read(choice.targets, wanted, choice.depth_range) if choice.targets else None
    if depth != "network":
        check_measured(scene, choice.context, context)
    with stages("encode", f"Encoding {len(context)} views with {model.name}"):
        encoded = encode(model, context, target)
        encoding, classes = encoded.encoding, model.classes
    measured = None
    if depth != "network":
        with stages("place", f"Placing {len(encoding.gaussians):,} Gaussians at the measured depth"):
            measured = placed(encoding, context, depth)
            encoding = measured.encoding
    if labelling is not None:
        with stages("segment", f"Classes of {len(context)} photos from {labelling.source.title}{cost}"):
            encoding, classes = labelling(encoding, scene, choice.context, context), labelling.source.classes
    features = None
    if featuring is not None:
        with stages("features", f"Features of {len(context)} photos from {featuring.source.title}"):
            features = featuring(encoding, scene, choice.context, context)
    with stages("render", f"Rendering {count} views of {len(encoding.gaussians):,} Gaussians"), torch.no_grad():
        own = rendered_from(scene, choice.context, context, encoding, classes)
        held_out = None if target is None else rendered_from(scene, choice.targets, target, encoding, classes)
    return Reconstruction(
        scene=scene,
        choice=choice,
        native_size=native,
        encoding=encoding,
        classes=classes,
        model=model.name,
        context=own,
        target=held_out,
        notes=(
            *notes,
            *scene.notes,
            *_note_of_aspect(scene, choice, context.size),
            *choice.notes,
            *_notes(scene, choice, context, classes),
            *(measured.notes([scene.frames[position].name for position in choice.context]) if measured else ()),
            *_note_of_memory(encoded.plan),
            *(labelling.notes if labelling else ()),
            *(features.notes if features else ()),
        ),
        plan=encoded.plan,
        labelling=labelling,
        features=features,
        placed=measured,
        min_confidence=min_confidence,
    )


def _cost(labelling: Labelling, frames: Sequence[Frame], stages: Stages) -> str:
    """What the classes of frames take to compute, for the title of the stage; measured before other stages raise the peak of memory."""
    with stages("load", f"Trying {labelling.source.title}"):
        cost = cost_of(labelling.source, frames)
    return "" if cost is None else f": {cost}"


def rendered_from(
    scene: Scene, positions: Sequence[int], views: Views, encoding: Encoding, classes: ClassTable | None
) -> Shown:
    """Views of a scene's frames, renderings from their cameras, and scores; labels with another class table than the model's are not scored."""
    rendering = encoding.render(views.cameras)
    spread = encoding.per_gaussian(encoding.depth_spread[:, None])[:, 0]
    near = float(encoding.depth_range[:, 0].min())
    comparable = views
    if views.labels is not None and views.classes != classes:
        comparable = views.changed(labels=None)
    names = tuple(scene.frames[position].name for position in positions)
    return Shown(
        tuple(positions),
        names,
        views,
        rendering,
        scores(rendering, comparable),
        rendered_depth_spread(encoding.gaussians, spread, views.cameras, near=near),
    )


def _notes(scene: Scene, choice: Choice, context: Views, classes: ClassTable | None) -> list[str]:
    """Notes for the user, a sentence each."""
    notes = []
    if not has_parallax(context):
        notes.append(
            "No parallax: the input cameras are all at the same place, so depth is a guess of the model, not a measurement."
        )
    if names := [scene.frames[choice.context[view]].name for view in strangers(context)]:
        notes.append(
            f"No overlap: {', '.join(names)} shows nothing that another input view can show between near and far, so its depth is "
            "a guess of the model, not a measurement."
        )
    if scene.origin.any():
        notes.append(
            "The scene is far from the origin of its coordinates, so positions in scene.safetensors are relative to "
            f"({', '.join(f'{side:.0f}' for side in scene.origin)}). Add this point to get the scene's own coordinates."
        )
    if scene.unit != "metric":
        notes.append(
            "The scale of this scene is unknown, so lengths are in its own unit and depth maps are floating-point TIFF files."
        )
    if classes is None:
        notes.append(
            "The model predicts colour only, so there are no class maps, no semantics.ply and no class scores."
        )
    if not choice.targets:
        notes.append("No frame is held out, so the scores do not show how good new views are.")
    return notes


def _note_of_aspect(scene: Scene, choice: Choice, size: tuple[int, int]) -> list[str]:
    """A note if images were cropped."""
    frames = [scene.frames[position] for position in (*choice.context, *choice.targets)]
    kept = {frame.name: kept_size(frame.lens.size, size) for frame in frames}
    changed = [frame for frame in frames if kept[frame.name] != frame.lens.size]
    if not changed:
        return []
    first = changed[0]
    (rows, columns), (height, width) = first.lens.size, kept[first.name]
    return [
        f"{len(changed)} of {len(frames)} images have another aspect ratio than {size[0]}x{size[1]} (height x width) and are centre-cropped "
        f"with their cameras: {first.name}, for example, from {rows}x{columns} to {height}x{width} before it is resized."
    ]


def _note_of_memory(planned: MemoryPlan | None) -> list[str]:
    """A note if memory was short."""
    if planned is None or not planned.short:
        return []
    return [
        "Memory was short, so the network processed fewer views at a time. This takes longer; the result is the same."
    ]


def strangers(context: Views) -> list[int]:
    """The views that share no point with another view: points on a grid of pixels, at 16 depths from near to far, are tested."""
    grid = torch.diag(torch.tensor([GRID / context.size[1], GRID / context.size[0], 1.0], dtype=torch.float64))
    cameras = context.cameras.adjusted(grid, (GRID, GRID))
    near, far = context.depth_range[:, 0].min(), context.depth_range[:, 1].max()
    depths = 1 / torch.linspace(float(1 / near), float(1 / far), 16, dtype=torch.float64)
    shared = torch.zeros(len(context), len(context), dtype=torch.bool)
    for one, other in itertools.permutations(range(len(context)), 2):
        points = back_project(depths[:, None, None].expand(-1, GRID, GRID), cameras[one])
        x, y, depth = project(points.flatten(end_dim=-2), cameras[other]).unbind(-1)
        shared[one, other] = ((depth > 0) & (x >= 0) & (x < GRID) & (y >= 0) & (y < GRID)).any()
    return [view for view in range(len(context)) if not (shared | shared.T)[view].any()]


def has_parallax(context: Views) -> bool:
    """Whether the context cameras are further apart than `NO_PARALLAX` times the near bound."""
    centres = context.cameras.centres
    spread = torch.cdist(centres, centres).max()
    return bool(spread > NO_PARALLAX * context.depth_range[:, 0].min())

"""Reconstructs a scene from posed frames: Gaussians, renderings, scores and notes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float32, UInt8

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.choosing.choice import Choice
from semgs.data.frames import Frame
from semgs.data.resampling import default_size
from semgs.data.scene import Scene
from semgs.data.views import Views, joined
from semgs.depth_maps.depth_source import DepthMaps
from semgs.depth_maps.frame_maps import FrameMaps
from semgs.depth_maps.map_depth import MapPlacement, find_reference, fits, place_at_maps, read_maps
from semgs.depth_maps.sensor_depth import DepthSource, Placement, place_gaussians, read_measured
from semgs.files.text import counted
from semgs.model.encode import Network, encode
from semgs.model.memory.memory_plan import MemoryPlan
from semgs.rendering.depth_spread import render_depth_spread
from semgs.rendering.rendering import Rendering, check_may_be_unknown, confidence_maps, label_maps
from semgs.run.steps.notes import collect_notes, notes_on_guesses
from semgs.run.steps.recording import Walk, map_walk
from semgs.run.steps.result import OnePassViews, PhotoRefinement, Reconstruction, RenderedViews, Role
from semgs.run.steps.scores import ViewScores, scores
from semgs.runtime.notes import Kind
from semgs.runtime.stopwatch import Stages
from semgs.runtime.threads import adapt_threads
from semgs.scene.encoding import Encoding
from semgs.scene.exposure import ExposureChoice, common_exposure
from semgs.scene.photo_refinement import Refined, refine_until
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import up_of
from semgs.segmenters.class_source import ClassSource
from semgs.segmenters.features.scene_features import Featuring
from semgs.segmenters.labelling import Labelling
from semgs.segmenters.networks.cost import cost_of

FEW_PHOTOS = 5
"""Of so many photos, none is only there to decide when refining stops."""

READING = Kind("Reading {count} frames at {height}x{width} (height x width)", "Reading the photos")
READING_HELD_OUT = Kind("Reading {count} held-out frames", "Reading the photos")
ENCODING = Kind("Encoding {count} views with {network}", "Building the room from {count} photos")
COMPARING = Kind("Comparing the exposure of {count} photos", "Comparing brightness")
REFINING = Kind("Refining {gaussians:,} Gaussians in {count} steps", "Sharpening {gaussians:,} Gaussians")
RENDERING = Kind("Rendering {views} of {gaussians:,} Gaussians", "Rendering")


class ViewEncoder:
    """The steps from some views of a scene to Gaussians with their depth and classes.

    Args:
        scene, network, depth, labelling, stages: as for `reconstruct`.
        size: (height, width) of the frames as read [px].

    Attributes:
        plan: how memory was used, in the first views for which it was short; None for a network that `memory_plan` does not support.
    """

    def __init__(
        self,
        scene: Scene,
        network: Network,
        size: tuple[int, int],
        depth: DepthSource | DepthMaps,
        labelling: Labelling | None,
        stages: Stages,
    ) -> None:
        self._scene, self._network, self._size = scene, network, size
        self._depth, self._labelling, self._stages = depth, labelling, stages
        self._placements: dict[int, Placement | MapPlacement] = {}
        self._segmenter_cost = self._depth_cost = ""
        self.plan: MemoryPlan | None = None

    def read(self, positions: Sequence[int], depth_range: DepthRange) -> Views:
        """Read input frames.

        Raises:
            InputError: a frame cannot be read, or has no depth map, or the sensor measured too little of it.
        """
        if self._depth in ("sensor", "both"):
            return read_measured(self._scene, positions, self._size, depth_range)
        views = self._scene.read(positions, self._size, depth_range)
        if isinstance(self._depth, FrameMaps) and (
            views.depths is None or not (views.depths > 0).flatten(1).any(1).all()
        ):
            read_maps(self._depth, self._scene, positions, self._size)  # says which frame has none
        return views

    def read_target(self, choice: Choice) -> Views | None:
        """Read the held-out frames; None if there are none.

        Raises:
            InputError: a frame cannot be read.
        """
        return self._scene.read(choice.targets, self._size, choice.depth_range) if choice.targets else None

    def try_networks(self, positions: Sequence[int]) -> None:
        """Measure what classes and depth maps of frames take to compute, to show it with these stages; before other stages raise the peak of memory."""
        frames = [self._scene.frames[position] for position in positions]
        if self._labelling is not None:
            self._segmenter_cost = self._try(self._labelling.source, frames)
        if not isinstance(self._depth, str):
            self._depth_cost = self._try(self._depth, frames)

    def _try(self, source: ClassSource | DepthMaps, frames: Sequence[Frame]) -> str:
        """What the maps of frames take, to be put behind the title of a stage; "" if nothing is computed."""
        with self._stages("load", f"Trying {source.title}"):
            cost = cost_of(source, frames)
        return "" if cost is None else f": {cost}"

    def encode(self, positions: Sequence[int], views: Views, target: Views | None = None) -> Encoding:
        """Encode views, place the Gaussians at a sensor's depth, and give them the classes of a segmenter, as requested.

        Args:
            positions: of the frames in the scene.
            views: the frames as read.
            target: views that will be rendered later and also need memory.

        Raises:
            NotEnoughMemoryError: it would not fit in memory.
            ValueError: there are fewer than two views; or as `Labelling`.
        """
        adapt_threads()
        with self._stages("encode", ENCODING(count=len(views), network=self._network.name)):
            encoded = encode(self._network, views, target)
        encoding = replace(encoded.encoding, classes=self._network.classes)
        if self.plan is None or not self.plan.short:
            self.plan = encoded.plan
        if self._depth != "network":
            encoding, placement = self._place(encoding, positions, views, self._depth)
            for position, fit in zip(positions, placement.fits, strict=True):
                self._placements.setdefault(position, replace(placement, fits=(fit,)))  # type: ignore[arg-type]
        if self._labelling is not None:
            title = (
                f"Classes of {counted(len(views), 'photo')} from {self._labelling.source.title}{self._segmenter_cost}"
            )
            with self._stages("segment", title):
                encoding = self._labelling(encoding, self._scene, positions, views)
        return encoding

    def _place(
        self, encoding: Encoding, positions: Sequence[int], views: Views, depth: Literal["sensor", "both"] | DepthMaps
    ) -> tuple[Encoding, Placement | MapPlacement]:
        """Place the Gaussians at the depth of a sensor or of maps. Returns them, and how they were placed."""
        count = f"{len(encoding.gaussians):,} Gaussians"
        if isinstance(depth, str):
            with self._stages("place", f"Placing {count} at the measured depth"):
                return place_gaussians(encoding, views, depth, metric=self._scene.unit == "metric")
        with self._stages("depth", f"Depth of {counted(len(views), 'photo')} from {depth.title}{self._depth_cost}"):
            maps = read_maps(depth, self._scene, positions, views.size)
        with self._stages("place", f"Placing {count} with the help of depth maps"):
            reference = find_reference(
                encoding, self._scene, positions, views, independent=not isinstance(depth, FrameMaps)
            )
            # If maps of an earlier window fit, one bad window is no reason to give up a walk.
            trusted = any(isinstance(one, MapPlacement) and fits(one.fits[0]) for one in self._placements.values())
            return place_at_maps(encoding, views, maps, depth, reference, trusted=trusted)

    def placement(self, positions: Sequence[int]) -> Placement | MapPlacement | None:
        """How the Gaussians of frames were placed when these were first encoded; None if their depth is the network's."""
        if not self._placements:
            return None
        fits = tuple(self._placements[position].fits[0] for position in positions)
        return replace(self._placements[positions[0]], fits=fits)  # type: ignore[arg-type]


@torch.no_grad()
def reconstruct(
    scene: Scene,
    frames: Choice | Walk,
    network: Network,
    size: Sequence[int] | None = None,
    *,
    depth: DepthSource | DepthMaps = "network",
    exposure: ExposureChoice = "auto",
    labelling: Labelling | None = None,
    featuring: Featuring | None = None,
    min_confidence: float = 0.0,
    passes: int = 0,
    stages: Stages | None = None,
    notes: Sequence[str] = (),
) -> Reconstruction:
    """Reconstruct a scene from input frames, and render it from these and from the held-out ones.

    If memory is short, fewer views are encoded at a time, as for `semgs.model.encode.encode`.

    Args:
        scene: an open scene.
        frames: input frames and held-out frames, or all frames of a walk.
        network: in evaluation mode, on the device to compute on; `render` chooses its own device.
        size: (height, width) of the frames as read [px]; None is `default_size` of the first one. Other aspect ratios are cropped.
        depth: where the depth of the Gaussians comes from: the network, the sensor that measured the frames' depth maps, or both; or the network
            and depth maps from elsewhere.
        exposure: whether the input photos, and with them the Gaussians, come to a common exposure; held-out photos stay as taken.
        labelling: gives the Gaussians their classes; None for those of the network.
        featuring: gives the Gaussians features; None for none.
        min_confidence: seen pixels with less are unknown in label maps; scores do not change.
        passes: refine the Gaussians with so many steps for each photo; 0 leaves them as the network placed them. The first held-out frame then
            decides when to stop, and is held out no longer; without one, the middle of three or more input views.
        stages: shows and times the stages read, encode, depth, place, segment, merge, expose, sharpen, features and render.
        notes: further notes for the user.

    Raises:
        InputError: a frame cannot be read, or the sensor measured too little of an input frame; or no two frames of a walk can be used together.
        NotEnoughMemoryError: it would not fit in memory.
        ValueError: fewer than two context frames, or a position outside the scene; a least confidence without classes, or with too many;
            or as `Labelling`, or as `Mapper` for a walk.
    """
    stages = stages or Stages()
    classes = network.classes if labelling is None else labelling.source.classes
    if min_confidence > 0:
        if classes is None:
            raise ValueError("the model predicts colour only; expected one with classes for a least confidence")
        check_may_be_unknown(len(classes))
    if not isinstance(frames, Walk):
        scene = scene.with_readable_labels((*frames.context, *frames.targets))
    first = scene.frames[0 if isinstance(frames, Walk) else frames.context[0]]
    height, width = default_size(first.lens.size) if size is None else size
    encoder = ViewEncoder(scene, network, (height, width), depth, labelling, stages)
    if isinstance(frames, Walk):
        choice, merged = map_walk(scene, frames, encoder.read, encoder.encode, stages)
        context, encoding = merged.views, merged.encoding
        with stages("read", READING_HELD_OUT(count=len(choice.targets))):
            target = encoder.read_target(choice)
    else:
        choice, count = frames, len(frames.context) + len(frames.targets)
        encoder.try_networks(choice.context)
        with stages("read", READING(count=count, height=height, width=width)):
            context, target = encoder.read(choice.context, choice.depth_range), encoder.read_target(choice)
        encoding = encoder.encode(choice.context, context, target).without(context.hidden)
    exposures = None
    if exposure != "as-taken":
        with stages("expose", COMPARING(count=len(context))):
            exposures = common_exposure(context, encoding, exposure)
    if exposures is not None:
        context, encoding = exposures.applied(context), exposures.recoloured(encoding)
    refined, unrefined, decider = None, encoding, None
    if passes:
        decider, choice, target = _decider(scene, choice, context, target)
        refined = _refined(encoding, context, passes, decider, depth == "network", exposures is not None, stages)
        encoding = refined.encoding
    features = None
    if featuring is not None:
        with stages("features", f"Features of {len(context)} photos from {featuring.source.title}"):
            features = featuring(encoding, scene, choice.context, context)
    count = len(context) + len(choice.targets)
    with stages("render", RENDERING(views=counted(count, "view"), gaussians=len(encoding.gaussians))):
        rendered_context = render_views("context", scene, choice.context, context, encoding, min_confidence)
        rendered_target = None
        if target is not None:
            rendered_target = render_views("target", scene, choice.targets, target, encoding, min_confidence)
        refinement = None
        if refined is not None:
            rendered = [part for part in (rendered_context, rendered_target) if part is not None]
            before = tuple(_one_pass(part, unrefined) for part in rendered)
            check, taught = (None, False) if decider is None else (decider.name, decider.every is not None)
            refinement = PhotoRefinement(passes, refined.passes, check, refined.curve, before, taught)
        saved = _saved_scene(scene, rendered_context, encoding, network.name, labelling)
        up = up_of(saved)
    placement, plan = encoder.placement(choice.context), encoder.plan
    own_notes = collect_notes(
        scene,
        choice,
        context,
        target,
        classes,
        up,
        geometry=notes_on_guesses(rendered_context.names, context),
        placement=placement,
        plan=plan,
        exposures=exposures,
        labelling=labelling,
        features=features,
        refinement=refinement,
    )
    return Reconstruction(
        scene=scene,
        choice=choice,
        encoding=encoding,
        model=network.name,
        context=rendered_context,
        target=rendered_target,
        saved=saved,
        up=up,
        notes=(*notes, *own_notes),
        plan=plan,
        labelling=labelling,
        features=features,
        placement=placement,
        min_confidence=min_confidence,
        refinement=refinement,
    )


def render_views(
    role: Role,
    scene: Scene,
    positions: Sequence[int],
    views: Views,
    encoding: Encoding,
    min_confidence: float,
) -> RenderedViews:
    """Render the Gaussians from the cameras of a scene's frames, and score the renderings.

    Views whose labels have another class table than the Gaussians are scored without labels.
    """
    semantic = encoding.classes is not None
    renderings: list[Rendering] = []
    scored: list[ViewScores] = []
    labels: list[UInt8[np.ndarray, "1 h w"]] = []
    confidences: list[Float32[np.ndarray, "1 h w"]] = []
    for rendering, score in _rendered_alone(views, encoding):
        scored.append(score)
        if semantic:
            labels.append(label_maps(rendering, min_confidence))
            confidences.append(confidence_maps(rendering))
        renderings.append(replace(rendering, semantics=None))
    spread = encoding.per_gaussian(encoding.depth_spread[:, None])[:, 0]
    near = float(encoding.depth_range[:, 0].min())
    return RenderedViews(
        role,
        tuple(positions),
        tuple(scene.frames[position].name for position in positions),
        views,
        torch.cat([one.images for one in renderings]),
        torch.cat([one.depths for one in renderings]),
        torch.cat([one.alphas for one in renderings]),
        tuple(scored),
        render_depth_spread(encoding.gaussians, spread, views.cameras, near=near),
        np.concatenate(labels) if semantic else None,
        np.concatenate(confidences) if semantic else None,
    )


@dataclass(frozen=True)
class _Decider:
    """The photo that decides when refining stops.

    Attributes:
        name: of its frame.
        view: as read.
        others: the photos that teach while it decides.
        every: those that teach afterwards, with it among them; None if it is held out to the end.
    """

    name: str
    view: Views
    others: Views
    every: Views | None = None


def _decider(
    scene: Scene, choice: Choice, context: Views, target: Views | None
) -> tuple[_Decider | None, Choice, Views | None]:
    """The photo that decides when refining stops; and the choice and the held-out views without it.

    It is the first held-out one. Without any, it is one of three or more input photos, the middle one. Of two photos, none decides. Of a few photos, none is spared: it takes
    part afterwards.
    """
    if target is None:
        if len(context) < 3:
            return None, choice, None
        middle = len(context) // 2
        others = context.select([view for view in range(len(context)) if view != middle])
        name = scene.frames[choice.context[middle]].name
        return _Decider(name, context.select([middle]), others, context), choice, None
    rest = target.select(range(1, len(target))) if len(target) > 1 else None
    view = target.select([0])
    every = joined([context, view]) if len(scene) <= FEW_PHOTOS else None
    decider = _Decider(scene.frames[choice.targets[0]].name, view, context, every)
    return decider, replace(choice, targets=choice.targets[1:]), rest


def _refined(
    encoding: Encoding,
    context: Views,
    passes: int,
    decider: _Decider | None,
    moves: bool,
    exposure: bool,
    stages: Stages,
) -> Refined:
    """The Gaussians refined on the photos. A photo that takes part afterwards decides in half the passes, over the others; then all photos teach."""
    trial, every = 0, context if decider is None else decider.every
    if decider is not None:
        trial = (passes + 1) // 2 if every is not None else passes
    count = passes * (0 if every is None else len(every)) + trial * (0 if decider is None else len(decider.others))

    def run(length: int, photos: Views, before: int, check: Views | None = None) -> Refined:
        return refine_until(
            encoding,
            context,
            length,
            check=check,
            moves=moves,
            exposure=exposure,
            photos=photos,
            done=lambda steps: done(before + steps),
        )

    with stages.steps("sharpen", REFINING(gaussians=len(encoding.gaussians), count=count), count) as done:
        if decider is None:
            return run(passes, context, 0)
        tried = run(trial, decider.others, 0, decider.view)
        if every is None or tried.passes == 0:
            return tried
        return replace(run(round(passes * tried.passes / trial), every, trial * len(decider.others)), curve=tried.curve)


def _rendered_alone(views: Views, encoding: Encoding) -> Iterator[tuple[Rendering, ViewScores]]:
    """The rendering of each view and its scores. The class distributions of a view are larger than all that is kept of it."""
    for index in range(len(views)):
        view = views.select([index])
        rendering = encoding.render(view.cameras)
        yield rendering, scores(rendering, _comparable(view, encoding))[0]


def _comparable(views: Views, encoding: Encoding) -> Views:
    """The views, without labels if these have another class table than the Gaussians."""
    if views.labels is not None and views.classes != encoding.classes:
        return views.changed(labels=None)
    return views


def _one_pass(part: RenderedViews, encoding: Encoding) -> OnePassViews:
    """The same views, rendered from Gaussians that are not refined."""
    drawn = [(rendering.images, score) for rendering, score in _rendered_alone(part.views, encoding)]
    return OnePassViews(part.role, torch.cat([images for images, _ in drawn]), tuple(score for _, score in drawn))


def _saved_scene(
    scene: Scene, context: RenderedViews, encoding: Encoding, model: str, labelling: Labelling | None
) -> SavedScene:
    """The scene as its file stores it. The depth of hidden pixels is 0, unknown: the network's would free space that no photo shows."""
    transform, hidden = scene.applied_transform, context.views.hidden
    if hidden is not None:
        encoding = replace(encoding, depths=encoding.depths.masked_fill(hidden.to(encoding.depths.device), 0))
    saved = SavedScene.of(
        encoding,
        context.views,
        unit="metric" if scene.unit == "metric" else "unknown",
        frames=context.names,
        source=scene.name,
        model=model if labelling is None else f"{model}, classes from {labelling.description}",
    )
    return replace(
        saved,
        applied_transform=None if transform is None else tuple(tuple(row) for row in transform.tolist()),
        applied_scale=scene.applied_scale,
        origin=tuple(scene.origin.tolist()),
    )

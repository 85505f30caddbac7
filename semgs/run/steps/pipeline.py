"""Reconstructs a scene from posed frames: Gaussians, renderings, scores and notes."""

from __future__ import annotations

from dataclasses import replace

import torch

from semgs.data.choosing.choice import Choice
from semgs.data.choosing.coverage import windows_of
from semgs.data.resampling import default_size
from semgs.data.scene import Scene
from semgs.depth_maps.depth_source import DepthMaps
from semgs.depth_maps.sensor_depth import DepthSource
from semgs.mapping.merging import LAYERS
from semgs.mapping.windows import REFINED_LAYERS, VOXEL_SHARE, merge
from semgs.model.encode import Network
from semgs.rendering.rendering import check_may_be_unknown
from semgs.run.steps.finishing import finish, saved_scene
from semgs.run.steps.notes import notes_on_guesses
from semgs.run.steps.refining import refine
from semgs.run.steps.result import Draft, Reconstruction
from semgs.run.steps.view_encoder import ViewEncoder
from semgs.runtime.notes import Kind
from semgs.runtime.stopwatch import Stages
from semgs.scene.exposure import ExposureChoice, common_exposure, exposure_as_rendered
from semgs.segmenters.features.scene_features import Featuring
from semgs.segmenters.labelling import Labelling

READING = Kind("Reading {count} frames at {height}x{width} (height x width)", "Reading the photos")
MERGING = Kind("Merging {count:,} Gaussians", "Joining what the photos show")
COMPARING = Kind("Comparing the exposure of {count} photos", "Comparing brightness")

MOST_AT_ONCE = 4
"""The networks were trained with two to so many views; more blur what several views see."""


@torch.no_grad()
def reconstruct(
    scene: Scene,
    choice: Choice,
    network: Network,
    *,
    depth: DepthSource | DepthMaps = "network",
    exposure: ExposureChoice = "auto",
    labelling: Labelling | None = None,
    featuring: Featuring | None = None,
    min_confidence: float = 0.0,
    passes: int = 0,
    stages: Stages | None = None,
) -> Reconstruction:
    """Reconstruct a scene from input frames, and render it from these and from the held-out ones.

    If memory is short, fewer views are encoded at a time, as for `semgs.model.encode.encode`.

    Args:
        scene: an open scene.
        choice: input frames and held-out frames, and their size. More than `MOST_AT_ONCE` input frames are encoded in windows, and merged.
        network: in evaluation mode, on the device to compute on; `render` chooses its own device.
        depth: where the depth of the Gaussians comes from: the network, the sensor that measured the frames' depth maps, or both; or the network
            and depth maps from elsewhere.
        exposure: whether the input photos, and with them the Gaussians, come to a common exposure; held-out photos then come to that of their
            rendering.
        labelling: gives the Gaussians their classes; None for those of the network.
        featuring: gives the Gaussians features; None for none.
        min_confidence: seen pixels with less are unknown in label maps; scores do not change.
        passes: refine the Gaussians with so many steps for each photo; 0 leaves them as the network placed them. The first held-out frame then
            decides when to stop, and is held out no longer; without one, the middle of three or more input views.
        stages: shows and times the stages read, encode, depth, place, segment, merge, expose, sharpen, features and render.

    Raises:
        InputError: a frame cannot be read, or the sensor measured too little of an input frame.
        NotEnoughMemoryError: it would not fit in memory.
        ValueError: fewer than two context frames, or a position outside the scene; a least confidence without classes, or with too many;
            or as `Labelling`.
    """
    stages = stages or Stages()
    classes = network.classes if labelling is None else labelling.source.classes
    if min_confidence > 0:
        if classes is None:
            raise ValueError("the model predicts colour only; expected one with classes for a least confidence")
        check_may_be_unknown(len(classes))
    draft = _encode(scene, choice, network, depth, labelling, stages, LAYERS if passes == 0 else REFINED_LAYERS)
    draft = _expose(draft, exposure, stages)
    draft = refine(draft, passes, depth == "network", stages)
    if featuring is not None:
        with stages("features", f"Features of {len(draft.context)} photos from {featuring.source.title}"):
            found = featuring(draft.encoding, draft.scene, draft.choice.context, draft.context)
        draft = replace(draft, features=found)
    context = draft.context
    return finish(
        draft,
        saved_scene(draft),
        lambda shown: notes_on_guesses(shown.names, context),
        stages=stages,
        min_confidence=min_confidence,
    )


def _encode(
    scene: Scene,
    choice: Choice,
    network: Network,
    depth: DepthSource | DepthMaps,
    labelling: Labelling | None,
    stages: Stages,
    layers: int,
) -> Draft:
    """The draft of chosen frames: read, encoded, placed and labelled; many of them in windows, and merged."""
    scene = scene.with_readable_labels((*choice.context, *choice.targets))
    height, width = choice.size or default_size(scene.frames[choice.context[0]].lens.size)
    encoder = ViewEncoder(scene, network, (height, width), depth, labelling, stages)
    encoder.try_networks(choice.context)
    with stages("read", READING(count=len(choice.context) + len(choice.targets), height=height, width=width)):
        context, target = encoder.read(choice.context, choice.depth_range), encoder.read_target(choice)
    typical = choice.depth_range.typical
    if len(choice.context) <= MOST_AT_ONCE:
        encoding = encoder.encode(choice.context, context, target).without(context.hidden)
    else:
        encoding = encoder.encode(choice.context, context, windows=windows_of(scene, choice.context, typical))
        with stages("merge", MERGING(count=len(encoding.gaussians))):
            encoding = merge(encoding, context, VOXEL_SHARE * typical, layers)
    placement = encoder.placement(choice.context)
    return Draft(scene, choice, context, target, encoding, network.name, labelling, placement, encoder.plan)


def _expose(draft: Draft, exposure: ExposureChoice, stages: Stages) -> Draft:
    """The draft with its input photos, and with them the Gaussians, at a common exposure, if they differ."""
    if exposure == "as-taken":
        return draft
    with stages("expose", COMPARING(count=len(draft.context))):
        exposures = common_exposure(draft.context, draft.encoding, exposure)
    if exposures is None:
        return draft
    context, encoding = exposures.applied(draft.context), exposures.recoloured(draft.encoding)
    target = draft.target
    if target is not None:
        colours = replace(encoding, gaussians=replace(encoding.gaussians, semantic=None))
        drawn = colours.render(target.cameras)
        target = exposure_as_rendered(target, drawn.images, drawn.alphas)
    return replace(draft, context=context, target=target, encoding=encoding, exposures=exposures)

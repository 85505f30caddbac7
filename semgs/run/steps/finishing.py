"""The last step: renders the Gaussians, scores them, and says what the user should know."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float32, UInt8

from semgs.data.views import Views
from semgs.files.text import counted
from semgs.objectives.metrics import Maps, ViewScores, view_scores
from semgs.rendering.render_features import render_depth_spread
from semgs.rendering.rendering import SEEN_ALPHA, Rendering, confidence_maps, label_maps, likeliest
from semgs.run.steps.notes import collect_notes
from semgs.run.steps.result import Draft, OnePassViews, PhotoRefinement, Reconstruction, Refining, RenderedViews, Role
from semgs.runtime.notes import Kind
from semgs.runtime.stopwatch import Stages
from semgs.scene.encoding import Encoding
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import Up, up_of

RENDERING = Kind("Rendering {views} of {gaussians:,} Gaussians", "Rendering")


def finish(
    draft: Draft,
    saved: SavedScene,
    notes: Callable[[RenderedViews], Sequence[str]],
    *,
    stages: Stages,
    min_confidence: float = 0.0,
    up: Up = "auto",
) -> Reconstruction:
    """Render a draft from the cameras of its frames, and score the renderings.

    Args:
        draft: with all that is not rendered.
        saved: the scene as its file stores it.
        notes: what to know about where the Gaussians are, given the rendered input views.
        stages: shows and times the stage render.
        min_confidence: seen pixels with less are unknown in label maps.
        up: the direction that is up; "auto" finds it.
    """
    count = counted(len(draft.context) + len(draft.choice.targets), "view")
    with stages("render", RENDERING(views=count, gaussians=len(draft.encoding.gaussians))):
        context = _rendered("context", draft, draft.choice.context, draft.context, min_confidence)
        target = None
        if draft.target is not None:
            target = _rendered("target", draft, draft.choice.targets, draft.target, min_confidence)
        parts = [context] if target is None else [context, target]
        refinement = None if draft.refining is None else _compared(draft.refining, parts)
        direction = up_of(saved, up)
    return Reconstruction(
        scene=draft.scene,
        choice=draft.choice,
        encoding=draft.encoding,
        model=draft.model,
        context=context,
        target=target,
        saved=saved,
        up=direction,
        notes=collect_notes(draft, direction, notes(context), refinement),
        plan=draft.plan,
        labelling=draft.labelling,
        features=draft.features,
        placement=draft.placement,
        min_confidence=min_confidence,
        refinement=refinement,
        splat=draft.splat,
    )


def saved_scene(draft: Draft) -> SavedScene:
    """The scene as its file stores it. The depth of hidden pixels is 0, unknown: the network's would free space that no photo shows."""
    scene, encoding, hidden = draft.scene, draft.encoding, draft.context.hidden
    if hidden is not None:
        encoding = replace(encoding, depths=encoding.depths.masked_fill(hidden.to(encoding.depths.device), 0))
    saved = SavedScene.of(
        encoding,
        draft.context,
        unit="metric" if scene.unit == "metric" else "unknown",
        frames=tuple(draft.names),
        source=scene.name,
        model=draft.model if draft.labelling is None else f"{draft.model}, classes from {draft.labelling.description}",
    )
    transform = scene.applied_transform
    return replace(
        saved,
        applied_transform=None if transform is None else tuple(tuple(row) for row in transform.tolist()),
        applied_scale=scene.applied_scale,
        origin=tuple(scene.origin.tolist()),
    )


def _rendered(role: Role, draft: Draft, positions: Sequence[int], views: Views, min_confidence: float) -> RenderedViews:
    """The Gaussians rendered from the cameras of frames, with scores.

    Views whose labels have another class table than the Gaussians are scored without labels.
    """
    encoding, semantic = draft.encoding, draft.encoding.classes is not None
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
        tuple(draft.scene.frames[position].name for position in positions),
        views,
        torch.cat([one.images for one in renderings]),
        torch.cat([one.depths for one in renderings]),
        torch.cat([one.alphas for one in renderings]),
        tuple(scored),
        render_depth_spread(encoding.gaussians, spread, views.cameras, near=near),
        np.concatenate(labels) if semantic else None,
        np.concatenate(confidences) if semantic else None,
    )


def _compared(refining: Refining, parts: Sequence[RenderedViews]) -> PhotoRefinement:
    """What refining changed in rendered views."""
    before = tuple(_one_pass(part, refining.before) for part in parts)
    done = refining.done
    return PhotoRefinement(refining.passes, done.passes, refining.check, done.curve, before, refining.check_taught)


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


def scores(rendering: Rendering, truth: Views) -> tuple[ViewScores, ...]:
    """The scores of each view of a scene.

    The class of a pixel is the arg max of its distribution. Classes are compared at every labelled pixel, and again at the seen ones.

    Args:
        rendering: from `truth.cameras`, without a batch axis.
        truth: the true views; their labels have the class table of the rendering.
    """
    classes = 0 if rendering.semantics is None else rendering.semantics.shape[-3]
    return tuple(
        view_scores(
            Maps(
                image=rendering.images[index],
                labels=None if rendering.semantics is None else likeliest(rendering.semantics[index]),
                depths=rendering.depths[index],
            ),
            Maps(
                image=truth.images[index],
                labels=None if truth.labels is None else truth.labels[index],
                depths=None if truth.depths is None else truth.depths[index],
            ),
            classes,
            None if truth.hidden is None else truth.hidden[index],
            rendering.alphas[index] < SEEN_ALPHA,
        )
        for index in range(len(truth))
    )

"""What a user should know about a reconstruction: every note, with its words."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from semgs.data.frames import Frame
from semgs.data.resampling import kept_size
from semgs.data.tables.classes import ClassTable
from semgs.data.views import Views
from semgs.geometry.cameras import Cameras, back_project, project
from semgs.run.steps.result import Draft, PhotoRefinement
from semgs.runtime.notes import Kind, Note
from semgs.scene.exposure import Exposures
from semgs.scene.upright import UpDirection
from semgs.splats.splat_scene import note_on_look

GRID = 24
"""Grid points along each side of an image for the test whether views can overlap."""

NO_PARALLAX = 0.01
"""Context cameras that are closer together than this share of the near bound have no parallax."""


FAR_FROM_ORIGIN = Kind(
    "The scene is far from the origin of its coordinates, so positions in scene.safetensors are relative to ({origin}). Add this point to get the scene's own coordinates.",
    "The scene is far from the origin of its coordinates, so positions in the file of the scene are relative to ({origin}).",
)
UNKNOWN_SCALE = Kind(
    "The scale of this scene is unknown, so lengths are in its own unit and depth maps are floating-point TIFF files.",
    "Photos alone do not show how large a room is, so there are no metres. Measure the distance between the places of two photos and give it under Options, Scale.",
)
DEPTH_BOUNDS = Kind(
    "Depth is looked for between {near:.2g} and {far:.2g} m, {reason}. If the unit is not metres, say so: --unit unknown.",
    "Depth is looked for between {near:.2g} and {far:.2g} m, {reason}.",
)
NO_CLASSES = Kind("The model predicts colour only, so there are no class maps, no semantics.ply and no class scores.")
NONE_HELD_OUT = Kind(
    "No frame is held out, so the scores do not show how good new views are.",
    "All photos were used, so nothing is left to check how good new views are.",
)
MEMORY_WAS_SHORT = Kind(
    "Memory was short, so the network processed fewer views at a time. This takes longer; the result is the same."
)
UP_IS_UNCERTAIN = Kind(
    "Which way is up is uncertain ({reason}): if the PLY files are tilted, use semgs export --up.",
    "Which way is up is a guess here, so downloaded files may be tilted.",
)
OTHER_CLASS_TABLE = Kind(
    "The labels of the scene are in the class table {tables}, and the classes of the Gaussians in {table}, so they are not compared: there are no class scores and no "
    "true class maps."
)
NO_PARALLAX_SEEN = Kind(
    "No parallax: the input cameras are all at the same place, so depth is a guess of the model, not a measurement.",
    "All photos were taken from the same place, so depth is a guess. Take a step to the side between photos.",
)
NO_OVERLAP = Kind(
    "No overlap: {names} shows nothing that another input view can show between near and far, so its depth is a guess of the model, not a measurement.",
    "Photo {names} shares too little with the others, so its depth is a guess. Take photos that overlap more.",
)
WITHOUT_CLASS = Kind("{unseen:,} of {count:,} Gaussians are outside all photos or hidden in them: they have no class.")
REFINED_UNCHECKED = Kind("No photo was left to check the refinement on, so it ran for all {passes} passes.")
NOT_REFINED = Kind("Refining made {check} worse, so the Gaussians are as the network placed them. {role}")
REFINED = Kind("Refining stopped after pass {kept} of {passes}, where {check} looks best. {role}")
CHECK_IS_SPENT = "This frame is not held out any more."
CHECK_TAUGHT = "This photo was left out of a trial of half the passes, and took part afterwards."
CROPPED = Kind(
    "{cropped} of {count} images have another aspect ratio than {size} (height x width) and are centre-cropped with their cameras: {example}, for example, from {old} to "
    "{new} before it is resized."
)
HIDDEN = Kind("Hidden: {pixels} are a black border or masked. They have no Gaussians and count in no score.")
EXPOSURES_DIFFER = Kind(
    "The exposures of the input photos differ, so they were multiplied by {least:.2f} to {most:.2f}: their brightness differed by {before:.0f} % on shared surfaces, now "
    "by {after:.0f} %. The report shows and scores them at this common exposure, and held-out photos at that of their rendering. --exposure as-taken leaves all of them.",
    "The photos differ in brightness, so they were made alike.",
)


def collect_notes(
    draft: Draft, up: UpDirection, geometry: Sequence[str], refinement: PhotoRefinement | None
) -> tuple[str, ...]:
    """All notes on a reconstruction, in the order of the report.

    Args:
        draft: all of it but what is rendered.
        up: which way is up.
        geometry: what to know about where the Gaussians are, such as `notes_on_guesses`.
        refinement: what refining changed; None without it.
    """
    scene, choice, context, target = draft.scene, draft.choice, draft.context, draft.target
    classes = draft.encoding.classes
    bounds = choice.depth_range
    notes: list[str] = [
        *scene.notes,
        *note_on_aspect([scene.frames[position] for position in (*choice.context, *choice.targets)], context.size),
        *choice.notes,
        *note_on_hidden(context, target),
        *geometry,
    ]
    if scene.origin.any():
        notes.append(FAR_FROM_ORIGIN(origin=", ".join(f"{side:.0f}" for side in scene.origin)))
    if scene.unit != "metric":
        notes.append(UNKNOWN_SCALE())
    if scene.unit == "metric" and bounds.median is not None:
        notes.append(DEPTH_BOUNDS(near=bounds.near, far=bounds.far, reason=bounds.reason))
    if classes is None:
        notes.append(NO_CLASSES())
    notes += note_on_other_table([context, *([target] if target else [])], classes)
    if refinement is not None:
        notes.append(note_on_refinement(refinement))
    if not choice.targets:
        notes.append(NONE_HELD_OUT())
    if draft.placement is not None:
        notes += draft.placement.notes(draft.names)
    if draft.exposures is not None:
        notes.append(note_on_exposures(draft.exposures))
    if draft.plan is not None and draft.plan.short:
        notes.append(MEMORY_WAS_SHORT())
    notes += [
        *(draft.labelling.notes if draft.labelling else ()),
        *(draft.features.notes if draft.features else ()),
    ]
    if not up.certain:
        notes.append(UP_IS_UNCERTAIN(reason=up.reason))
    return tuple(notes)


def note_on_other_table(parts: Sequence[Views], classes: ClassTable | None) -> list[Note]:
    """That labels of views are not compared, because they are in another class table than the Gaussians; nothing if they are, or if there are none."""
    others = {
        part.classes.name
        for part in parts
        if part.labels is not None and part.classes is not None and part.classes != classes
    }
    if classes is None or not others:
        return []
    return [OTHER_CLASS_TABLE(tables=", ".join(sorted(others)), table=classes.name)]


def notes_on_guesses(names: Sequence[str], context: Views) -> list[Note]:
    """Where the depth of the input views is no measurement; `names` are theirs."""
    notes = []
    if not has_parallax(context):
        notes.append(NO_PARALLAX_SEEN())
    if alone := [names[view] for view in strangers(context)]:
        notes.append(NO_OVERLAP(names=", ".join(alone)))
    return notes


def notes_on_splat(unseen: int, count: int, decibels: float, own: float | None) -> list[str]:
    """What a labelled splat lacks: `unseen` of its `count` Gaussians have no class; it renders what it shows of its photos with this PSNR
    [dB], and so many of them most like their own photo."""
    looks = note_on_look(decibels, own)
    return [*([WITHOUT_CLASS(unseen=unseen, count=count)] if unseen else []), *([looks] if looks else [])]


def note_on_refinement(refinement: PhotoRefinement) -> Note:
    """What decided when refining stopped."""
    passes, kept, check = refinement.passes, refinement.kept, refinement.check
    if check is None:
        return REFINED_UNCHECKED(passes=passes)
    role = CHECK_TAUGHT if refinement.check_taught else CHECK_IS_SPENT
    return (REFINED if kept else NOT_REFINED)(check=check, kept=kept, passes=passes, role=role)


def note_on_aspect(frames: Sequence[Frame], size: tuple[int, int]) -> list[Note]:
    """How images were cropped; nothing if none was."""
    kept = [kept_size(frame.lens.size, size) for frame in frames]
    cropped = [pair for pair in zip(frames, kept, strict=True) if pair[1] != pair[0].lens.size]
    if not cropped:
        return []
    (first, kept_of_first), by_x = cropped[0], "{}x{}".format
    return [
        CROPPED(
            cropped=len(cropped),
            count=len(frames),
            size=by_x(*size),
            example=first.name,
            old=by_x(*first.lens.size),
            new=by_x(*kept_of_first),
        )
    ]


def note_on_hidden(context: Views, target: Views | None) -> list[Note]:
    """How many pixels are hidden; nothing if none is."""
    counts = [
        f"{int(views.hidden.sum()):,} of {views.hidden.numel():,} pixels of the {title} views"
        for title, views in (("input", context), ("held-out", target))
        if views is not None and views.hidden is not None
    ]
    return [HIDDEN(pixels=" and ".join(counts))] if counts else []


def note_on_exposures(exposures: Exposures) -> Note:
    """By how much the exposures of the input photos differ."""
    before, after = (100 * error**0.5 for error in exposures.compared)
    least, most = exposures.gains.aminmax()
    return EXPOSURES_DIFFER(least=float(least), most=float(most), before=before, after=after)


def strangers(context: Views) -> list[int]:
    """The views that share no point with another view: points on a grid of pixels, at 16 depths from near to far, are tested."""
    grid = torch.diag(torch.tensor([GRID / context.size[1], GRID / context.size[0], 1.0], dtype=torch.float64))
    cameras = context.cameras.adjusted(grid, (GRID, GRID))
    near, far = context.depth_range[:, 0].min(), context.depth_range[:, 1].max()
    depths = 1 / torch.linspace(float(1 / near), float(1 / far), 16, dtype=torch.float64)

    def sees(camera: Cameras, other: Cameras) -> bool:
        """Whether a camera sees one of the points of another."""
        points = back_project(depths[:, None, None].expand(-1, GRID, GRID), other)
        x, y, depth = project(points.flatten(end_dim=-2), camera).unbind(-1)
        return bool(((depth > 0) & (x >= 0) & (x < GRID) & (y >= 0) & (y < GRID)).any())

    def shares(view: int) -> bool:
        """Whether a view shares a point with another one; those that are next to it in time are tried first."""
        others = sorted(set(range(len(context))) - {view}, key=lambda other: abs(other - view))
        pairs = ((cameras[view], cameras[other]) for other in others)
        return any(sees(camera, other) or sees(other, camera) for camera, other in pairs)

    return [view for view in range(len(context)) if not shares(view)]


def has_parallax(context: Views) -> bool:
    """Whether the context cameras are further apart than `NO_PARALLAX` times the near bound."""
    centres = context.cameras.centres
    spread = torch.cdist(centres, centres).max()
    return bool(spread > NO_PARALLAX * context.depth_range[:, 0].min())

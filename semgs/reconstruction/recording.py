"""Recordings on disk: one scene from all frames of a walk, as a reconstruction that the report, the export and the viewer take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.choosing.choice import Choice
from semgs.data.resampling import default_size
from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.mapping.keyframes import COVERED
from semgs.mapping.mapper import Mapper, Merged
from semgs.model.encode import Network, encode
from semgs.reconstruction.pipeline import Reconstruction, rendered_from
from semgs.reconstruction.sensor_depth import DepthSource, Placed, check_listed, check_measured, placed
from semgs.rendering.rendering import check_may_be_unknown
from semgs.runtime.stopwatch import Stages
from semgs.scene.encoding import Encoding
from semgs.segmenters.labelling import Labelling

HELD_OUT = 4
"""At most this many frames that are no keyframes are rendered and compared."""

VOXEL_SHARE = 0.0015
"""Size of voxels as a share of the typical depth; 3 mm in metric scenes."""

NAMED = 3
"""Notes name at most this many frames."""


def reconstruct_recording(
    scene: Scene,
    model: Network,
    size: Sequence[int] | None = None,
    *,
    depth: DepthSource = "network",
    labelling: Labelling | None = None,
    views: int = 2,
    min_confidence: float = 0.0,
    stages: Stages | None = None,
    notes: Sequence[str] = (),
) -> Reconstruction:
    """One scene from all frames of a recording, in file order.

    The input views are the keyframes. Held out are up to `HELD_OUT` of the other frames, evenly spread. Frames that cannot be used are counted in a note.

    Args:
        scene: an open scene.
        model: in evaluation mode, on the device to compute on.
        size: (height, width) of the frames as read [px]; None is `default_size` of the first one. Other aspect ratios are cropped.
        depth, labelling, min_confidence, stages, notes: as for `semgs.reconstruction.pipeline.reconstruct`.
        views: of a window, 2 to 4.

    Raises:
        InputError: no two frames can be used together.
        NotEnoughMemoryError: a window would not fit in memory.
        ValueError: as `Mapper`, or a least confidence without classes, or with too many.
    """
    stages = stages or Stages()
    classes = model.classes if labelling is None else labelling.source.classes
    if min_confidence > 0:
        if classes is None:
            raise ValueError("the model predicts colour only; expected one with classes for a least confidence")
        check_may_be_unknown(len(classes))
    native = scene.frames[0].lens.size
    wanted = default_size(native) if size is None else (size[0], size[1])
    with stages("read", "Finding the depth range"):
        bounds = scene.depth_range()
    fits: dict[int, Placed] = {}

    def window(positions: Sequence[int], seen: Views) -> Encoding:
        with stages("encode", f"Frame {positions[-1] + 1} of {len(scene)}: encoding {len(positions)} views"):
            encoding = encode(model, seen).encoding
        if depth != "network":
            with stages("place", "Placing Gaussians at the measured depth"):
                found = placed(encoding, seen, depth)
                encoding = found.encoding
                for view, position in enumerate(positions):
                    fits.setdefault(position, replace(found, fits=(found.fits[view],)))
        if labelling is not None:
            with stages("segment", f"Classes from {labelling.source.title}"):
                encoding = labelling(encoding, scene, positions, seen)
        return encoding

    mapper = Mapper(window, bounds, views=views, voxel=VOXEL_SHARE * bounds.typical)
    unread: list[str] = []
    for position, frame in enumerate(scene.frames):
        try:
            if depth != "network":
                check_listed(scene, [position])
            with stages("read", f"Reading frame {position + 1} of {len(scene)}"):
                view = scene.read([position], wanted, bounds)
            if depth != "network":
                check_measured(scene, [position], view)
        except InputError as error:
            unread.append(error.first_line)
            mapper.ignore("it cannot be read, or has too little measured depth")
            continue
        with torch.no_grad():
            mapper.add(view, frame.name)
    with stages("merge", "Merging"), torch.no_grad():
        merged = mapper.merged()
    if merged is None:
        why = unread[0] if unread else _summary(mapper) or "no frame shares 30% of what it sees with another"
        raise InputError(scene.path, "at least two usable frames that overlap", f"none: {why}")
    return _reconstruction(
        scene, merged, mapper, bounds, model.name, labelling, fits, min_confidence, stages, [*notes, *unread[:1]]
    )


def _reconstruction(
    scene: Scene,
    merged: Merged,
    mapper: Mapper,
    bounds: DepthRange,
    model: str,
    labelling: Labelling | None,
    fits: dict[int, Placed],
    min_confidence: float,
    stages: Stages,
    notes: Sequence[str],
) -> Reconstruction:
    """The reconstruction with its renderings and notes."""
    encoding, keyframes = merged.encoding, merged.numbers
    targets = _held_out(mapper, keyframes)
    with stages("render", f"Rendering {len(keyframes) + len(targets)} views"), torch.no_grad():
        own = rendered_from(scene, keyframes, merged.views, encoding, encoding.classes)
        held = None
        if targets:
            held = rendered_from(
                scene, targets, scene.read(targets, merged.views.size, bounds), encoding, encoding.classes
            )
    measured = None
    if fits:
        first = fits[keyframes[0]]
        measured = replace(first, encoding=encoding, fits=tuple(fits[number].fits[0] for number in keyframes))
    reason = (
        f"all frames: {len(keyframes)} of {len(scene)} are keyframes, because earlier ones saw less than {COVERED:.0%} of what they see; "
        f"{mapper.windows} windows"
    )
    return Reconstruction(
        scene=scene,
        choice=Choice(keyframes, targets, reason, bounds),
        native_size=scene.frames[keyframes[0]].lens.size,
        encoding=encoding,
        classes=encoding.classes,
        model=model,
        context=own,
        target=held,
        notes=(
            *notes,
            *scene.notes,
            *_notes(scene, mapper),
            *(measured.notes(merged.names) if measured else ()),
            *(labelling.notes if labelling else ()),
        ),
        labelling=labelling,
        placed=measured,
        min_confidence=min_confidence,
    )


def _held_out(mapper: Mapper, keyframes: Sequence[int]) -> tuple[int, ...]:
    """Frames to compare with: usable, no keyframes, evenly spread."""
    others = [number for number in mapper.usable if number not in keyframes]
    count = min(HELD_OUT, len(others))
    return tuple(others[(2 * place + 1) * len(others) // (2 * count)] for place in range(count))


def _notes(scene: Scene, mapper: Mapper) -> list[str]:
    """What the user should know about the frames, a sentence each."""
    notes = []
    if summary := _summary(mapper):
        notes.append(f"Frames that were left out: {summary}.")
    if mapper.alone:
        names = ", ".join(mapper.alone[:NAMED]) + (", ..." if len(mapper.alone) > NAMED else "")
        notes.append(
            f"No overlap: {len(mapper.alone)} frames share too little with any other and were not used ({names})."
        )
    sizes = {frame.lens.size for frame in scene.frames}
    if len(sizes) > 1:
        notes.append(
            f"The frames have {len(sizes)} different sizes; all were resized and cropped to that of the first one."
        )
    if mapper.voxel is not None:
        size = f"{1000 * mapper.voxel:.1f} mm" if scene.unit == "metric" else f"{mapper.voxel:.3g}"
        notes.append(f"Gaussians in the same voxel of {size} were joined.")
    if scene.origin.any():
        notes.append(
            "The scene is far from the origin of its coordinates: add scene.origin of report.json to positions in scene.safetensors."
        )
    if scene.unit != "metric":
        notes.append(
            "The scale of this scene is unknown, so lengths are in its own unit and depth maps are floating-point TIFF files."
        )
    return notes


def _summary(mapper: Mapper) -> str:
    """How many frames were left out, by reason; empty if none was."""
    return "; ".join(f"{count} because {reason}" for reason, count in sorted(mapper.ignored.items()))

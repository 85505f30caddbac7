"""Recordings: maps all frames of a walk into one scene, window by window."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from semgs.data.bounds.depth_range import DepthRange
from semgs.data.choosing.choice import Choice
from semgs.data.scene import Scene
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.files.text import counted
from semgs.mapping.keyframes import COVERED
from semgs.mapping.mapper import Mapper, Merged, Window
from semgs.mapping.walk_order import walk_order
from semgs.run.steps.notes import left_out, notes_on_walk
from semgs.runtime.stopwatch import Stages
from semgs.scene.encoding import Encoding

HELD_OUT = 4
"""At most this many frames that are no keyframes are rendered and compared."""

VOXEL_SHARE = 0.0015
"""Size of voxels as a share of the typical depth; 3 mm in metric scenes."""


@dataclass(frozen=True)
class Walk:
    """All frames of a recording, in the order of the walk.

    Attributes:
        views: of a window, 2 to 4.
    """

    views: int = 2


def map_walk(
    scene: Scene, walk: Walk, read: Callable[[Sequence[int], DepthRange], Views], window: Window, stages: Stages
) -> tuple[Choice, Merged]:
    """Encode the keyframes of a recording in windows, and merge these. Returns the chosen frames and the merged scene.

    The input views are the keyframes. Held out are up to `HELD_OUT` of the other frames, evenly spread. Frames that cannot be used are counted in a note.

    Args:
        scene: contains the frames.
        walk: how large windows are.
        read: reads frames, given their positions and near and far.
        window: encodes a window, given the positions of its frames and the views.
        stages: shows and times the stages read and merge.

    Raises:
        InputError: no two frames can be used together.
        ValueError: as `Mapper`, or as `window`.
    """
    with stages("read", "Finding the depth range"):
        bounds = scene.depth_range()
    order = walk_order(
        [frame.name for frame in scene.frames],
        np.stack([frame.world_from_camera for frame in scene.frames]),
        bounds.typical,
    )

    def window_of(numbers: Sequence[int], views: Views) -> Encoding:
        """The window of the frames with these numbers in the order of the walk."""
        return window([order.positions[number] for number in numbers], views)

    mapper = Mapper(window_of, bounds, views=walk.views, voxel=VOXEL_SHARE * bounds.typical)
    errors: list[str] = []
    for number, position in enumerate(order.positions, 1):
        frame = scene.frames[position]
        try:
            with stages("read", f"Reading frame {number} of {len(scene)}"):
                view = read([position], bounds)
        except InputError as error:
            errors.append(str(error))
            mapper.ignore("it cannot be read, or has no or too little depth")
            continue
        mapper.add(view, frame.name)
    with stages("merge", "Merging"):
        merged = mapper.merged()
    if merged is None:
        why = errors[0] if errors else left_out(mapper) or "no frame shares 30% of what it sees with another"
        raise InputError(scene.path, "at least two usable frames that overlap", f"none: {why}")
    keyframes = tuple(order.positions[number] for number in merged.numbers)
    others = [order.positions[number] for number in mapper.usable if number not in merged.numbers]
    count = min(HELD_OUT, len(others))
    targets = tuple(others[(2 * place + 1) * len(others) // (2 * count)] for place in range(count))
    reason = (
        f"all frames: {len(keyframes)} of {len(scene)} are keyframes, because earlier ones saw less than {COVERED:.0%} of what they see; "
        f"{counted(mapper.windows, 'window')}"
    )
    notes: tuple[str, ...] = (
        *filter(None, (order.note,)),
        *errors[:1],
        *notes_on_walk(mapper, scene.unit == "metric"),
    )
    return Choice(keyframes, targets, reason, bounds, notes), merged

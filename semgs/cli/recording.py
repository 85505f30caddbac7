"""`semgs reconstruct --all`: one scene from all frames of a recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

from semgs.cli.errors import UsageError, what_fits, what_the_user_gave

if TYPE_CHECKING:
    from collections.abc import Sequence

    from semgs.data.scene import Scene
    from semgs.model.semgs import SemGS
    from semgs.reconstruction.reconstruct import Reconstruction
    from semgs.reconstruction.sensor import DepthSource
    from semgs.reconstruction.stages import Stages
    from semgs.segmenters.labelling import Labelling


WIDEST_WINDOW = 4
"""Views of a window, at most."""


def check_recording_options(views: int, context: Sequence[int | str], features: bool) -> None:
    """Check the options that cannot be used together with --all.

    Raises:
        UsageError: there is one.
    """
    if context:
        raise UsageError("--context names the frames to use and --all uses all of them; leave one out")
    if features:
        raise UsageError("--features is for a reconstruction of 2 to 4 views, not for --all")
    if views > WIDEST_WINDOW:
        raise UsageError(f"--views is {views}; expected 2 to {WIDEST_WINDOW} with --all, the views of each window")


def reconstructed(
    scene: Scene,
    model: SemGS,
    size: Sequence[int] | None,
    *,
    depth: DepthSource,
    labelling: Labelling | None,
    views: int,
    min_confidence: float,
    stages: Stages,
    notes: Sequence[str],
) -> Reconstruction:
    """The reconstruction of a recording; arguments as for `reconstruct_recording`.

    Raises:
        InputError, UsageError: nothing can be used, a number is invalid, or there is too little memory.
    """
    from semgs.mapping.recording import reconstruct_recording

    with what_fits(), what_the_user_gave():
        return reconstruct_recording(
            scene,
            model,
            size,
            depth=depth,
            labelling=labelling,
            views=views,
            min_confidence=min_confidence,
            stages=stages,
            notes=notes,
        )

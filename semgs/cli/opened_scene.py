"""What the user gave as a reconstruction: a scene of ours, or a splat of another program."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from semgs.cli.usage_errors import UsageError
from semgs.splats.endings import is_splat

if TYPE_CHECKING:
    from semgs.scene.upright import Up
    from semgs.splats.scene_opening import OpenedScene


def open_given(scene: Path, cameras: Path | None, up: Up) -> OpenedScene:
    """Open it; arguments and errors as for `open_reconstruction`.

    Raises:
        UsageError: cameras are given for a scene that has its own.
    """
    from semgs.splats.scene_opening import open_reconstruction

    if cameras is not None and not is_splat(scene):
        raise UsageError(f"--cameras is for splats of other programs; {scene} has cameras of its own")
    return open_reconstruction(scene, cameras, up)

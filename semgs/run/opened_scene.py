"""What the user gave as a reconstruction: a scene of ours, or a splat of another program."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from semgs.files.errors import InputError
from semgs.run.options.types import ACTIVATED, Activated
from semgs.run.usage_errors import UsageError
from semgs.splats.endings import is_splat

if TYPE_CHECKING:
    from semgs.scene.opened import OpenedScene
    from semgs.scene.upright import Up


def open_given(scene: Path, cameras: Path | None, up: Up, activated: Activated = "auto") -> OpenedScene:
    """Open it, without the readers of photos if it is ours: they take a second to import. Its note says what is probably wrong with a splat.

    Raises:
        InputError, ImportError: it cannot be used, as `open_splat` says.
        UsageError: cameras are given for a scene that has its own.
    """
    if is_splat(scene):
        from semgs.splats.scene_opening import open_splat

        return open_splat(scene, cameras, up, ACTIVATED[activated])
    if cameras is not None:
        raise UsageError(f"--cameras is for splats of other programs; {scene} has cameras of its own")
    if activated != "auto":
        raise UsageError(f"--activated is for splats of other programs; {scene} is not one")
    from semgs.files.paths import typed_path
    from semgs.scene.opened import OpenedScene
    from semgs.scene.scene_file import load_scene

    return OpenedScene(load_scene(typed_path(scene)), up)


def check_for_robots(path: Path, opened: OpenedScene, option: str, classes: bool) -> None:
    """Check that a scene has what things and maps need.

    Args:
        path: the scene as given.
        opened: the same, opened.
        option: the option that needs it, for the message.
        classes: whether it needs classes as well as metres.

    Raises:
        InputError: its unit is unknown, or it has no classes.
    """
    from semgs.export.scene_objects import GET_METRES

    if opened.scene.unit != "metric":
        advice = "give --cameras with a scene in metres" if opened.splat else GET_METRES
        raise InputError(path, f"a scene in metres for {option}", "one whose unit is unknown", advice=advice)
    if classes and opened.scene.classes is None:
        raise InputError(path, f"a scene with classes for {option}", "one with colour and depth only")

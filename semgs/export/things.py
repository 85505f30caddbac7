"""Things and free floor of a saved scene, which knows its cameras, its classes and its unit."""

from __future__ import annotations

from typing import Any

from semgs.export.scene import SavedScene
from semgs.export.upright import UpDirection
from semgs.robotics.grid import Occupancy, occupancy
from semgs.robotics.things import Objects, objects


def things_of(scene: SavedScene, up: UpDirection, **options: Any) -> Objects:
    """The things of a scene, with distances from its first camera; options as for `semgs.objects`.

    Args:
        scene: in metres, with classes.
        up: the direction that is up in it.

    Raises:
        ValueError: as `check_metric`, or the scene has no classes.
        ImportError: scikit-learn or trimesh is not installed.
    """
    check_metric(scene)
    if scene.classes is None:
        raise ValueError("the scene has no classes; things are found by class")
    return objects(
        scene.gaussians,
        scene.classes,
        up=up.direction.tolist(),
        seen_from=scene.cameras.centres[0].tolist(),
        temperature=None if scene.temperatures is None else scene.temperatures.gaussians,
        **options,
    )


def occupancy_of(scene: SavedScene, up: UpDirection, **options: Any) -> Occupancy:
    """The occupancy of a scene; options as for `semgs.occupancy`.

    Args:
        scene: in metres.
        up: the direction that is up in it.

    Raises:
        ValueError: as `check_metric` and `semgs.occupancy`.
        NoFloorError: no floor was found.
    """
    check_metric(scene)
    return occupancy(
        scene.gaussians,
        scene.cameras,
        up=up.direction.tolist(),
        classes=scene.classes,
        depths=scene.depths,
        depth_spread=scene.depth_spread,
        **options,
    )


def check_metric(scene: SavedScene) -> None:
    """Check that lengths are in metres.

    Raises:
        ValueError: the unit is unknown.
    """
    if scene.unit != "metric":
        raise ValueError(
            "the unit of the scene is unknown, and things and free floor need metres; "
            "reconstruct it with --scale-from, which finds the scale"
        )

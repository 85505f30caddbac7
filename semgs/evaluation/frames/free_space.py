"""Free space as a robot would take it: the map that a method makes of its input views, beside the map by their measured depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from semgs.data.views import Views
from semgs.depth_maps.sensor_depth import place_gaussians
from semgs.export.scene_objects import occupancy_of
from semgs.geometry.cameras import Cameras
from semgs.robotics.floor import NoFloorError
from semgs.robotics.occupancy import FREE, OCCUPIED, Occupancy
from semgs.scene.encoding import Encoding
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import UpDirection, up_of

REACH = 5.0
"""How far ahead an obstacle counts [m]."""


@dataclass(frozen=True)
class FreeSpace:
    """Numbers of cells and cameras; those of several targets add up.

    Attributes:
        occupied, free: cells by measured depth.
        occupied_as_free, free_as_free: those of them that the method calls free.
        cameras: input views.
        obstacle_error: sum over them of the error of the distance of the nearest obstacle ahead, at most `REACH` [m].
    """

    occupied: int
    occupied_as_free: int
    free: int
    free_as_free: int
    cameras: int
    obstacle_error: float


def score_free_space(encoding: Encoding, contexts: Views, measured: Views) -> FreeSpace | None:
    """Compare the map of some Gaussians with that of the same Gaussians at measured depth. Without a floor of its own, a method calls nothing free.

    Args:
        encoding: of the input views, in metres.
        contexts: the input views.
        measured: the same with measured depth.

    Returns:
        The numbers; None if a view has no depth, or the floor is in none.
    """
    if measured.depths is None or not (measured.depths > 0).any((-2, -1)).all():
        return None
    own = SavedScene.of(encoding, contexts, unit="metric")
    true = SavedScene.of(place_gaussians(encoding, measured, "sensor")[0], contexts, unit="metric")
    up = up_of(true)
    truth = _map(true, up)
    return None if truth is None else compare(_map(own, up), truth, contexts.cameras)


def _map(scene: SavedScene, up: UpDirection) -> Occupancy | None:
    """The map of a scene; None if no floor is found."""
    try:
        return occupancy_of(scene, up, reach=REACH)
    except NoFloorError:
        return None


def compare(found: Occupancy | None, truth: Occupancy, cameras: Cameras) -> FreeSpace:
    """The numbers of a map beside the true one, in one level frame.

    Args:
        found: the map; None if no floor was found.
        truth: the true map.
        cameras: of the input views.
    """
    called_free = np.zeros(truth.cells.shape, bool) if found is None else found.at(truth.middles) == FREE
    occupied, free = truth.cells == OCCUPIED, truth.cells == FREE
    poses = cameras.world_from_camera.numpy()
    errors = [
        abs(truth.ahead(pose, reach=REACH) - (REACH if found is None else found.ahead(pose, reach=REACH)))
        for pose in poses
    ]
    return FreeSpace(
        occupied=int(occupied.sum()),
        occupied_as_free=int((occupied & called_free).sum()),
        free=int(free.sum()),
        free_as_free=int((free & called_free).sum()),
        cameras=len(errors),
        obstacle_error=float(sum(errors)),
    )

"""Random rooms as triangles, materials and lights, ready for ray casting."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from semgs.data.raycast import Raycaster
from semgs_rooms.assets.asset_images import Pack
from semgs_rooms.assets.asset_library import Library
from semgs_rooms.drawing import shading_kernels as kernels
from semgs_rooms.drawing.lighting import draw_lights
from semgs_rooms.pieces import shell_kernels
from semgs_rooms.pieces import texture_kernels as t
from semgs_rooms.pieces.shells import ShellTriangles, place_shells
from semgs_rooms.pieces.solids import SHELL, Solids, gather, triangulate
from semgs_rooms.plans.floor_plan import WALL, FloorPlan
from semgs_rooms.plans.style import Style
from semgs_rooms.plans.worlds import furnish

FIELD_STEP = 0.1
"""Spacing of the distance field's nodes [m]."""
FLAT = 0.02
"""Parts whose top is below this height count as floor [m]."""
FIELD_REACH = 0.7
"""Distances in the field are clipped to this [m]."""
SENT_BACK = 0.6
"""Light on surfaces close to others, as a share of the room's ambient light."""
SCATTER = 0.05
"""Spacing of the points on shells that represent them in the distance field [m]."""


@dataclass(frozen=True)
class Room:
    """A room ready to be rendered.

    Attributes:
        plan: its floor plan.
        solids: its parts as arrays.
        owners: the part of each triangle.
        planes: unit normal and offset of each triangle's plane (n . x = offset).
        caster: its triangles.
        space: distance from grid nodes to the nearest solid, at most `FIELD_REACH`, without the floor and flat things on it [m].
        corner: position of the grid's first node [m].
        shifts: texture offset of each part.
        lights: as the shading kernels take them.
        ambient: ambient light, linear RGB.
        glow: light that each part returns to nearby surfaces, linear RGB.
        shells: the triangles of meshes; they follow those of solids.
        pictures: the images of materials of kind PICTURE.
        files: of the assets in it.
    """

    plan: FloorPlan
    solids: Solids
    owners: Int64[np.ndarray, " t"]
    planes: Float64[np.ndarray, "t 4"]
    caster: Raycaster
    space: Float64[np.ndarray, "x y z"]
    corner: Float64[np.ndarray, " 3"]
    shifts: Float64[np.ndarray, " p"]
    lights: Float64[np.ndarray, "l 16"]
    ambient: Float64[np.ndarray, " 3"]
    glow: Float64[np.ndarray, "p 3"]
    shells: ShellTriangles
    pictures: Pack
    files: tuple[str, ...] = ()

    def clearance(self, places: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
        """Distance from places in the room to the nearest solid except the floor, at most `FIELD_REACH` [m]."""
        result = np.empty(len(places))
        kernels.clearances(self.space, self.corner, FIELD_STEP, places, result)
        return result

    def inside(self, places: Float64[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
        """Whether places are between the walls."""
        half = np.array(self.plan.size) / 2
        return (np.abs(places - (0, 0, half[2])) < half).all(axis=-1)


def build_room(rng: np.random.Generator, library: Library | None = None, style: Style = "home") -> Room:
    """A random furnished room with its lights.

    Args:
        rng: source of all random choices.
        library: meshes and images to use, None for none. Furniture has the same places with and without.
        style: of the room.

    Raises:
        ValueError: there is no such style.
        InputError: a file of the library cannot be read.
        ImportError: embreex is not installed; the message names the extra to install.
    """
    plan, used = furnish(rng, library, style)
    solids = gather(plan.parts)
    corners, owners = triangulate(solids)
    placed = [(number, part.shell) for number, part in enumerate(plan.parts) if part.shell is not None]
    shells = place_shells(placed, solids.rotations, solids.centres, len(corners))
    corners, owners = np.concatenate((corners, shells.corners)), np.concatenate((owners, shells.owners))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30)
    planes = np.column_stack((normals, (normals * corners[:, 0]).sum(-1)))
    caster = Raycaster(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    space, corner = _distance_field(plan, solids, (_tops(solids) >= FLAT) & (solids.shapes != SHELL))
    if len(shells.corners):
        points = shell_kernels.scatter(shells.corners, SCATTER)
        shell_kernels.distance_to_points(space, corner, FIELD_STEP, FIELD_REACH, points)
    lights, ambient = draw_lights(rng, plan)
    pictures = used.pack()
    return Room(
        plan, solids, owners, planes, caster, space, corner,
        shifts=rng.uniform(0, 50, len(plan.parts)),
        lights=lights,
        ambient=ambient,
        glow=_glow(solids, ambient, pictures),
        shells=shells,
        pictures=pictures,
        files=used.files,
    )  # fmt: skip


def _glow(solids: Solids, ambient: Float64[np.ndarray, " 3"], pictures: Pack) -> Float64[np.ndarray, "p 3"]:
    """Light that parts return to nearby surfaces: their mean colour under reduced ambient light, or their emission."""
    rows = solids.materials
    first, second, third = (rows[:, start : start + 3] for start in (t.COLOUR_A, t.COLOUR_B, t.COLOUR_C))
    kinds = rows[:, t.KIND]
    colours = np.where((kinds == t.PLAIN)[:, None], first, (2 * first + second + third) / 4)
    shown = np.flatnonzero(kinds == t.PICTURE)
    colours[shown] = first[shown] * pictures.means[rows[shown, t.PICTURE_NUMBER].astype(int)]
    emission = rows[:, t.EMISSION, None]
    return np.where(emission > 0, colours * emission, np.minimum(colours, 0.9) * ambient * SENT_BACK)


def _tops(solids: Solids) -> Float64[np.ndarray, " p"]:
    """Top of the bounding box of each part [m]."""
    return solids.centres[:, 2] + (np.abs(solids.rotations[:, 2]) * solids.sizes / 2).sum(-1)


def _distance_field(
    plan: FloorPlan, solids: Solids, which: Bool[np.ndarray, " p"]
) -> tuple[Float64[np.ndarray, "x y z"], Float64[np.ndarray, " 3"]]:
    """Distance to the nearest of some solids, on a grid that extends half way into walls, floor and ceiling."""
    size = np.array(plan.size)
    corner = np.array([-size[0] / 2, -size[1] / 2, 0.0]) - WALL / 2
    nodes = np.ceil((size + WALL) / FIELD_STEP).astype(int) + 1
    field = np.full(tuple(nodes), FIELD_REACH)
    kernels.distance_field(
        field, corner, FIELD_STEP, FIELD_REACH, solids.rotations[which], solids.centres[which], solids.sizes[which]
    )
    return field, corner

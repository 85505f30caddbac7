"""Rooms from a seed, in the form that rays need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from semgs.data.raycast import Raycaster
from semgs.rooms.assets.images import Pack
from semgs.rooms.assets.library import Library
from semgs.rooms.drawing import shading_kernels as kernels
from semgs.rooms.drawing.lighting import draw_lights
from semgs.rooms.pieces import shell_kernels
from semgs.rooms.pieces import texture_kernels as t
from semgs.rooms.pieces.shells import ShellTriangles, place_shells
from semgs.rooms.pieces.solids import SHELL, Solids, gather, triangulate
from semgs.rooms.plans.floor_plan import WALL, FloorPlan
from semgs.rooms.plans.style import Style
from semgs.rooms.plans.worlds import furnish

FIELD_STEP = 0.1
"""Spacing of the distance field's nodes [m]."""
FLAT = 0.02
"""What ends below this height is ground to stand on [m]."""
FIELD_REACH = 0.7
"""Distances are exact up to here and cut off there [m]."""
SENT_BACK = 0.6
"""Light on surfaces that are near others, as a share of the room's ambient light."""
SCATTER = 0.05
"""Spacing of the points of shells from which distances are taken [m]."""


@dataclass(frozen=True)
class Room:
    """A room that can be looked at.

    Attributes:
        plan: what stands where.
        solids: its parts as arrays.
        owners: the part of each triangle.
        planes: unit normal and offset of each triangle's plane (n . x = offset).
        caster: its triangles.
        space: distance of grid nodes to the nearest solid but the floor and what lies flat on it, at most `FIELD_REACH` [m].
        corner: where the grid starts [m].
        shifts: moves the texture of each part.
        lights: rows for the shading kernels.
        ambient: light from everywhere, linear RGB.
        glow: what each part sends back to what is near it, linear RGB.
        shells: the triangles that are not of solids, the last ones of all.
        pictures: what materials of kind PICTURE show.
        files: of the assets that are in it.
    """

    plan: FloorPlan
    solids: Solids
    owners: Int64[np.ndarray, " t"]
    planes: Float64[np.ndarray, "t 4"]
    caster: Raycaster
    space: Float64[np.ndarray, "x y z"]
    corner: Float64[np.ndarray, 3]
    shifts: Float64[np.ndarray, " p"]
    lights: Float64[np.ndarray, "l 16"]
    ambient: Float64[np.ndarray, 3]
    glow: Float64[np.ndarray, "p 3"]
    shells: ShellTriangles
    pictures: Pack
    files: tuple[str, ...] = ()

    def clearance(self, places: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
        """Distance of places in the room to the nearest solid but the floor, at most `FIELD_REACH` [m]."""
        result = np.empty(len(places))
        kernels.clearances(self.space, self.corner, FIELD_STEP, places, result)
        return result

    def inside(self, places: Float64[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
        """Whether places are between the walls."""
        half = np.array(self.plan.size) / 2
        return (np.abs(places - (0, 0, half[2])) < half).all(axis=-1)


def build_room(rng: np.random.Generator, library: Library | None = None, style: Style = "home") -> Room:
    """A random furnished room with its light.

    Args:
        rng: draws it. Furniture stands where it does without a library.
        library: meshes and pictures, of the split that suits the purpose; None is none.
        style: the world that the room is of.

    Raises:
        ValueError: there is no such style.
        InputError: a file of the library cannot be read.
        ImportError: embreex is not installed; names the extra that brings it.
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
    """What parts send back: their mean colour in the light that a near, half hidden surface gets, or what they emit."""
    rows = solids.materials
    first, second, third = (rows[:, start : start + 3] for start in (t.COLOUR_A, t.COLOUR_B, t.COLOUR_C))
    kinds = rows[:, t.KIND]
    colours = np.where((kinds == t.PLAIN)[:, None], first, (2 * first + second + third) / 4)
    shown = np.flatnonzero(kinds == t.PICTURE)
    colours[shown] = first[shown] * pictures.means[rows[shown, t.PICTURE_NUMBER].astype(int)]
    emission = rows[:, t.EMISSION, None]
    return np.where(emission > 0, colours * emission, np.minimum(colours, 0.9) * ambient * SENT_BACK)


def _tops(solids: Solids) -> Float64[np.ndarray, " p"]:
    """Height of the upper end of the boxes around the parts [m]."""
    return solids.centres[:, 2] + (np.abs(solids.rotations[:, 2]) * solids.sizes / 2).sum(-1)


def _distance_field(
    plan: FloorPlan, solids: Solids, which: Bool[np.ndarray, " p"]
) -> tuple[Float64[np.ndarray, "x y z"], Float64[np.ndarray, 3]]:
    """Distance to the nearest of some solids on a grid that reaches half way into walls, floor and ceiling."""
    size = np.array(plan.size)
    corner = np.array([-size[0] / 2, -size[1] / 2, 0.0]) - WALL / 2
    nodes = np.ceil((size + WALL) / FIELD_STEP).astype(int) + 1
    field = np.full(tuple(nodes), FIELD_REACH)
    kernels.distance_field(
        field, corner, FIELD_STEP, FIELD_REACH, solids.rotations[which], solids.centres[which], solids.sizes[which]
    )
    return field, corner

"""Plain rooms: furnished boxes from a seed, in the form that rays need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from semgs.data.raycast import Raycaster
from semgs.rooms import shading_kernels as kernels
from semgs.rooms import shell_kernels
from semgs.rooms import texture_kernels as t
from semgs.rooms.assets.library import Library
from semgs.rooms.assets.pictures import Pack
from semgs.rooms.plans import WALL, Plan
from semgs.rooms.shells import ShellTriangles, place_shells
from semgs.rooms.solids import SHELL, Solids, gather, triangulate
from semgs.rooms.styles import furnish

FIELD_STEP = 0.1
"""Spacing of the distance field's nodes [m]."""
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
        field: distance of grid nodes to the nearest solid, at most `FIELD_REACH` [m].
        corner: where the grid starts [m].
        shifts: moves the texture of each part.
        lights: rows for the shading kernels.
        ambient: light from everywhere, linear RGB.
        glow: what each part sends back to what is near it, linear RGB.
        shells: the triangles that are not of solids, the last ones of all.
        pictures: what materials of kind PICTURE show.
        files: of the assets that are in it.
    """

    plan: Plan
    solids: Solids
    owners: Int64[np.ndarray, " t"]
    planes: Float64[np.ndarray, "t 4"]
    caster: Raycaster
    field: Float64[np.ndarray, "x y z"]
    corner: Float64[np.ndarray, 3]
    shifts: Float64[np.ndarray, " p"]
    lights: Float64[np.ndarray, "l 16"]
    ambient: Float64[np.ndarray, 3]
    glow: Float64[np.ndarray, "p 3"]
    shells: ShellTriangles
    pictures: Pack
    files: tuple[str, ...] = ()

    def clearance(self, places: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
        """Distance of places in the room to the nearest solid, at most `FIELD_REACH` [m]."""
        result = np.empty(len(places))
        kernels.clearances(self.field, self.corner, FIELD_STEP, places, result)
        return result

    def inside(self, places: Float64[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
        """Whether places are between the walls."""
        half = np.array([self.plan.size[0] / 2, self.plan.size[1] / 2, self.plan.size[2] / 2])
        return (np.abs(places - (0, 0, half[2])) < half).all(axis=-1)


def build_room(rng: np.random.Generator, library: Library | None = None, style: str = "home") -> Room:
    """A random furnished room with its light.

    Args:
        rng: draws it. Without a library a home takes the same numbers as it always did.
        library: meshes and pictures, of the split that suits the purpose; None is none.
        style: "home", or "other", the world that is held out.

    Raises:
        ValueError: there is no such style.
        InputError: a file of the library cannot be read.
        ImportError: embreex is not installed; names the extra that brings it.
    """
    plan, gallery = furnish(rng, library, style)
    solids = gather(plan.parts)
    corners, owners = triangulate(solids)
    placed = [(number, part.shell) for number, part in enumerate(plan.parts) if part.shell is not None]
    shells = place_shells(placed, solids.rotations, solids.centres, len(corners))
    corners, owners = np.concatenate((corners, shells.corners)), np.concatenate((owners, shells.owners))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-30)
    planes = np.column_stack((normals, (normals * corners[:, 0]).sum(-1)))
    caster = Raycaster(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    field, corner = _distance_field(plan, solids, shells)
    lights, ambient = _lighting(rng, plan)
    pictures = gallery.pack()
    return Room(
        plan,
        solids,
        owners,
        planes,
        caster,
        field,
        corner,
        shifts=rng.uniform(0, 50, len(plan.parts)),
        lights=lights,
        ambient=ambient,
        glow=_glow(solids, ambient, pictures),
        shells=shells,
        pictures=pictures,
        files=gallery.files,
    )


def _distance_field(
    plan: Plan, solids: Solids, shells: ShellTriangles
) -> tuple[Float64[np.ndarray, "x y z"], Float64[np.ndarray, 3]]:
    """Distance to the nearest solid on a grid that reaches half way into walls, floor and ceiling."""
    size = np.array(plan.size)
    corner = np.array([-size[0] / 2, -size[1] / 2, 0.0]) - WALL / 2
    nodes = np.ceil((size + WALL) / FIELD_STEP).astype(int) + 1
    field = np.full(tuple(nodes), FIELD_REACH)
    whole = solids.shapes != SHELL
    kernels.distance_field(
        field, corner, FIELD_STEP, FIELD_REACH, solids.rotations[whole], solids.centres[whole], solids.sizes[whole]
    )
    if len(shells.corners):
        points = shell_kernels.scatter(shells.corners, SCATTER)
        shell_kernels.distance_to_points(field, corner, FIELD_STEP, FIELD_REACH, points)
    return field, corner


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


def _lighting(rng: np.random.Generator, plan: Plan) -> tuple[Float64[np.ndarray, "l 16"], Float64[np.ndarray, 3]]:
    """Lamps, windows, and at times the sun through one of them; at least one light, some rooms dim and warm, some bright."""
    day = len(plan.windows) > 0 and rng.random() < 0.75
    warm = np.array([1.0, rng.uniform(0.75, 0.95), rng.uniform(0.5, 0.85)])
    cool = np.array([rng.uniform(0.85, 1.0), rng.uniform(0.93, 1.0), 1.0])
    rows = []
    if day:
        for window in plan.windows[:2]:
            place = np.array(window.middle) + 0.12 * np.array(window.facing)
            area = 4 * np.hypot(*window.half_width[:2]) * window.half_height
            power = rng.uniform(1.0, 3.0) * np.sqrt(area)
            rows.append(_light(kernels.WINDOW, place, cool * power, window))
        if rng.random() < 0.45:
            window = plan.windows[0]
            aside = np.array([-window.facing[1], window.facing[0], 0.0]) * rng.uniform(-1, 1)
            way = np.array(window.facing) + aside + (0, 0, -rng.uniform(0.25, 0.9))
            row = _light(
                kernels.SUN, np.array(window.middle), np.array([1.0, 0.93, 0.82]) * rng.uniform(1.0, 3.0), window
            )
            row[7:10] = way / np.linalg.norm(way)
            rows.append(row)
    if not day or rng.random() < 0.5:
        x, y, z = plan.size
        spots = 1 + int(rng.random() < 0.3 and len(rows) < 2)
        for _ in range(spots):
            place = np.array([rng.uniform(-0.25, 0.25) * x, rng.uniform(-0.25, 0.25) * y, z - rng.uniform(0.15, 0.6)])
            rows.append(_light(kernels.LAMP, place, warm * rng.uniform(1.0, 4.0) / spots, None))
    ambient = rng.uniform(0.25, 0.8) * (0.5 * warm + 0.5 * cool if day else warm)
    return np.array(rows), ambient


def _light(kind: int, place: np.ndarray, colour: np.ndarray, window) -> Float64[np.ndarray, 16]:
    row = np.zeros(kernels.LIGHT_WIDTH)
    row[0] = kind
    row[1:4], row[4:7] = place, colour
    if window is not None:
        row[7:10], row[10:13], row[13] = window.facing, window.half_width, window.half_height
    return row

"""Random rooms as triangles, materials and lights, ready for ray casting.

Light comes through the windows, from the sun through one of them, and from lamps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from semgs.data.raycast import Raycaster
from semgs_rooms.assets.asset_images import Pack
from semgs_rooms.assets.asset_library import Library
from semgs_rooms.drawing import shading_kernels as kernels
from semgs_rooms.pieces import shell_kernels
from semgs_rooms.pieces import texture_kernels as t
from semgs_rooms.pieces.solids import SHELL, ShellTriangles, Solids, gather, place_shells, triangulate
from semgs_rooms.plans.floor_plan import WALL, FloorPlan, Lamp, Opening
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

MOST = 8
"""Maximum number of lights; each costs one ray per pixel."""
SHARES = {1: 4, 2: 2}
"""Lights per window, by the number of windows; one if there are more."""


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


def draw_lights(
    rng: np.random.Generator, plan: FloorPlan
) -> tuple[Float64[np.ndarray, "l 16"], Float64[np.ndarray, " 3"]]:
    """Lights for the shading kernels, at least one, and the ambient light (linear RGB).

    A window has up to four lights spread over it, for soft shadows. Sometimes the sun shines through one window.
    """
    warm = np.array([1.0, rng.uniform(0.75, 0.95), rng.uniform(0.5, 0.85)])
    cool = np.array([rng.uniform(0.85, 1.0), rng.uniform(0.93, 1.0), 1.0])
    windows = sorted(plan.windows, key=lambda window: -window.light * window.half_height)[:3]
    day = sum(window.light for window in windows)
    lamps = plan.lamps or (() if day > 0.15 else (Lamp((0.0, 0.0, plan.size[2] - 0.15), rng.uniform(1.0, 3.0)),))
    rows = []
    shares = SHARES.get(len(windows), 1)
    gain = rng.uniform(1.2, 3.0)
    for window in windows:
        area = 4 * np.hypot(*window.half_width[:2]) * window.half_height
        for place in _spread(window, shares):
            rows.append(_light(kernels.WINDOW, place, cool * (gain * window.light * np.sqrt(area) / shares), window))
    if windows and windows[0].light > 0.3 and rng.random() < 0.45:
        rows.append(_sun(rng, windows[0]))
    for lamp in lamps[: MOST - len(rows)]:
        rows.append(_light(kernels.LAMP, np.array(lamp.place), warm * lamp.power / np.sqrt(len(lamps)), None))
    lamplight = sum(lamp.power for lamp in lamps)
    tone = (cool * day + warm * 0.5 * lamplight) / max(day + 0.5 * lamplight, 1e-6)
    ambient = rng.uniform(0.18, 0.5) * min(1.0, 0.35 + 0.6 * day + 0.25 * lamplight) * tone
    return np.array(rows), ambient


def _spread(window: Opening, count: int) -> list[Float64[np.ndarray, " 3"]]:
    """Positions 12 cm in front of a window: at its centre, two side by side, or four."""
    middle = np.array(window.middle) + 0.12 * np.array(window.facing)
    across, up = np.array(window.half_width) / 2, np.array([0.0, 0.0, window.half_height / 2])
    if count == 1:
        return [middle]
    if count == 2:
        return [middle - across, middle + across]
    return [middle + a * across + b * up for a in (-1, 1) for b in (-1, 1)]


def _sun(rng: np.random.Generator, window: Opening) -> Float64[np.ndarray, " 16"]:
    """The sun through a window."""
    aside = np.array([-window.facing[1], window.facing[0], 0.0]) * rng.uniform(-1, 1)
    way = np.array(window.facing) + aside + (0, 0, -rng.uniform(0.25, 0.9))
    strength = rng.uniform(1.0, 3.0) * min(1.0, window.light)
    row = _light(kernels.SUN, np.array(window.middle), np.array([1.0, 0.93, 0.82]) * strength, window)
    row[7:10] = way / np.linalg.norm(way)
    return row


def _light(kind: int, place: np.ndarray, colour: np.ndarray, window: Opening | None) -> Float64[np.ndarray, " 16"]:
    row = np.zeros(kernels.LIGHT_WIDTH)
    row[0] = kind
    row[1:4], row[4:7] = place, colour
    if window is not None:
        row[7:10], row[10:13], row[13] = window.facing, window.half_width, window.half_height
    return row

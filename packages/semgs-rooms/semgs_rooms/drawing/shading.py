"""Render a room: colours, and exact labels and depths at pixel centres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int, UInt8, UInt16

from semgs.data.tables.classes import IGNORE
from semgs_rooms.drawing import light_kernels
from semgs_rooms.drawing import shading_kernels as kernels
from semgs_rooms.drawing.room import Room

EDGE_RAYS = ((-0.27, 0.11), (0.19, 0.31), (0.12, -0.29))
"""Offsets of the additional rays of edge pixels from the pixel's centre [px]."""


@dataclass(frozen=True)
class RoomCamera:
    """A pinhole camera: its intrinsics [px] and the (height, width) of its images [px]."""

    intrinsics: Float64[np.ndarray, "3 3"]
    size: tuple[int, int]


@dataclass(frozen=True)
class RenderedFrame:
    """What a camera sees.

    Attributes:
        radiance: linear RGB, before camera effects.
        labels: class at each pixel's centre, 255 = ignore.
        depths: z-depth at each pixel's centre [m].
    """

    radiance: Float32[np.ndarray, "h w 3"]
    labels: UInt8[np.ndarray, "h w"]
    depths: Float32[np.ndarray, "h w"]


@dataclass(frozen=True)
class Hits:
    """Where rays from one place end, as `shading_kernels.locate` computes it."""

    directions: Float64[np.ndarray, "n 3"]
    triangles: Int[np.ndarray, " n"]
    depths: Float64[np.ndarray, " n"]
    places: Float64[np.ndarray, "n 3"]
    normals: Float64[np.ndarray, "n 3"]
    feet: Float64[np.ndarray, " n"]
    uv: Float64[np.ndarray, "n 3"]


def pixel_directions(
    world_from_camera: Float64[np.ndarray, "4 4"],
    intrinsics: Float64[np.ndarray, "3 3"],
    pixels: Float64[np.ndarray, "n 2"],
) -> Float64[np.ndarray, "n 3"]:
    """Directions in world axes, scaled to camera z = 1, through image positions (x, y) [px]."""
    rays = np.column_stack((pixels, np.ones(len(pixels))))
    return rays @ (world_from_camera[:3, :3] @ np.linalg.inv(intrinsics)).T


def centres(size: tuple[int, int]) -> Float64[np.ndarray, "n 2"]:
    """(x, y) of all pixel centres, row by row [px]."""
    height, width = size
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.column_stack((columns.ravel(), rows.ravel()))


def look(
    room: Room, world_from_camera: Float64[np.ndarray, "4 4"], directions: Float64[np.ndarray, "n 3"]
) -> tuple[Int[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
    """Labels and z-depths along directions with camera z = 1; 255 and 0 where nothing is hit."""
    origin = np.broadcast_to(world_from_camera[:3, 3], directions.shape)
    triangles, _ = room.caster.cast(origin, directions)
    planes = room.planes[triangles]
    depths = (planes[:, 3] - planes[:, :3] @ world_from_camera[:3, 3]) / (planes[:, :3] * directions).sum(-1)
    labels = room.solids.labels[room.owners[triangles]]
    return np.where(triangles < 0, IGNORE, labels), np.where(triangles < 0, 0.0, depths)


def things(room: Room, world_from_camera: Float64[np.ndarray, "4 4"], camera: RoomCamera) -> UInt16[np.ndarray, "h w"]:
    """The number of the piece of furniture at each pixel's centre, from 1; 0 for the room itself."""
    directions = pixel_directions(world_from_camera, camera.intrinsics, centres(camera.size))
    triangles, _ = room.caster.cast(np.broadcast_to(world_from_camera[:3, 3], directions.shape), directions)
    piece = np.zeros(len(room.plan.parts) + 1, np.uint16)
    for number, (first, end) in enumerate(room.plan.pieces if room.plan.instances is None else room.plan.instances, 1):
        piece[first:end] = number
    return piece[np.where(triangles < 0, -1, room.owners[triangles])].reshape(camera.size)


def photograph(room: Room, world_from_camera: Float64[np.ndarray, "4 4"], camera: RoomCamera) -> RenderedFrame:
    """Render one frame. Labels and depths are those at pixel centres; colours of edge pixels are the mean of four rays."""
    intrinsics, size = camera.intrinsics, camera.size
    pixels, width = centres(size), size[1]
    spread = 1 / np.sqrt(intrinsics[0, 0] * intrinsics[1, 1])
    seen = _meet(room, world_from_camera[:3, 3], pixel_directions(world_from_camera, intrinsics, pixels), spread)
    strengths, light = _light(room, seen, width)
    colours = _shade(room, seen, strengths, light)
    owners = _parts_of(room, seen)
    edges = _edge_pixels(room, seen, size)
    if len(edges):
        total = colours[edges]
        for shift in EDGE_RAYS:
            directions = pixel_directions(world_from_camera, intrinsics, pixels[edges] + shift)
            beside = _meet(room, world_from_camera[:3, 3], directions, spread)
            parts = _parts_of(room, beside)
            borrowed = np.empty((len(edges), light.shape[1]))
            light_kernels.borrow(edges, parts, owners, width, light, borrowed)
            total = total + _shade(room, beside, _strengths(room, beside, width), borrowed)
        colours[edges] = total / (1 + len(EDGE_RAYS))
    labels = np.where(seen.triangles < 0, IGNORE, room.solids.labels[room.owners[seen.triangles]])
    return RenderedFrame(
        colours.reshape(*size, 3).astype(np.float32),
        labels.reshape(size).astype(np.uint8),
        seen.depths.reshape(size).astype(np.float32),
    )


def _parts_of(room: Room, hits: Hits) -> Int[np.ndarray, " n"]:
    """The part that each ray hits, -1 for none."""
    return np.where(hits.triangles < 0, -1, room.owners[hits.triangles])


def _edge_pixels(room: Room, seen: Hits, size: tuple[int, int]) -> Int[np.ndarray, " e"]:
    """Indices of the pixels on a border between parts, or on a depth edge within a shell."""
    jumps = _jumps(seen.depths.reshape(size), (seen.triangles >= room.shells.first).reshape(size))
    return np.flatnonzero(_edges(_parts_of(room, seen).reshape(size)) | jumps)


def _edges(owners: Int[np.ndarray, "h w"]) -> np.ndarray:
    """Pixels whose part differs from that of a neighbour, boolean [h w]."""
    return _both_sides(owners[:, 1:] != owners[:, :-1], owners[1:] != owners[:-1])


def _jumps(depths: Float64[np.ndarray, "h w"], shells: np.ndarray) -> np.ndarray:
    """Pixels of shells whose depth differs by more than 4 % from that of a neighbour, boolean [h w]."""
    with np.errstate(divide="ignore"):
        log = np.log(depths)
    with np.errstate(invalid="ignore"):
        across, down = np.abs(np.diff(log, axis=1)) > 0.04, np.abs(np.diff(log, axis=0)) > 0.04
    return _both_sides(across, down) & shells


def _both_sides(across: np.ndarray, down: np.ndarray) -> np.ndarray:
    """Pixels on either side of a border to the right [h w-1] or below [h-1 w], boolean [h w]."""
    sides = np.zeros((across.shape[0], down.shape[1]), bool)
    sides[:, 1:] |= across
    sides[:, :-1] |= across
    sides[1:] |= down
    sides[:-1] |= down
    return sides


def _meet(room: Room, origin: Float64[np.ndarray, " 3"], directions: Float64[np.ndarray, "n 3"], spread: float) -> Hits:
    """First hits from a place along directions with camera z = 1; `spread` is a pixel's width at depth 1."""
    origins = np.empty_like(directions)
    origins[:] = origin
    triangles, _ = room.caster.cast(origins, directions)
    count, solids, shells = len(directions), room.solids, room.shells
    depths, feet = np.empty(count), np.empty(count)
    places, normals, uv = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros((count, 3))
    kernels.locate(
        triangles, origins, directions, spread, room.planes, room.owners, solids.rotations, solids.centres, solids.sizes,
        solids.shapes, shells.first, shells.corners, shells.normals, shells.uv, shells.density, depths, places, normals, feet, uv,
    )  # fmt: skip
    return Hits(directions, triangles, depths, places, normals, feet, uv)


def _light(room: Room, hits: Hits, width: int) -> tuple[Float64[np.ndarray, "l n"], Float64[np.ndarray, "n c"]]:
    """Unshadowed strength of each light, and, smoothed over neighbours on the same surface, indirect light (RGB) followed by the
    visible share of each light. Casts one ray per light and pixel, and four for indirect light."""
    count, lights = len(hits.triangles), len(room.lights)
    light = np.zeros((count, 3 + lights))
    light[:, :3] = _round_about(room, hits, width)
    origins, ways = np.empty((count, 3)), np.empty((count, 3))
    strengths = np.empty((lights, count))
    for number, row in enumerate(room.lights):
        kernels.towards_light(row, hits.triangles, hits.places, hits.normals, width, origins, ways, strengths[number])
        lit = np.flatnonzero(strengths[number])
        light[lit, 3 + number] = room.caster.reached(origins[lit], ways[lit], 1.0)
    smoothed = np.empty_like(light)
    light_kernels.smooth(light, hits.triangles, hits.normals, hits.places, hits.depths, width, smoothed)
    return strengths, smoothed


def _round_about(room: Room, hits: Hits, width: int) -> Float64[np.ndarray, "n 3"]:
    """Indirect light at each pixel, from four rays."""
    count = len(hits.triangles)
    round_about, origins, ways = np.zeros((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    for tap in range(light_kernels.TAPS):
        light_kernels.near_rays(hits.triangles, hits.directions, hits.places, room.planes, width, tap, origins, ways)
        near, distances = room.caster.cast(origins, ways, np.ones(count))
        light_kernels.bring_back(near, distances, room.owners, room.glow, room.ambient, round_about)
    return round_about


def _strengths(room: Room, hits: Hits, width: int) -> Float64[np.ndarray, "l n"]:
    """Unshadowed strength of each light."""
    strengths = np.empty((len(room.lights), len(hits.triangles)))
    origins, ways = np.empty_like(hits.places), np.empty_like(hits.places)
    for number, row in enumerate(room.lights):
        kernels.towards_light(row, hits.triangles, hits.places, hits.normals, width, origins, ways, strengths[number])
    return strengths


def _shade(
    room: Room, hits: Hits, strengths: Float64[np.ndarray, "l n"], light: Float64[np.ndarray, "n c"]
) -> Float64[np.ndarray, "n 3"]:
    """Linear RGB radiance."""
    solids, pack = room.solids, room.pictures
    colours = np.empty((len(hits.triangles), 3))
    kernels.shade(
        hits.triangles, hits.directions, hits.places, hits.normals, hits.feet, hits.uv, room.owners, solids.rotations,
        solids.centres, solids.sizes, solids.materials, room.shifts, pack.pixels, pack.table, room.lights, strengths,
        np.ascontiguousarray(light[:, :3]), np.ascontiguousarray(light[:, 3:]), colours,
    )  # fmt: skip
    return colours

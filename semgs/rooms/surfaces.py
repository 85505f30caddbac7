"""What surfaces are like without light: their colours, as the textures have them and as means, and which way they face."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int

from semgs.rooms import shading_kernels as kernels
from semgs.rooms import texture_kernels as t
from semgs.rooms.furniture import LABEL
from semgs.rooms.room import Room
from semgs.rooms.shading import EDGE_RAYS, Hits, centres, edge_pixels, locate, meet, parts_of, pixel_directions
from semgs.rooms.solids import BALL, BOX, CYLINDER, SHELL, triangulate


@dataclass(frozen=True)
class Surfaces:
    """What a camera would see if everything were lit alike; of pixels on an edge the mean of four rays.

    Attributes:
        colours: of what light falls on; a mirror has those of what it shows.
        means: the same with every triangle in its mean colour.
        shine: radiance of what shines by itself.
        normals: towards the camera, shorter than 1 on edges.
    """

    colours: Float64[np.ndarray, "h w 3"]
    means: Float64[np.ndarray, "h w 3"]
    shine: Float64[np.ndarray, "h w 3"]
    normals: Float64[np.ndarray, "h w 3"]


def survey(
    room: Room,
    seen: Hits,
    means: Float64[np.ndarray, "t 3"],
    world_from_camera: Float64[np.ndarray, "4 4"],
    intrinsics: Float64[np.ndarray, "3 3"],
    size: tuple[int, int],
) -> Surfaces:
    """The surfaces that pixels show.

    Args:
        room: what is seen.
        seen: what the rays through the pixels' centres meet.
        means: the mean colour of every triangle (`mean_colours`).
        world_from_camera: pose, OpenCV axes.
        intrinsics: pinhole.
        size: (height, width) [px].
    """
    spread = 1 / np.sqrt(intrinsics[0, 0] * intrinsics[1, 1])
    values = _values(room, seen, means, world_from_camera[:3, 3], spread)
    edges = edge_pixels(room, seen, size)
    if len(edges):
        pixels, total = centres(size)[edges], values[edges]
        for shift in EDGE_RAYS:
            directions = pixel_directions(world_from_camera, intrinsics, pixels + shift)
            beside = meet(room, world_from_camera[:3, 3], directions, spread)
            total = total + _values(room, beside, means, world_from_camera[:3, 3], spread)
        values[edges] = total / (1 + len(EDGE_RAYS))
    return Surfaces(*np.moveaxis(values.reshape(*size, 4, 3), 2, 0))


def _values(
    room: Room, hits: Hits, means: Float64[np.ndarray, "t 3"], origin: Float64[np.ndarray, " 3"], spread: float
) -> Float64[np.ndarray, "n 4 3"]:
    """The four fields of `Surfaces`, for each ray."""
    parts = parts_of(room, hits)
    mirror = np.flatnonzero((parts >= 0) & is_mirror(room)[parts])
    colours, normals = _painted(room, parts, hits), hits.normals.copy()
    mean = np.where((parts >= 0)[:, None], means[hits.triangles], 0.0)
    if len(mirror):
        shown = _reflected(room, hits, mirror, origin, spread)
        parts = parts.copy()
        parts[mirror] = parts_of(room, shown)
        colours[mirror], normals[mirror] = _painted(room, parts[mirror], shown), shown.normals
        mean[mirror] = np.where((parts[mirror] >= 0)[:, None], means[shown.triangles], 0.0)
    emission = np.where(parts >= 0, room.solids.materials[parts, t.EMISSION], 0.0)[:, None]
    lit = emission == 0
    return np.stack((lit * colours, lit * mean, emission * colours, normals), axis=1)


def _reflected(
    room: Room, hits: Hits, which: Int[np.ndarray, " m"], origin: Float64[np.ndarray, " 3"], spread: float
) -> Hits:
    """What rays meet that a mirror turned back; they come from behind the mirror, as far off as the camera is before it."""
    places, normals, ways = hits.places[which], hits.normals[which], hits.directions[which]
    turned = ways - 2 * (ways * normals).sum(-1, keepdims=True) * normals
    triangles, _ = room.caster.cast(places + 1e-3 * normals, turned)
    behind = places - (hits.depths[which][:, None]) * turned
    return locate(room, triangles, behind, turned, spread)


def _painted(room: Room, parts: Int[np.ndarray, " n"], hits: Hits) -> Float64[np.ndarray, "n 3"]:
    """Linear RGB of the materials where rays end, 0 where they meet nothing."""
    solids, pack = room.solids, room.pictures
    colours = np.empty((len(parts), 3))
    kernels.paint(
        parts, hits.directions, hits.places, hits.normals, hits.feet, hits.uv, solids.rotations, solids.centres, solids.sizes,
        solids.materials, room.shifts, pack.pixels, pack.table, colours,
    )  # fmt: skip
    return colours


def mean_colours(room: Room) -> Float64[np.ndarray, "t 3"]:
    """The colour of each triangle, textures seen from so far that a pixel would cover it; 0 of what shines by itself."""
    corners, normals, shells = triangles_of(room), room.planes[:, :3], room.shells
    # A pixel as wide as a square of twice the area.
    feet = np.sqrt(np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1))
    uv = np.zeros((len(corners), 3))
    uv[shells.first :, :2] = shells.uv.mean(axis=1)
    uv[shells.first :, 2] = feet[shells.first :] * shells.density
    middles = Hits(-normals, np.arange(len(corners)), np.ones(len(corners)), corners.mean(axis=1), normals, feet, uv)
    colours = _painted(room, room.owners, middles)
    colours[room.solids.materials[room.owners, t.EMISSION] > 0] = 0.0
    return colours


def triangles_of(room: Room) -> Float64[np.ndarray, "t 3 3"]:
    """Corners of all triangles [m]."""
    return np.concatenate((triangulate(room.solids)[0], room.shells.corners))


def normals_of(room: Room, corners: Float64[np.ndarray, "t 3 3"]) -> Float64[np.ndarray, "t 3 3"]:
    """Unit normals at the corners of all triangles, outwards, smooth where the surface is round."""
    solids, owners = room.solids, room.owners
    turns, sizes, shapes = solids.rotations[owners], solids.sizes[owners], solids.shapes[owners]
    flat = room.planes[:, :3]
    outwards = np.sign((flat * (corners.mean(axis=1) - solids.centres[owners])).sum(-1))
    flat = np.where(outwards < 0, -1.0, 1.0)[:, None] * flat
    local = np.einsum("tji,tcj->tci", turns, corners - solids.centres[owners][:, None]) * (2 / sizes[:, None])
    along = np.abs((flat * turns[:, :, 2]).sum(-1))
    power = np.where(shapes == BALL, 1, np.where(shapes == CYLINDER, 1, 3))[:, None, None]
    gradient = np.sign(local) * np.abs(local) ** power * (2 / sizes[:, None])
    gradient[shapes == CYLINDER, :, 2] = 0.0
    normals = np.einsum("tij,tcj->tci", turns, gradient)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    plain = (shapes == BOX) | (shapes == SHELL) | ((shapes == CYLINDER) & (along >= 0.9))
    normals[plain] = flat[plain][:, None]
    own = np.linalg.norm(room.shells.normals, axis=-1, keepdims=True)
    first = room.shells.first
    normals[first:] = np.where(own > 0.5, room.shells.normals / np.maximum(own, 0.5), normals[first:])
    return normals


def is_mirror(room: Room) -> Bool[np.ndarray, " p"]:
    """Which parts show the room."""
    return room.solids.materials[:, t.MIRROR] > 0


def is_pane(room: Room) -> Bool[np.ndarray, " p"]:
    """Which parts are panes of windows."""
    return (room.solids.materials[:, t.EMISSION] > 0) & (room.solids.labels == LABEL["window"])

"""Pictures of a room by path tracing: Mitsuba's light, our textures, Intel's denoiser."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from semgs.data.classes import IGNORE
from semgs.rooms.denoiser import denoise
from semgs.rooms.mitsuba_scene import SAMPLES, Tracer
from semgs.rooms.room import Room
from semgs.rooms.shading import Frame, ambience, centres, meet, parts_of, pixel_directions
from semgs.rooms.surfaces import mean_colours, survey

BEYOND = 0.35
"""How much of the room's ambient light stands for the paths that are longer than those that are followed."""


def trace(
    room: Room,
    poses: Sequence[Float64[np.ndarray, "4 4"]],
    intrinsics: Float64[np.ndarray, "3 3"],
    size: tuple[int, int],
    seeds: Sequence[int],
    samples: int = SAMPLES,
) -> list[Frame]:
    means = mean_colours(room)
    tracer = Tracer(room, means)
    spread = 1 / np.sqrt(intrinsics[0, 0] * intrinsics[1, 1])
    frames = []
    for pose, seed in zip(poses, seeds, strict=True):
        seen = meet(room, pose[:3, 3], pixel_directions(pose, intrinsics, centres(size)), spread)
        surfaces = survey(room, seen, means, pose, intrinsics, size)
        light = tracer.light(pose, intrinsics, size, seed, samples)
        with np.errstate(divide="ignore", invalid="ignore"):
            detail = np.where(surfaces.means > 0, surfaces.colours / surfaces.means, 0.0)
        beyond = BEYOND * ambience(room, seen, size[1]).reshape(*size, 3)
        radiance = (
            denoise(light * detail + beyond * surfaces.colours, surfaces.colours, surfaces.normals) + surfaces.shine
        )
        parts = parts_of(room, seen)
        labels = np.where(parts < 0, IGNORE, room.solids.labels[parts])
        frames.append(
            Frame(
                radiance.astype(np.float32),
                labels.reshape(size).astype(np.uint8),
                seen.depths.reshape(size).astype(np.float32),
            )
        )
    return frames

"""Pictures of a room by path tracing: Mitsuba's light on our textures, without its noise.

    picture = denoised(light x textures / flat colours + what is left of the ambient light) + what shines by itself

Mitsuba draws the room with every triangle in one colour (`mitsuba_scene`): a diffuse surface sends back light in proportion
to its colour, so the quotient puts the texture in place exactly. Labels and depths are those of `shading`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from semgs.rooms import denoiser, mitsuba_scene
from semgs.rooms.denoiser import denoise
from semgs.rooms.mitsuba_scene import SAMPLES, Tracer
from semgs.rooms.room import Room
from semgs.rooms.shading import Frame, ambience, centres, frame, meet, pixel_directions
from semgs.rooms.surfaces import mean_colours, survey

BEYOND = 0.12
"""How much of the room's ambient light stands for the paths that are longer than those that are followed: as much as they bring
in the median of 20 homes."""


def trace(
    room: Room,
    poses: Sequence[Float64[np.ndarray, "4 4"]],
    intrinsics: Float64[np.ndarray, "3 3"],
    size: tuple[int, int],
    seeds: Sequence[int],
    samples: int = SAMPLES,
) -> list[Frame]:
    """Frames of one camera; labels and depths have the bits of `shading.photograph`.

    Args:
        room: what is to be seen.
        poses: world_from_camera, OpenCV axes.
        intrinsics: pinhole; fx and fy may differ.
        size: (height, width) [px].
        seeds: of each frame's paths.
        samples: paths a pixel.

    Raises:
        ImportError: mitsuba or pyoidn is not installed; names the extra that brings them.
    """
    means = mean_colours(room)
    tracer = Tracer(room, means)
    spread = 1 / np.sqrt(intrinsics[0, 0] * intrinsics[1, 1])
    frames = []
    for pose, seed in zip(poses, seeds, strict=True):
        seen = meet(room, pose[:3, 3], pixel_directions(pose, intrinsics, centres(size)), spread)
        surfaces = survey(room, seen, means, pose, intrinsics, size)
        light = tracer.light(pose, intrinsics, size, seed, samples)
        detail = np.divide(surfaces.colours, surfaces.means, out=np.zeros((*size, 3)), where=surfaces.means > 0)
        left = BEYOND * ambience(room, seen, size[1]).reshape(*size, 3)
        noisy = light * detail + left * surfaces.colours + surfaces.shine
        smooth = denoise(noisy, surfaces.colours + np.minimum(surfaces.shine, 1.0), surfaces.normals)
        radiance = np.where(surfaces.colours.any(axis=-1, keepdims=True), smooth, surfaces.shine)
        frames.append(frame(room, seen, radiance.reshape(-1, 3), size))
    return frames


def check_installed() -> None:
    """Raise where tracing cannot work.

    Raises:
        ImportError: mitsuba or pyoidn is not installed; names the extra that brings them.
    """
    mitsuba_scene.library()
    denoiser.device()

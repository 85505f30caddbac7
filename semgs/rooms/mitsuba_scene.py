"""A room as Mitsuba sees it: its triangles in flat colours, its windows, sun and lamps as light sources.

Mitsuba gives the light, not the textures: every triangle has the mean colour of its material, and `traced` paints the picture.
"""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64

from semgs.rooms import shading_kernels as kernels
from semgs.rooms.lighting import window_lights
from semgs.rooms.plans import Opening
from semgs.rooms.room import Room
from semgs.rooms.surfaces import is_mirror, is_pane, normals_of, triangles_of
from semgs.rooms.texture_kernels import GLOSS

SAMPLES = 6
"""Paths a pixel; two more cost a fifth of the time and bring the denoised picture half a decibel nearer to the converged one."""
DEPTH = 4
"""Rays of a path, from the camera to the light: two bounces."""
BLOCK = 32
"""Side of the squares that are drawn one after the other [px]; given, because Mitsuba would choose by its threads."""
SHEEN = ((0.05, 1.0, 0.0), (0.2, 0.55, 0.3), (0.4, 0.45, 0.4), (1.0, 0.35, 0.5))
"""Materials up to a gloss have that roughness and strength of highlights, as `principled` counts them; 0 has none."""
FRAME, CURTAINS = 0.02, 0.2
"""Before the middle of an opening: where the frame of its window ends, and where curtains do [m]."""
BEHIND = 0.08
"""Behind it, no pane is left [m]."""
LAMP = 0.25
"""Radius of a lamp [m]."""
OVERHEAD = 0.35
"""A lamp with something that near above it shines downwards only [m]: a patch of ceiling that is much brighter than the room is
found by few paths, and the picture gets spots."""
NEAR, FAR = 0.01, 100.0
"""What the camera sees lies between these depths [m]."""
REFLECTED = 0.9
"""Share of the light that a mirror sends back."""


class Tracer:
    """Light in one room.

    Args:
        room: what is to be seen.
        colours: linear RGB of each of its triangles.

    Raises:
        ImportError: mitsuba is not installed; names the extra that brings it.
    """

    def __init__(self, room: Room, colours: Float64[np.ndarray, "t 3"]) -> None:
        mi = library()
        self._integrator = mi.load_dict(
            {"type": "volpath", "max_depth": DEPTH, "rr_depth": 2, "hide_emitters": True, "block_size": BLOCK}
        )
        self._scene = mi.load_dict({"type": "scene", **_meshes(mi, room, colours), **_lights(mi, room)})

    def light(
        self,
        world_from_camera: Float64[np.ndarray, "4 4"],
        intrinsics: Float64[np.ndarray, "3 3"],
        size: tuple[int, int],
        seed: int,
        samples: int = SAMPLES,
    ) -> Float32[np.ndarray, "h w 3"]:
        """Noisy linear RGB of the room in flat colours, each pixel the mean over its square; what shines by itself is black.

        Args:
            world_from_camera: pose, OpenCV axes.
            intrinsics: pinhole.
            size: (height, width) [px].
            seed: of the paths.
            samples: paths a pixel.
        """
        sensor = _sensor(world_from_camera, intrinsics, size, samples)
        seen = self._integrator.render(self._scene, sensor, seed, samples)
        return np.array(seen, dtype=np.float32).reshape(*size, 3)


@cache
def library() -> ModuleType:
    """Mitsuba, drawing on the calling thread alone.

    Raises:
        ImportError: mitsuba is not installed.
    """
    try:
        import drjit
        import mitsuba
    except ImportError as error:
        raise ImportError(
            "tracing rooms needs mitsuba, which is not installed; pip install '.[rooms]' in SemGS's folder"
        ) from error
    mitsuba.set_variant("scalar_rgb")
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    drjit.set_thread_count(1)
    return mitsuba


def _sensor(
    world_from_camera: Float64[np.ndarray, "4 4"],
    intrinsics: Float64[np.ndarray, "3 3"],
    size: tuple[int, int],
    samples: int,
) -> Any:
    """A pinhole camera whose film holds the image's rows one behind the other.

    Mitsuba's pixels are square. So every row is a camera of its own, with the row's place for its principal point and fx for
    both focal lengths: pixel centres are exact, and a sample lies within fy / fx of a pixel's height. Mitsuba's cameras look
    along z, with x to the left and y up.
    """
    mi = library()
    height, width = size
    (fx, _, cx), (_, fy, cy), _ = intrinsics
    pose = mi.ScalarTransform4f(world_from_camera @ np.diag([-1.0, -1.0, 1.0, 1.0]))
    rows = {
        f"row_{row:05d}": {
            "type": "perspective",
            "fov_axis": "x",
            "fov": float(np.degrees(2 * np.arctan(width / 2 / fx))),
            "principal_point_offset_x": float(0.5 - cx / width),
            "principal_point_offset_y": float((row + 0.5 - cy) * fx / fy),
            "near_clip": NEAR,
            "far_clip": FAR,
            "to_world": pose,
            "film": {"type": "hdrfilm", "width": width, "height": 1},
        }
        for row in range(height)
    }
    film = {
        "type": "hdrfilm",
        "width": height * width,
        "height": 1,
        "pixel_format": "rgb",
        "component_format": "float32",
        "rfilter": {"type": "box"},
    }
    sampler = {"type": "multijitter", "sample_count": samples}
    return mi.load_dict({"type": "batch", **rows, "film": film, "sampler": sampler})


def _meshes(mi: ModuleType, room: Room, colours: Float64[np.ndarray, "t 3"]) -> dict[str, Any]:
    """The room's triangles, those of one roughness together; panes of windows are left out, so that the sun finds its way."""
    gloss = room.solids.materials[room.owners, GLOSS]
    mirror, pane = is_mirror(room)[room.owners], is_pane(room)[room.owners]
    corners = triangles_of(room)
    normals = normals_of(room, corners)
    result: dict[str, Any] = {}
    lowest = -1.0
    for number, (highest, roughness, strength) in enumerate(SHEEN):
        which = (gloss > lowest) & (gloss <= highest) & ~mirror & ~pane
        lowest = highest
        tint = {"type": "mesh_attribute", "name": "face_color"}
        bsdf: dict[str, Any] = {"type": "diffuse", "reflectance": tint}
        if strength > 0:
            bsdf = {"type": "principled", "base_color": tint, "roughness": roughness, "specular": strength}
        if which.any():
            result[f"mesh_{number}"] = _mesh(mi, bsdf, corners[which], normals[which], colours[which])
    if mirror.any():
        bsdf = {"type": "conductor", "specular_reflectance": {"type": "rgb", "value": REFLECTED}}
        result["mirrors"] = _mesh(mi, bsdf, corners[mirror], normals[mirror], colours[mirror])
    return result


def _mesh(
    mi: ModuleType,
    bsdf: dict[str, Any],
    corners: Float64[np.ndarray, "t 3 3"],
    normals: Float64[np.ndarray, "t 3 3"],
    colours: Float64[np.ndarray, "t 3"],
) -> Any:
    """Triangles with a normal at each corner and a colour each, seen from both sides."""
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": bsdf})
    mesh = mi.Mesh("mesh", 3 * len(corners), len(corners), has_vertex_normals=True, props=properties)
    mesh.add_attribute("face_color", 3, colours.astype(np.float32).ravel())
    values = mi.traverse(mesh)
    values["vertex_positions"] = corners.astype(np.float32).ravel()
    values["vertex_normals"] = normals.astype(np.float32).ravel()
    values["faces"] = np.arange(3 * len(corners), dtype=np.uint32)
    values.update()
    return mesh


def _lights(mi: ModuleType, room: Room) -> dict[str, Any]:
    """The room's lights as sources that give as much at a distance. Light passes through the sources themselves, and the camera
    does not see them."""
    result: dict[str, Any] = {}
    windows = window_lights(room.plan, room.lights)
    for number, row in enumerate(room.lights):
        flux, place = np.pi * row[4:7], row[1:4]
        if row[0] == kernels.LAMP:
            if room.caster.reached(place[None], np.array([[0.0, 0.0, OVERHEAD]]), 1.0)[0]:
                source = {"type": "sphere", "center": [float(x) for x in place], "radius": LAMP}
                result[f"lamp_{number}"] = _shining(source, flux, np.pi * LAMP**2, 4)
            else:
                pose = np.diag([LAMP, -LAMP, -1.0, 1.0])
                pose[:3, 3] = place
                source = {"type": "disk", "to_world": mi.ScalarTransform4f(pose)}
                result[f"lamp_{number}"] = _shining(source, 2 * flux, np.pi * LAMP**2, 1)
        elif row[0] == kernels.SUN:
            area = 4 * np.hypot(row[10], row[11]) * row[13]
            if _open(room, row):
                result[f"sun_{number}"] = {
                    "type": "directional",
                    "direction": [float(x) for x in row[7:10]],
                    "irradiance": _rgb(flux),
                    "sampling_weight": float(flux.mean() * area),
                }
    for number, (window, colour) in enumerate(windows):
        area = 4 * np.hypot(*window.half_width[:2]) * window.half_height
        pose = np.eye(4)
        pose[:3, 0] = -np.array(window.half_width)
        pose[2, 1] = window.half_height
        pose[:3, 2] = window.facing
        pose[:3, 3] = np.array(window.middle) + _before(room, window) * np.array(window.facing)
        source = {"type": "rectangle", "to_world": mi.ScalarTransform4f(pose)}
        result[f"window_{number}"] = _shining(source, np.pi * colour, area, 1)
    return result


def _shining(source: dict[str, Any], intensity: Float64[np.ndarray, " 3"], area: float, sides: int) -> dict[str, Any]:
    """A shape that light passes through and that shines with an intensity where it shows this area; `sides` is how many times
    that area its surface is."""
    return {
        **source,
        "bsdf": {"type": "null"},
        "emitter": {
            "type": "area",
            "radiance": _rgb(intensity / area),
            "sampling_weight": float(sides * np.pi * intensity.mean()),
        },
    }


def _grid(
    middle: Float64[np.ndarray, " 3"], half_width: Float64[np.ndarray, " 3"], half_height: float
) -> Float64[np.ndarray, "25 3"]:
    """Places over a window."""
    shares = np.linspace(-0.8, 0.8, 5)
    across, up = np.meshgrid(shares, shares)
    return middle + across.reshape(-1, 1) * half_width + up.reshape(-1, 1) * np.array([0.0, 0.0, half_height])


def _open(room: Room, sun: Float64[np.ndarray, " 16"]) -> bool:
    """Whether the sun finds a hole in the wall behind its window."""
    places = _grid(sun[1:4], sun[10:13], sun[13]) - BEHIND * np.array([-sun[11], sun[10], 0.0]) / np.hypot(
        sun[10], sun[11]
    )
    return bool(room.caster.reached(places, np.broadcast_to(-sun[7:10], places.shape)).mean() > 0.5)


def _before(room: Room, window: Opening) -> float:
    """How far before the middle of a window its light is [m]: in its frame, or before the curtains that are drawn over it."""
    facing = np.array(window.facing)
    places = _grid(np.array(window.middle) + FRAME * facing, np.array(window.half_width), window.half_height)
    ways = np.broadcast_to(CURTAINS * facing, places.shape)
    return FRAME if room.caster.reached(places, ways, 1.0).mean() > 0.5 else CURTAINS


def _rgb(colour: Float64[np.ndarray, " 3"]) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(c) for c in colour]}

"""The scene of a room's page: the viewer's page with each class in ten steps of confidence, and the numbers that a click needs."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
from jaxtyping import UInt8

from semgs.export.scene_objects import place_things
from semgs.robotics.objects import Objects
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import UpDirection
from semgs.viewer.nodes import add_boxes, add_splats, set_first_camera
from semgs.viewer.server import serving
from semgs.viewer.splat_groups import Group, Mode, SceneSplats
from semgs.viewer.viewer_cameras import input_views

MOST_GAUSSIANS = 80_000
"""More would make the page slow on phones."""

STEPS = 10
"""Of confidence. Viewers hide Gaussians by group, so each step is a group."""

RADIUS = 1.5
"""A Gaussian can be clicked at this many standard deviations of its longest axis, at least."""


@dataclass(frozen=True)
class RoomScene:
    """The page with the scene in 3D, and its classes.

    Attributes:
        html: the page.
        groups: the classes, the most frequent first.
        shown: Gaussians in the page.
    """

    html: str
    groups: tuple[Group, ...]
    shown: int


def room_scene(
    scene: SavedScene, photos: Sequence[UInt8[np.ndarray, "h w 3"]], up: UpDirection, things: Objects | None
) -> RoomScene:
    """The page of a scene in 3D, which a page around it controls by messages.

    Its tree has /colour/C/S and /classes/C/S for class C and step S of confidence, and the boxes of things.

    Args:
        scene: the scene.
        photos: of its input views, or none.
        up: the direction that is up in it.
        things: with boxes, if there are any.

    Raises:
        ImportError: viser is not installed.
    """
    instances = None if things is None else things.instances
    splats = SceneSplats.of(scene, 0.0, MOST_GAUSSIANS, instances)
    views = input_views(scene, splats.scale, photos)
    steps = np.clip((STEPS * splats.confidences).astype(int), 0, STEPS - 1)
    modes: tuple[Mode, ...] = ("colour",) if scene.classes is None else ("colour", "classes")
    with serving() as server:
        set_first_camera(server, views[0], up)
        for mode in modes:
            whole = splats.splats(mode)
            server.scene.add_frame(f"/{mode}", show_axes=False, visible=mode == "colour")
            for number, group in enumerate(splats.groups):
                server.scene.add_frame(f"/{mode}/{number}", show_axes=False)
                for step in np.unique(steps[group.members]).tolist():
                    members = group.members[steps[group.members] == step]
                    add_splats(server, f"/{mode}/{number}/{step}", whole.of(members))
        if things is not None:
            server.scene.add_frame("/things", show_axes=False, visible=False)
            add_boxes(server, place_things(things), splats.scale)
        page = server.scene.as_html(dark_mode=True)
    shown = np.concatenate([group.members for group in splats.groups]) if splats.groups else np.zeros(0, np.int64)
    data = {
        "scale": splats.scale,
        "origin": list(scene.origin),
        "modes": list(modes),
        "steps": {number: np.unique(steps[group.members]).tolist() for number, group in enumerate(splats.groups)},
        "views": [{"position": view.position, "lookAt": view.look_at, "fov": view.fov} for view in views],
        "arrays": _arrays(splats, shown),
    }
    script = files("semgs.app").joinpath("web/scene.js").read_text(encoding="utf-8")
    inside = f'<style>{SCENE_STYLE}</style><script type="application/json" id="semgs">{_json(data)}</script><script>{script}</script>'
    page = page.replace("<title>Viser</title>", "<title>The room in 3D</title>", 1)
    return RoomScene(page.replace("<body>", f"<body>{inside}", 1), splats.groups, len(shown))


SCENE_STYLE = (
    "svg.marks{position:fixed;inset:0;width:100%;height:100%;pointer-events:none;z-index:5}"
    ".mantine-Notifications-root,.mantine-ActionIcon-root{display:none!important}"
)
"""Marks of clicks; what viser shows itself, a tree of groups and a warning, is hidden, because the page around it has a legend."""


def _json(data: Any) -> str:
    """JSON that can be put into a script element."""
    return json.dumps(data).replace("<", "\\u003c")


def _arrays(splats: SceneSplats, shown: np.ndarray) -> dict[str, str]:
    """What a click needs of each shown Gaussian, in base64: position and radius in the viewer's units, opacity and confidence (0..255), class, thing."""
    gaussians = splats.scene.gaussians
    labels = np.zeros(len(splats.labels), np.uint8)
    for number, group in enumerate(splats.groups):
        labels[group.members] = number
    shape = gaussians.semantic or gaussians.colour
    instances = splats.instances if splats.instances is not None else np.zeros(len(labels), np.int64)
    arrays = {
        "means": (splats.scale * gaussians.means.numpy()).astype("<f4"),
        "radii": (RADIUS * splats.scale * shape.scales.numpy().max(-1)).astype("<f4"),
        "opacities": np.rint(255 * gaussians.opacities.numpy()).astype(np.uint8),
        "confidences": np.rint(255 * splats.confidences.clip(0, 1)).astype(np.uint8),
        "labels": labels,
        "things": instances.astype("<u2"),
    }
    return {name: base64.b64encode(array[shown].tobytes()).decode() for name, array in arrays.items()}

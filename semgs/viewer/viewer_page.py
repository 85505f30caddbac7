"""A scene as one offline page: viser's client with the scene in it, and scripts that move the camera and choose what is shown."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from typing import Any

import numpy as np
from jaxtyping import Int64, UInt8

from semgs.export.scene_objects import place_things
from semgs.files.text import percent, printable
from semgs.robotics.objects import Objects
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import Up, UpDirection, up_of
from semgs.viewer import panel_texts as texts
from semgs.viewer.nodes import add_boxes, add_input_views, add_splats, set_first_camera, view_data
from semgs.viewer.server import serving
from semgs.viewer.splat_groups import Group, Mode, SceneSplats
from semgs.viewer.viewer_cameras import input_views

MOST_GAUSSIANS = 153_600
"""Those of two views at 240x320 with one for each pixel. In colour and in classes, they take less than 12 MB."""

TITLE = "<title>Viser</title>"


@dataclass(frozen=True)
class ScenePage:
    """A page with a scene in 3D.

    Attributes:
        html: the page.
        groups: the classes, the most frequent first.
        shown: Gaussians in the page.
        decimals: digits after the point of positions.
    """

    html: str
    groups: tuple[Group, ...]
    shown: int
    decimals: int = 2


def scene_page(
    scene: SavedScene,
    photos: Sequence[UInt8[np.ndarray, "h w 3"]] = (),
    *,
    up: Up | UpDirection = "auto",
    min_confidence: float = 0.0,
    at_most: int = MOST_GAUSSIANS,
    things: Objects | None = None,
    near_photos: bool = True,
    script: str | None = None,
) -> ScenePage:
    """A page that shows a scene without a network, a server or Python.

    Its tree has /colour/C/S and, hidden at first, /classes/C/S for class C and step S of confidence, the input views and the boxes of things.

    Args:
        scene: the scene.
        photos: of its input views, or none.
        up: the direction that is up in the scene.
        min_confidence: Gaussians whose likeliest class is less likely are unknown.
        at_most: Gaussians of the page: those that cover most pixels of the input views.
        things: to show with their boxes.
        near_photos: whether the camera stays where the photos saw, until the user frees it.
        script: controls the page instead of its own panel; it calls `semgs.load`.

    Raises:
        ImportError: viser is not installed.
    """
    splats = SceneSplats.of(scene, min_confidence, at_most, None if things is None else things.instances)
    views = input_views(scene, splats.scale, photos)
    steps = splats.steps  # the page hides Gaussians by group, so each step of each class is a group
    parts = [
        [(step, group.members[steps[group.members] == step]) for step in np.unique(steps[group.members]).tolist()]
        for group in splats.groups
    ]
    modes: tuple[Mode, ...] = ("colour",) if scene.classes is None else ("colour", "classes")
    with serving() as server:
        set_first_camera(server, views[0], up_of(scene, up))
        for mode in modes:
            whole = splats.splats(mode)
            server.scene.add_frame(f"/{mode}", show_axes=False, visible=mode == "colour")
            for number, of_group in enumerate(parts):
                server.scene.add_frame(f"/{mode}/{number}", show_axes=False)
                for step, members in of_group:
                    add_splats(server, f"/{mode}/{number}/{step}", whole.of(members))
        add_input_views(server, views)
        if things is not None:
            server.scene.add_frame("/things", show_axes=False, visible=script is None)
            add_boxes(server, place_things(things), splats.scale)
        page = server.scene.as_html(dark_mode=True)
    order = [members for of_group in parts for _, members in of_group]
    data = {
        "title": printable(scene.source),
        "near": near_photos,
        "metric": scene.unit == "metric",
        "scale": splats.scale,
        "decimals": splats.decimals,
        "origin": list(scene.origin),
        "views": view_data(views),
        "modes": modes,
        "classes": [_legend_entry(group) for group in splats.groups] if scene.classes else [],
        "steps": [[step for step, _ in of_group] for of_group in parts],
        **_per_gaussian(splats, np.concatenate(order) if order else np.zeros(0, np.int64)),
        "boxes": things is not None,
        "controls": [vars(one) for one in texts.controls_of(modes, things=things is not None, on_page=True)],
        "words": texts.WORDS,
        "modeNames": texts.MODES,
        "names": {} if things is None else texts.thing_names(things),
    }
    page = page.replace(TITLE, f"<title>{escape(printable(scene.source))}</title>", 1)
    page = page.replace("<body>", f"<body>{_inside(data, script or web_text('panel.js'))}", 1)
    return ScenePage(page, splats.groups, sum(map(len, order)), splats.decimals)


def web_text(name: str) -> str:
    """A script or style sheet of this package."""
    return files("semgs.viewer").joinpath(f"web/{name}").read_text(encoding="utf-8")


def _inside(data: Any, script: str) -> str:
    """What is added to viser's page."""
    scripts = "".join(f"<script>{text}</script>" for text in (web_text("camera.js"), web_text("scene.js")))
    numbers = json.dumps(data).replace("<", "\\u003c")  # so that no name ends the element
    return (
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{web_text("panel.css")}</style>{scripts}'
        f'<script type="application/json" id="semgs">{numbers}</script><script>{script}</script>'
    )


def _legend_entry(group: Group) -> dict[str, Any]:
    """A class as the legend shows it."""
    return {"name": printable(group.name), "colour": list(group.colour), "share": percent(group.share)}


def _per_gaussian(splats: SceneSplats, order: Int64[np.ndarray, " n"]) -> dict[str, str]:
    """What a click needs beside the splats, of each Gaussian in this order, in base64: confidence (0..255), thing."""
    arrays = {"confidences": np.rint(255 * splats.confidences.clip(0, 1)).astype(np.uint8)}
    if splats.instances is not None:
        arrays["things"] = splats.instances.astype("<u4")
    return {name: base64.b64encode(array[order].tobytes()).decode() for name, array in arrays.items()}

"""A scene as one offline page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np
from jaxtyping import UInt8

from semgs.export.scene_objects import place_things
from semgs.files.text import printable
from semgs.robotics.objects import Objects
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import Up, UpDirection, up_of
from semgs.viewer.nodes import add_boxes, add_input_views, add_splats, node_name, set_first_camera
from semgs.viewer.server import serving
from semgs.viewer.splat_groups import Mode, SceneSplats
from semgs.viewer.viewer_cameras import input_views

MOST_GAUSSIANS = 100_000
"""With this many Gaussians in colour and in classes, a page has less than 10 MB."""

TITLE = "<title>Viser</title>"

HINT = (
    '<div style="position: fixed; left: 1em; bottom: 1em; z-index: 1; pointer-events: none; color: #ddd; background: #222b; '
    'padding: 0.2em 0.6em; font: 0.8em sans-serif">Drag to turn, right-drag to move, scroll to zoom. The button at the top right '
    "opens the tree of classes: show and hide them, in colour or as classes.</div>"
)
"""Pages have no panel that could explain them."""


def scene_page(
    scene: SavedScene,
    photos: Sequence[UInt8[np.ndarray, "h w 3"]] = (),
    *,
    up: Up | UpDirection = "auto",
    min_confidence: float = 0.0,
    at_most: int = MOST_GAUSSIANS,
    things: Objects | None = None,
) -> str:
    """A page that shows a scene without a network, a server or Python.

    Its tree has the group "colour" and, hidden at first, the group "classes", with a node for each class, and the input views.

    Args:
        scene: the scene.
        photos: of its input views, or none.
        up: the direction that is up in the scene.
        min_confidence: Gaussians whose likeliest class is less likely are unknown.
        at_most: Gaussians of the page: the most opaque ones.
        things: to show with their boxes, in a group "things".

    Raises:
        ImportError: viser is not installed.
    """
    splats = SceneSplats.of(scene, min_confidence, at_most)
    views = input_views(scene, splats.scale, photos)
    modes: tuple[Mode, ...] = ("colour",) if scene.classes is None else ("colour", "classes")
    with serving() as server:
        set_first_camera(server, views[0], up_of(scene, up))
        for mode in modes:
            whole = splats.splats(mode)
            server.scene.add_frame(f"/{mode}", show_axes=False, visible=mode == "colour")
            for group in splats.groups:
                add_splats(server, f"/{mode}/{node_name(group.name)}", whole.of(group.members))
        add_input_views(server, views)
        if things is not None:
            server.scene.add_frame("/things", show_axes=False)
            add_boxes(server, place_things(things), splats.scale)
        page = server.scene.as_html(dark_mode=True)
    page = page.replace(TITLE, f"<title>{escape(printable(scene.source))}</title>", 1)
    return page.replace("<body>", f"<body>{HINT}", 1)

"""A scene as one offline page."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from semgs.export.upright import UpDirection
from semgs.files.text import printable
from semgs.viewer.nodes import add_input_views, add_splats, node_name, set_first_camera
from semgs.viewer.server import serving
from semgs.viewer.splats import Mode, SceneSplats
from semgs.viewer.views import InputView

MOST_GAUSSIANS = 100_000
"""With this many Gaussians in colour and in classes, a page has less than 10 MB."""

TITLE = "<title>Viser</title>"


def viewer_page(splats: SceneSplats, views: Sequence[InputView], up: UpDirection, title: str) -> str:
    """A page that shows a scene without a network, a server or Python.

    Its tree has the group "colour" and, hidden at first, the group "classes", with a node for each class, and the input views.

    Args:
        splats: the scene.
        views: its input views.
        up: the direction that is up.
        title: of the page.

    Raises:
        ImportError: viser is not installed.
    """
    modes: tuple[Mode, ...] = ("colour",) if splats.scene.classes is None else ("colour", "classes")
    with serving() as server:
        set_first_camera(server, views[0], up)
        for mode in modes:
            whole = splats.splats(mode)
            server.scene.add_frame(f"/{mode}", show_axes=False, visible=mode == "colour")
            for group in splats.groups:
                add_splats(server, f"/{mode}/{node_name(group.name)}", whole.of(group.members))
        add_input_views(server, views)
        page = server.scene.as_html(dark_mode=True)
    return page.replace(TITLE, f"<title>{escape(printable(title))}</title>", 1)

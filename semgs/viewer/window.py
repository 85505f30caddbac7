"""The interactive viewer: a panel of controls, and what they do."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import torch
from jaxtyping import UInt8

from semgs.export.scene_objects import place_things
from semgs.export.stills import Stills
from semgs.figures.class_images import overlay
from semgs.figures.view_images import as_bytes, depth_bar, depth_ticks
from semgs.files.images.colours import heat_picture
from semgs.files.text import length, printable
from semgs.geometry.cameras import Cameras
from semgs.rendering.rendering import label_maps
from semgs.robotics.objects import Objects
from semgs.scene.confidence import part_of
from semgs.scene.scene_file import SavedScene
from semgs.scene.upright import Up, UpDirection, up_of
from semgs.viewer import panel_texts as texts
from semgs.viewer.access import Access
from semgs.viewer.nodes import add_boxes, add_input_views, add_splats, node_name, set_first_camera, view_data
from semgs.viewer.panel_texts import Control
from semgs.viewer.pick import pick
from semgs.viewer.server import ANY_PORT, LOOPBACK, run_script, serving, url_of
from semgs.viewer.splat_groups import STEPS, Mode, SceneSplats
from semgs.viewer.viewer_cameras import InputView, camera_seen_from, input_views, pixel_of
from semgs.viewer.viewer_page import web_text

if TYPE_CHECKING:
    from semgs.viewer.server import (
        ClientHandle,
        GuiCheckboxHandle,
        SceneClickEvent,
        SceneNodePointerEvent,
        ViserServer,
    )

RENDER_HEIGHT = 480
"""Height of images rendered from the viewer's camera [px]."""

MOST_ASPECT = 8.0
"""Widest image rendered from there: a browser says how wide its window is."""

RENDER_WIDTH = 420
"""Width of the panel with that image [px]."""

STEP_PERCENT = 100 // STEPS
"""Of confidence."""


@contextmanager
def open_window(
    scene: SavedScene,
    photos: Sequence[UInt8[np.ndarray, "h w 3"]] = (),
    *,
    up: Up | UpDirection = "auto",
    min_confidence: float = 0.0,
    at_most: int | None = None,
    things: Objects | None = None,
    near_photos: bool = True,
    host: str = LOOPBACK,
    port: int = ANY_PORT,
    access: Access | None = None,
) -> Iterator[Window]:
    """A viewer of a scene, until the block ends.

    Args:
        scene: the scene.
        photos: of its input views, or none.
        up: the direction that is up in the scene.
        min_confidence: Gaussians and pixels whose likeliest class is less likely are unknown.
        at_most: Gaussians in the viewer: those that cover most pixels of the input views. None is all.
        things: to show with their boxes.
        near_photos: whether cameras stay where the photos saw, until a user frees them.
        host, port, access: as for `serving`.

    Raises:
        ImportError: viser is not installed.
        InputError: it is not possible to listen on this address.
    """
    splats = SceneSplats.of(scene, min_confidence, at_most, None if things is None else things.instances)
    with serving(host, port, access) as server:
        views = input_views(scene, splats.scale, photos)
        window = Window(server, splats, views, up_of(scene, up), min_confidence, things, near_photos)
        if access is not None and access.token is not None:
            window.url += f"/?token={access.token}"
        yield window


class Window:
    """The content of a viewer. Browsers that are connected at the same time share it, cameras excepted.

    Attributes:
        url: to open in a browser.
        up: the direction that is up.
    """

    def __init__(
        self,
        server: ViserServer,
        splats: SceneSplats,
        views: Sequence[InputView],
        up: UpDirection,
        min_confidence: float,
        things: Objects | None = None,
        near_photos: bool = True,
    ) -> None:
        self._server, self._splats, self._views, self._min_confidence = server, splats, views, min_confidence
        self._metric = splats.scene.unit == "metric"
        self._lock = threading.Lock()  # viser calls from many threads
        self._mode: Mode = "colour"
        self._tint = 0.0
        self._least = 0  # step of confidence
        self._near_photos = near_photos
        run_script(server, web_text("camera.js"))  # before the splats, for which it prepares viser's client
        self.url, self.up = url_of(server), up
        server.gui.set_panel_label(printable(splats.scene.source))
        set_first_camera(server, views[0], up)
        whole = splats.splats("colour")
        self._nodes = {
            group.name: add_splats(server, f"/gaussians/{node_name(group.name)}", whole.of(group.members))
            for group in splats.groups
        }
        self._things = {} if things is None else texts.thing_names(things)
        self._things_nodes = [] if things is None else add_boxes(server, place_things(things), splats.scale)
        self._add_panel()
        server.scene.on_click()(self._describe_click)
        for number, frustum in enumerate(add_input_views(server, views)):
            frustum.on_click(partial(self._fly_to_clicked, number))
        run_script(server, f"semgs.start({json.dumps({'views': view_data(views), 'near': near_photos})})")

    def _add_panel(self) -> None:
        """Add all controls, in the order that pages have, too."""
        gui = self._server.gui
        gui.add_html(texts.hint())
        self._boxes: dict[str, GuiCheckboxHandle] = {}
        add = {
            "show": self._add_modes, "overlay": self._add_overlay, "back": self._add_way_back, "photo": self._add_flights,
            "near": self._add_near, "photos": self._add_photos, "boxes": self._add_things, "classes": self._add_legend,
            "confidence": self._add_confidence, "clicked": self._add_clicked, "render": self._add_render,
        }  # fmt: skip
        for control in texts.controls_of(self._splats.modes, things=bool(self._things_nodes), on_page=False):
            add[control.key](control)
        self._rendered = gui.add_panel(visible=False)
        self._rendered.float(x=15, y=-15, width=RENDER_WIDTH)
        with self._rendered.add_tab("Rendered"):
            self._picture = gui.add_image(np.zeros((1, 1, 3), np.uint8))

    def _add_modes(self, control: Control) -> None:
        """Add the choice of what splats show, and the scale of its colours."""
        gui, limits = self._server.gui, self._splats.depth_limits
        names = [texts.MODES[mode] for mode in self._splats.modes]
        self._mode_control = gui.add_dropdown(control.name, names, hint=control.help)
        self._mode_control.on_update(lambda _: self._show_mode())
        self._scales = {
            "depth": gui.add_html(
                texts.scale_bar(
                    depth_bar()[0],
                    [length(tick, self._metric) for tick in depth_ticks(limits, 3)],
                    "depth in the input view",
                ),
                visible=False,
            ),
            "confidence": gui.add_html(
                texts.scale_bar(
                    heat_picture(np.linspace(0, 1, 256)[None], (0.0, 1.0))[0],
                    ("0 %", "50 %", "100 %"),
                    "probability of the class" if self._splats.scene.classes else "probability of the depth",
                ),
                visible=False,
            ),
        }

    def _add_overlay(self, control: Control) -> None:
        """Add the strength of the class colours over the photos' colours."""
        self._tint_control = self._server.gui.add_slider(control.name, 0.0, 1.0, 0.05, 0.0, hint=control.help)
        self._tint_control.on_update(lambda _: self._show_mode())

    def _add_way_back(self, control: Control) -> None:
        """Add the way back to the nearest photo."""
        back = self._server.gui.add_button(control.name, hint=control.help)
        back.on_click(lambda event: self._tell(event.client, "semgs.goBack()"))

    def _add_flights(self, control: Control) -> None:
        """Add a button for each photo."""
        names = [f"{control.name} {number + 1}" for number in range(len(self._views))]
        flights = self._server.gui.add_button_group("", names, hint=control.help)
        flights.on_click(lambda event: self._fly(event.client, names.index(event.target.value)))

    def _add_near(self, control: Control) -> None:
        """Add the bounds of the camera."""
        near = self._server.gui.add_checkbox(control.name, self._near_photos, hint=control.help)
        near.on_update(lambda event: self._tell_all("stayNear", event.target.value))

    def _add_photos(self, control: Control) -> None:
        """Add the choice whether photos are there."""
        photos = self._server.gui.add_checkbox(control.name, True, hint=control.help)
        photos.on_update(lambda event: self._tell_all("showPhotos", event.target.value))

    def _add_things(self, control: Control) -> None:
        """Add the choice whether boxes of things are there."""
        self._things_control = self._server.gui.add_checkbox(control.name, True, hint=control.help)
        self._things_control.on_update(self._toggle_things)

    def _add_legend(self, control: Control) -> None:
        """Add a checkbox in its colour for each class."""
        gui, groups = self._server.gui, self._splats.groups
        show, hide = texts.WORDS["show_all"], texts.WORDS["hide_all"]
        with gui.add_folder(control.name):
            every = gui.add_button_group("", (show, hide))
            every.on_click(lambda event: self._toggle_all_classes(event.target.value == show))
            for group in groups:
                box = gui.add_checkbox(texts.legend_label(group), True, hint=control.help)
                self._boxes[group.name] = box
                box.on_update(partial(self._toggle_class, group.name))
            style = [(self._boxes[group.name]._impl.uuid, group.colour) for group in groups]
            gui.add_html(texts.legend_style(style))

    def _add_confidence(self, control: Control) -> None:
        """Add the least confidence."""
        self._least_control = self._server.gui.add_slider(
            control.name, 0, 100 - STEP_PERCENT, STEP_PERCENT, 0, hint=control.help
        )
        self._least_control.on_update(lambda _: self._show_mode())

    def _add_clicked(self, control: Control) -> None:
        """Add what a click met."""
        with self._server.gui.add_folder(control.name):
            self._click_text = self._server.gui.add_html(texts.paragraph(texts.WORDS["click"]))

    def _add_render(self, control: Control) -> None:
        """Add our own renderer."""
        button = self._server.gui.add_button(control.name, hint=control.help)
        button.on_click(lambda event: self._render(event.client))

    def _toggle_class(self, name: str, event: object) -> None:
        """Show or hide a class, as its checkbox says."""
        self._nodes[name].visible = self._boxes[name].value

    def _toggle_all_classes(self, visible: bool) -> None:
        """Show or hide all classes."""
        for name, box in self._boxes.items():
            box.value = visible  # type: ignore[misc]  # mypy does not see its setter
            self._nodes[name].visible = visible

    def _toggle_things(self, event: object) -> None:
        """Show or hide the boxes of things, as their checkbox says."""
        for node in self._things_nodes:
            node.visible = self._things_control.value

    def _show_mode(self) -> None:
        """Replace the splats by those that the panel says. While a slider moves, steps in between are left out."""
        with self._lock:
            classes = self._splats.scene.classes is not None
            mode = next(one for one, name in texts.MODES.items() if name == self._mode_control.value)
            tint = self._tint_control.value if classes else 0.0
            least = self._least_control.value // STEP_PERCENT if classes else 0
            if (mode, tint, least) == (self._mode, self._tint, self._least):
                return
            self._mode, self._tint, self._least = mode, tint, least
            whole = self._splats.splats(mode, tint, least)
            with self._server.atomic():
                if classes:
                    self._tint_control.visible = mode == "colour"
                for name, scale in self._scales.items():
                    scale.visible = name == mode
                for group in self._splats.groups:
                    part = whole.of(group.members)
                    self._nodes[group.name].set_gaussians(part.centres, part.covariances, part.colours, part.opacities)

    def _describe_click(self, event: SceneClickEvent) -> None:
        """Say what is under a click, and mark it."""
        seen = event.client.camera
        size = (seen.image_height, seen.image_width)
        with self._lock:
            scene, scale = self._splats.scene, self._splats.scale
            camera = camera_seen_from(seen.wxyz, np.array(event.ray_origin), seen.fov, size, scale)
            pixel = pixel_of(np.array(event.ray_direction), camera)
            hit = pick(scene, camera, pixel, self._find_visible(), self._min_confidence, self._splats.instances)
            self._click_text.content = texts.hit_text(hit, self._metric, self._things, self._splats.decimals)
            if hit is None:
                self._server.scene.remove_by_name("/clicked")
                return
            at = scale * (np.array(hit.position) - np.array(scene.origin))
            self._server.scene.add_label("/clicked", texts.hit_label(hit), position=at, anchor="bottom-center")

    def _find_visible(self) -> np.ndarray:
        """The Gaussians that are shown."""
        return self._splats.visible([name for name, box in self._boxes.items() if not box.value], self._least)

    def _fly_to_clicked(self, number: int, event: SceneNodePointerEvent) -> None:
        """Fly to an input view."""
        self._fly(event.client, number)

    def _fly(self, client: ClientHandle | None, number: int) -> None:
        """Move a browser's camera to an input view."""
        self._tell(client, f"semgs.fly({number})")

    def _tell(self, client: ClientHandle | None, script: str) -> None:
        """Run a script in a browser."""
        if client is not None:
            run_script(client, script)

    def _tell_all(self, name: str, value: bool) -> None:
        """Call a function of the page in every browser."""
        run_script(self._server, f"semgs.{name}({json.dumps(value)})", name)

    def _render(self, client: ClientHandle | None) -> None:
        """Render what a browser's camera sees."""
        if client is None:
            return
        seen = client.camera
        aspect = min(seen.image_width / max(seen.image_height, 1), MOST_ASPECT)
        size = (RENDER_HEIGHT, max(1, round(RENDER_HEIGHT * aspect)))
        with self._lock:
            camera = camera_seen_from(seen.wxyz, seen.position, seen.fov, size, self._splats.scale)
            self._picture.image = self._render_image(camera)
            self._rendered.visible = True

    def _render_image(self, camera: Cameras) -> UInt8[np.ndarray, "h w 3"]:
        """The shown classes from a camera, in the mode of the panel."""
        scene = part_of(self._splats.scene, torch.from_numpy(self._find_visible()))
        cameras = camera.arranged(lambda array: array[None])
        if self._mode == "colour" and self._tint > 0 and scene.classes is not None:
            rendering = scene.render(cameras, footprint=True)
            labels = label_maps(rendering, self._min_confidence)[0]
            return overlay(as_bytes(rendering.images[0]), labels, scene.classes, self._tint)
        content = self._mode
        if content == "things":  # a property of Gaussians, which is not rendered
            content = "classes"
        elif content == "confidence" and scene.classes is None:  # that of depth, which is one, too
            content = "colour"
        return next(Stills(scene, (content,), self._min_confidence).images(cameras))[0]

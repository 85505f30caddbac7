"""Scenes in viser: splats, input views, boxes of things and the first camera."""

from __future__ import annotations

from collections.abc import Sequence
from math import tan
from typing import TYPE_CHECKING, Any

import numpy as np

from semgs.export.scene_objects import PlacedThing
from semgs.files.text import printable
from semgs.robotics.boxes import EDGES, SIGNS
from semgs.scene.upright import UpDirection
from semgs.viewer.splat_groups import SplatArrays, thing_colours
from semgs.viewer.viewer_cameras import InputView

if TYPE_CHECKING:
    from semgs.viewer.server import (
        CameraFrustumHandle,
        GaussianSplatHandle,
        LabelHandle,
        LineSegmentsHandle,
        ViserServer,
    )

FRUSTUM_DEPTH = 0.5
"""Distance from the centre of an input view to its photo [the viewer's units]."""

FRUSTUM_COLOUR = (255, 196, 0)


def add_splats(server: ViserServer, name: str, splats: SplatArrays) -> GaussianSplatHandle:
    """Add a group of splats."""
    return server.scene.add_gaussian_splats(
        name,
        centers=splats.centres,
        covariances=splats.covariances,
        rgbs=splats.colours,
        opacities=splats.opacities,
    )


def add_input_views(server: ViserServer, views: Sequence[InputView]) -> list[CameraFrustumHandle]:
    """Add the input views with their photos, hidden: the script in the browser shows those that are not in the way."""
    return [
        server.scene.add_camera_frustum(
            view_node(index, view),
            fov=view.fov,
            aspect=view.aspect,
            # viser's frusta of the same scale have the same volume.
            scale=FRUSTUM_DEPTH * (tan(view.fov / 2) ** 2 * view.aspect / 3) ** (1 / 3),
            color=FRUSTUM_COLOUR,
            thickness=0.01,
            image=view.photo,
            wxyz=view.wxyz,
            position=view.position,
            visible=False,
        )
        for index, view in enumerate(views)
    ]


def add_boxes(
    server: ViserServer, boxes: Sequence[PlacedThing], scale: float, visible: bool = True
) -> list[LineSegmentsHandle | LabelHandle]:
    """Add the box of each thing, in its colour, with a label.

    Args:
        server: the server.
        boxes: in the scene's frame.
        scale: the viewer's units per unit of the scene.
        visible: whether to show them at first.
    """
    nodes: list[LineSegmentsHandle | LabelHandle] = []
    for one in boxes:
        name = f"{one.thing.name} {one.thing.instance}"
        red, green, blue = thing_colours(np.array([one.thing.instance]))[0].tolist()
        corners = (scale * one.corners).astype(np.float32)
        path = f"/things/{node_name(name)}"
        nodes.append(
            server.scene.add_line_segments(
                path, corners[np.array(EDGES)], (red, green, blue), thickness=0.03, visible=visible
            )
        )
        top = corners[SIGNS[:, 2] > 0].mean(0)
        nodes.append(
            server.scene.add_label(
                f"{path}/label", printable(name), position=top, visible=visible, anchor="bottom-center"
            )
        )
    return nodes


def set_first_camera(server: ViserServer, view: InputView, up: UpDirection) -> None:
    """Show the scene upright, at first from an input view."""
    direction = up.direction.numpy()
    server.scene.set_up_direction(direction)
    camera = server.initial_camera
    camera.position = view.position
    camera.look_at = view.look_at
    camera.up = direction
    camera.fov = view.fov


def view_data(views: Sequence[InputView]) -> list[dict[str, Any]]:
    """Input views as the script in the browser takes them."""
    return [
        {
            "name": printable(view.name),
            "position": view.position,
            "lookAt": view.look_at,
            "fov": view.fov,
            "aspect": view.aspect,
            "node": view_node(index, view),
        }
        for index, view in enumerate(views)
    ]


def view_node(index: int, view: InputView) -> str:
    """The node of an input view."""
    return f"/input views/{index + 1} {node_name(view.name)}"


def node_name(name: str) -> str:
    """A name as one node of viser's scene tree, where slashes separate levels."""
    return name.replace("/", "-")

"""A scene for MuJoCo (https://mujoco.readthedocs.io/en/stable/XMLreference.html): scene.xml and its meshes.

Lengths are metres and z is up. Each thing is a body with its class and number in its name, such as chair_4. The meshes are for looks only. Contact is by simple shapes: a plane for the
floor, the box or the convex hull of each thing, and upright boxes of `CELL` for walls and all else. All of it stands still.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import ConvexHull, QhullError

from semgs.export.mesh_files import MeshPart
from semgs.export.scene_objects import PlacedThing, prim_names
from semgs.mesh.labelled import LabelledMesh
from semgs.robotics.occupancy import FLOOR

FOLDER, FILE, ASSETS = "mujoco", "scene.xml", "assets"
"""Where it is written."""

Contact = Literal["box", "hull"]
"""The shape of a thing for contact."""

CELL = 0.1
"""Side of the cells that walls are made of [m]."""

CLEAR = 0.1
"""What is lower above the floor is the floor [m]."""

THINNEST = 0.01
"""No side of a box is shorter [m]."""


def save_mjcf(
    folder: Path, parts: Sequence[MeshPart], things: Sequence[PlacedThing], floor: float, contact: Contact
) -> None:
    """Write scene.xml and the folder assets.

    Args:
        folder: of the files; it exists.
        parts: the mesh, with z up, split by thing and class [m].
        things: in the same frame.
        floor: its height [m].
        contact: what things are for contact; one that is flat stays a box.

    Raises:
        OSError: they cannot be written.
    """
    (folder / ASSETS).mkdir()
    root = ElementTree.Element("mujoco", model="room")
    ElementTree.SubElement(root, "compiler", meshdir=ASSETS)
    ElementTree.SubElement(root, "option", gravity="0 0 -9.81")
    assets, world = ElementTree.SubElement(root, "asset"), ElementTree.SubElement(root, "worldbody")

    def add_mesh(
        body: ElementTree.Element, name: str, vertices: np.ndarray, faces: np.ndarray, colour: str | None
    ) -> None:
        """Add a mesh to a body: for looks if it has a colour, else for contact. MuJoCo refuses meshes of fewer than four vertices."""
        if len(vertices) < 4:
            return
        lines = [*(f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in vertices), *(f"f {a} {b} {c}" for a, b, c in faces + 1)]
        (folder / ASSETS / f"{name}.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
        ElementTree.SubElement(assets, "mesh", name=name, file=f"{name}.obj", inertia="shell" if colour else "convex")
        look = {"rgba": colour, "contype": "0", "conaffinity": "0", "group": "2"} if colour else {"group": "3"}
        ElementTree.SubElement(body, "geom", {"type": "mesh", "mesh": name, **look})

    def add_box(body: ElementTree.Element, centre: np.ndarray, size: np.ndarray) -> None:
        half = np.maximum(size, THINNEST) / 2
        ElementTree.SubElement(body, "geom", type="box", pos=_text(centre), size=_text(half), group="3")

    ElementTree.SubElement(world, "geom", name=FLOOR, type="plane", pos=_text([0, 0, floor]), size="0 0 1", group="3")
    room = ElementTree.SubElement(world, "body", name="room")
    shown = {part.thing.instance: part.mesh for part in parts if part.thing is not None}
    names = prim_names([f"{one.thing.name} {one.thing.instance}" for one in things])
    for name, one in zip(names, things, strict=True):
        body = ElementTree.SubElement(world, "body", name=name, pos=_text(one.centre), quat=_text(one.quaternion))
        hull = None
        if (mesh := shown.get(one.thing.instance)) is not None:
            vertices = (mesh.vertices - one.centre) @ one.axes
            add_mesh(body, name, vertices, mesh.faces, _colour(mesh))
            hull = _hull(vertices) if contact == "hull" else None
        if hull is None:
            add_box(body, np.zeros(3), np.array(one.thing.box.size))
        else:
            add_mesh(body, f"{name}_hull", *hull, None)
    for part in parts:
        if part.thing is None:
            add_mesh(room, part.name, part.mesh.vertices, part.mesh.faces, _colour(part.mesh))
    rest = [one.mesh.vertices for one in parts if one.thing is None and one.label != FLOOR]
    for low, high in posts(np.concatenate([np.zeros((0, 3)), *rest]), floor):
        add_box(room, (low + high) / 2, high - low)
    ElementTree.indent(root)
    (folder / FILE).write_bytes(ElementTree.tostring(root) + b"\n")


def posts(vertices: Float64[np.ndarray, "n 3"], floor: float) -> Float64[np.ndarray, "b 2 3"]:
    """Boxes around vertices, each with its lowest and its highest corner: cells of `CELL` above the floor, of which those above one another are one, and then those
    side by side that are equally high. What begins less than a cell above the `CLEAR` height stands on the floor.

    Args:
        vertices: with z up [m].
        floor: its height [m].
    """
    cells = np.floor((vertices - (0, 0, floor + CLEAR)) / CELL).astype(np.int64)
    low = np.unique(cells[cells[:, 2] >= 0], axis=0)
    boxes = np.concatenate((low, low + 1), 1)
    for axis in (2, 0):
        boxes = _joined(boxes, axis)
    corners = boxes.reshape(-1, 2, 3) * CELL + (0, 0, floor + CLEAR)
    corners[boxes[:, 2] == 0, 0, 2] = floor
    return corners


def _joined(boxes: Int64[np.ndarray, "b 6"], axis: int) -> Int64[np.ndarray, "c 6"]:
    """Boxes of whole cells, of which those that touch along an axis, and are equal along the others, are one."""
    others = [one for one in range(6) if one % 3 != axis]
    boxes = boxes[np.lexsort((boxes[:, axis], *boxes[:, others].T))]
    apart = (boxes[1:, others] != boxes[:-1, others]).any(1) | (boxes[1:, axis] != boxes[:-1, axis + 3])
    first = np.flatnonzero(np.concatenate(([True], apart)))[: len(boxes)]
    last = np.concatenate((first[1:], [len(boxes)])) - 1 if len(boxes) else first
    joined = boxes[first]
    joined[:, axis + 3] = boxes[last, axis + 3]
    return joined


def _hull(vertices: Float64[np.ndarray, "n 3"]) -> tuple[np.ndarray, np.ndarray] | None:
    """Vertices and faces of the convex hull; None if it is flat."""
    try:
        hull = ConvexHull(vertices)
    except (QhullError, ValueError):
        return None
    if hull.volume < THINNEST**3:
        return None
    places = np.zeros(len(vertices), np.int64)
    places[hull.vertices] = np.arange(len(hull.vertices))
    return vertices[hull.vertices], places[hull.simplices]


def _colour(mesh: LabelledMesh) -> str:
    """The mean colour of a mesh; MuJoCo has none for vertices."""
    return _text([*(mesh.colours.mean(0) / 255), 1])


def _text(numbers: Sequence[float] | np.ndarray) -> str:
    """Numbers as MJCF has them, to a hundredth of a millimetre."""
    return " ".join(f"{number:.5f}" for number in numbers)

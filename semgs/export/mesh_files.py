"""Labelled meshes as PLY and as binary glTF.

The PLY has float x y z, uchar red green blue, float scalar_label and scalar_confidence (names that CloudCompare reads as scalar fields without asking) and, if things were
searched, scalar_instance; the header lists the classes. The glTF file has a node for each thing and one for the rest. Its attributes are POSITION, NORMAL, COLOR_0 (linear, as
glTF has it) and, as in files of Gaussians, _CLASS, _CONFIDENCE and _INSTANCE. The photos' light is in the colours already, so the material is KHR_materials_unlit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from semgs._version import __version__
from semgs.data.ply_tables import write_ply
from semgs.data.tables.classes import ClassTable
from semgs.export.gltf import extras
from semgs.export.scene_objects import prim_names
from semgs.files.gltf_container import INDICES, VERTICES, GlbBuffer, write_glb
from semgs.files.images.colours import LINEAR
from semgs.mesh.labelled import LabelledMesh
from semgs.rendering.rendering import UNSEEN
from semgs.robotics.objects import Thing
from semgs.scene.scene_file import SavedScene

REST = "room"
"""The name of what belongs to no thing."""


@dataclass(frozen=True)
class MeshPart:
    """A thing, or what belongs to none.

    Attributes:
        name: class and number of the thing, such as "chair_4"; for the rest `REST`, or a class.
        mesh: its faces.
        thing: None for the rest.
        label: the class of all of it; None if there are several, or none.
    """

    name: str
    mesh: LabelledMesh
    thing: Thing | None = None
    label: str | None = None


def parts_of(mesh: LabelledMesh, things: Sequence[Thing], classes: ClassTable | None = None) -> list[MeshPart]:
    """The mesh of each thing that has faces, and that of the rest. A face belongs to the thing, or has the class, of most of its vertices.

    Args:
        mesh: of the scene.
        things: of the scene; empty if they were not searched.
        classes: splits the rest by class; None leaves it whole.
    """
    owners = _of_most(mesh, mesh.instances) if mesh.instances is not None else np.zeros(len(mesh.faces), np.int64)
    rest = ~np.isin(owners, [one.instance for one in things])
    wanted: list[tuple[str, np.ndarray, Thing | None, str | None]] = [
        (f"{one.name} {one.instance}", owners == one.instance, one, one.name) for one in things
    ]
    if classes is None or mesh.labels is None:
        wanted.append((REST, rest, None, None))
    else:
        labels = _of_most(mesh, mesh.labels)
        wanted += [(name, rest & (labels == number), None, name) for number, name in enumerate(classes.names)]
        wanted.append(("unseen", rest & (labels == UNSEEN), None, None))
    names = prim_names([name for name, *_ in wanted])
    return [
        MeshPart(name, mesh.only(keep), thing, label)
        for name, (_, keep, thing, label) in zip(names, wanted, strict=True)
        if keep.any()
    ]


def _of_most(mesh: LabelledMesh, values: np.ndarray) -> np.ndarray:
    """What most of the vertices of each face have: the middle one of the three, if two are equal."""
    return np.sort(values[mesh.faces], 1)[:, 1]


def save_mesh_ply(path: Path, mesh: LabelledMesh, comments: Sequence[str] = ()) -> None:
    """Write a PLY, binary little endian.

    Args:
        path: the file.
        mesh: in the frame of the file.
        comments: lines of the header.

    Raises:
        OSError: it cannot be written.
    """
    columns = dict(zip("xyz", mesh.vertices.T, strict=True))
    columns |= dict(zip(("red", "green", "blue"), mesh.colours.T, strict=True))
    columns |= {f"scalar_{name}": values.astype("<f4") for name, values in _fields(mesh).items()}
    write_ply(path, columns, comments, faces=mesh.faces)


def save_mesh_glb(path: Path, parts: Sequence[MeshPart], scene: SavedScene) -> None:
    """Write a binary glTF file with a node for each part.

    Args:
        path: the file.
        parts: at least one, with y up.
        scene: it has the unit and the class table.

    Raises:
        OSError: it cannot be written.
    """
    buffer = GlbBuffer()
    nodes: list[dict[str, Any]] = []
    meshes: list[dict[str, Any]] = []
    for part in parts:
        mesh = part.mesh
        vectors = {"POSITION": mesh.vertices, "NORMAL": normals_of(mesh), "COLOR_0": LINEAR[mesh.colours]}
        numbers = {f"_{name.upper()}": values for name, values in _fields(mesh, "class").items()}
        primitive = {
            "attributes": {
                name: buffer.add(values.astype("<f4"), VERTICES, bounds=values.ndim == 2)
                for name, values in (vectors | numbers).items()
            },
            "indices": buffer.add(mesh.faces.astype("<u4").reshape(-1), INDICES),
            "material": 0,
        }
        about = {"instance": part.thing.instance, "class": part.thing.name} if part.thing else {}
        nodes.append({"name": part.name, "mesh": len(meshes), "extras": about})
        meshes.append({"name": part.name, "primitives": [primitive], "extras": extras(scene)})
    plain = {"baseColorFactor": [1.0, 1.0, 1.0, 1.0], "metallicFactor": 0.0, "roughnessFactor": 1.0}
    content = {
        "asset": {"version": "2.0", "generator": f"SemGS {__version__}"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [{"pbrMetallicRoughness": plain, "extensions": {"KHR_materials_unlit": {}}}],
        **buffer.content(),
    }
    write_glb(path, content, buffer)


def _fields(mesh: LabelledMesh, label: str = "label") -> dict[str, np.ndarray]:
    """What is known of each vertex beside its colour, by name."""
    found = {label: mesh.labels, "confidence": mesh.confidences, "instance": mesh.instances}
    return {name: values for name, values in found.items() if values is not None}


def normals_of(mesh: LabelledMesh) -> Float64[np.ndarray, "n 3"]:
    """The normal of each vertex, of unit length: the mean of its faces', weighted by their areas."""
    one, two, three = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    across = np.cross(two - one, three - one)
    sums = np.stack(
        [np.bincount(mesh.faces.reshape(-1), np.repeat(side, 3), len(mesh.vertices)) for side in across.T], -1
    )
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    return np.where(lengths > 0, sums / np.maximum(lengths, 1e-300), (0.0, 0.0, 1.0))

"""ScanNet++'s annotated mesh: labels and depth as a pinhole sees them, by ray casting.

scans/mesh_aligned_0.05.ply           triangles [m]
scans/segments.json                   segIndices: the segment of each vertex
scans/segments_anno.json              segGroups[]: label and segments of each object
scans/mesh_aligned_0.05_mask.txt      anonymised vertices, to be ignored
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int, UInt8

from semgs.data.layouts.parts.fields import Fields, read_fields
from semgs.data.layouts.parts.mesh_maps import LabelledTriangles
from semgs.data.layouts.scannet.scannet_labels import normal
from semgs.data.ply_tables import with_plain_header
from semgs.data.raycast import Raycaster
from semgs.data.tables.classes import IGNORE
from semgs.files.contents import read_bytes
from semgs.files.errors import InputError, input_error, needs_extra

MESH = "mesh_aligned_0.05.ply"
SEGMENTS = "segments.json"
ANNOTATIONS = "segments_anno.json"
MASKED = "mesh_aligned_0.05_mask.txt"


@dataclass(frozen=True)
class LabelledMesh:
    """The mesh of a scan and the labels of its objects; files are read on first use.

    Attributes:
        folder: `scans/` of the scan.
        kept_in: the scan's name, as `StoredMesh.kept_in`.
        labels: (name, label) of each object name; other names have no label.
    """

    folder: Path
    kept_in: str
    labels: tuple[tuple[str, int], ...]

    @property
    def annotations(self) -> Path | None:
        """The file of the objects, None if there is none."""
        return self.folder / ANNOTATIONS if (self.folder / ANNOTATIONS).is_file() else None

    def key(self) -> tuple:
        """As `StoredMesh.key`."""
        return str(self.folder.resolve()), self.state(), self.labels

    def triangles(self) -> LabelledTriangles:
        """As `StoredMesh.triangles`.

        Raises:
            InputError: a file of the scan cannot be used.
            ImportError: embreex or trimesh is not installed; the error names the extra to install.
        """
        return _mesh(self.folder, self.labels, self.state())

    def state(self) -> tuple:
        """A key that changes when a file of the scan does."""
        names = (MESH, SEGMENTS, ANNOTATIONS, MASKED)
        held = [(self.folder / name).stat() if (self.folder / name).is_file() else None for name in names]
        return tuple(one and (one.st_size, one.st_mtime_ns) for one in held)


def object_names(path: Path) -> dict[str, int]:
    """The names of a scan's objects, with the number of objects for each.

    Args:
        path: `segments_anno.json`.

    Raises:
        InputError: it is damaged.
    """
    names: dict[str, int] = {}
    for group in read_fields(path).objects("segGroups"):
        name = normal(group.text("label") or "")
        names[name] = names.get(name, 0) + 1
    return names


@lru_cache(maxsize=1)
def _mesh(folder: Path, labels: tuple[tuple[str, int], ...], state: tuple) -> LabelledTriangles:
    """The mesh of a scan; the last one stays in memory, because frames are mostly read scan by scan."""
    vertices, faces = read_mesh(folder / MESH)
    of_vertices = np.full(len(vertices), IGNORE, np.uint8)
    if (folder / ANNOTATIONS).is_file():
        of_vertices = vertex_labels(folder, len(vertices), dict(labels))
    hidden = np.zeros(len(vertices), bool)
    if (folder / MASKED).is_file():
        hidden[masked_vertices(folder / MASKED, len(vertices))] = True
    first = faces[:, 0]
    with input_error(folder / MESH, "a mesh for ray casting"):
        return LabelledTriangles(Raycaster(vertices, faces), of_vertices[first], hidden[first])


def read_mesh(path: Path) -> tuple[Float64[np.ndarray, "n 3"], Int[np.ndarray, "m 3"]]:
    """Vertices [m] and triangles of a PLY, in the order of the file.

    Raises:
        InputError: it cannot be read, or has no triangle.
        ImportError: trimesh is not installed.
    """
    with needs_extra("raycast", "reading the mesh of a scan needs trimesh", "trimesh"):
        import trimesh
    if not path.is_file():
        raise InputError(path, "the mesh of the scan", "no such file")
    data = with_plain_header(read_bytes(path, "the mesh of the scan"))
    try:
        # From memory and without comments, as its header may name an image anywhere (`comment TextureFile`), which trimesh would open.
        mesh = trimesh.load_mesh(BytesIO(data), file_type="ply", process=False)
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces)
    except Exception as error:  # trimesh raises ValueError, IndexError, KeyError, ...
        raise InputError(path, "a PLY with triangles", f"one that cannot be read: {error}") from error
    if not len(faces):
        raise InputError(path, "a PLY with triangles", "none")
    return vertices, faces


def vertex_labels(folder: Path, count: int, labels: Mapping[str, int]) -> UInt8[np.ndarray, " n"]:
    """The label of each vertex, 255 = none. If objects share a vertex, the smallest counts (the benchmark's rule), even if it has no label.

    Args:
        folder: of the segments and objects.
        count: number of vertices of the mesh.
        labels: of object names.

    Raises:
        InputError: a file is damaged, or the segments belong to another mesh.
    """
    fields = read_fields(folder / SEGMENTS)
    segments = _whole_numbers(fields, "segIndices")
    if len(segments) != count:
        raise InputError(
            folder / SEGMENTS,
            f"a segment for each of the {count} vertices of {MESH}",
            f"{len(segments)}",
            key="segIndices",
        )
    known, segment_of, sizes = np.unique(segments, return_inverse=True, return_counts=True)  # their numbers may be huge
    groups = []
    for order, group in enumerate(read_fields(folder / ANNOTATIONS).objects("segGroups")):
        parts = np.flatnonzero(np.isin(known, _whole_numbers(group, "segments")))
        label = labels.get(normal(group.text("label") or ""), IGNORE)
        groups.append((-int(sizes[parts].sum()), -order, label, parts))
    of_segments = np.full(len(sizes), IGNORE, np.uint8)
    for *_, label, parts in sorted(groups, key=lambda group: group[:2]):
        of_segments[parts] = label
    return of_segments[segment_of]


def masked_vertices(path: Path, count: int) -> Int[np.ndarray, " n"]:
    """The vertices to ignore.

    Raises:
        InputError: the file cannot be read, or a vertex does not exist.
    """
    try:
        words = path.read_text(encoding="utf-8").split()
        vertices = np.array(words, np.int64)
    except (OSError, ValueError, OverflowError) as error:
        raise InputError(path, "numbers of vertices", str(error)) from error
    if len(vertices) and not (vertices.min() >= 0 and vertices.max() < count):
        raise InputError(path, f"vertices 0..{count - 1}", f"{vertices.min()}..{vertices.max()}")
    return vertices


def _whole_numbers(fields: Fields, key: str) -> Int[np.ndarray, " n"]:
    """A list of integers from 0."""
    numbers = fields.array(key, np.int64)
    if numbers is None or numbers.ndim != 1 or (len(numbers) and numbers.min() < 0):
        raise fields.refused(key, "a list of integers from 0", f"{fields.value(key)!r:.40}")
    return numbers

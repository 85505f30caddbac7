"""The labelled mesh of a scene, read with scenezoo."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, final

import numpy as np

from semgs.data.layouts.parts.triangles import LabelledTriangles
from semgs.data.layouts.scannet.scannet_labels import LabelTable, normal
from semgs.data.layouts.scannetpp.scannetpp_labels import NYU40_OF
from semgs.data.layouts.zoo.data_sets import DataSet
from semgs.data.layouts.zoo.scenezoo_library import scenezoo_errors
from semgs.data.raycast import Raycaster
from semgs.data.tables.nyu40 import NAMES, scannet20_labels
from semgs.files.errors import InputError, input_error

HOLD_MESHES = (".ply", ".json", ".csv", ".tsv", ".txt", ".zip")
"""Endings of files with meshes, labels and names."""
SCENES_IN = ("", "download", "scans", "v1/scans")
"""Where the folders of scenes are, in that of the data set."""


@final
@dataclass(frozen=True, eq=False)
class SceneMesh:
    """The labelled mesh of a scene, read when somebody looks.

    Attributes:
        opened: scenezoo's data set.
        path: its folder.
        scene: scenezoo's name of the scene.
        data: what is known of the data set.
        files: name, size and time of each file that may hold the mesh or its labels.
        table: ScanNet's, if it is with the data; it knows more names.
    """

    opened: Any
    path: Path
    scene: str
    data: DataSet
    files: tuple[tuple[str, int, int], ...] = ()
    table: LabelTable | None = None

    @property
    def kept_in(self) -> str:
        """As `StoredMesh.kept_in`: the data set's, because names of its scenes may not be names of folders."""
        return self.data.name

    def key(self) -> tuple:
        """As `StoredMesh.key`."""
        names = tuple(self.table.by_name.items()) if self.table else None
        return str(self.path.resolve()), self.scene, self.files, names

    def triangles(self) -> LabelledTriangles:
        """As `StoredMesh.triangles`.

        Raises:
            InputError: scenezoo cannot read it, or it has another number of faces or vertices than labels.
            ImportError: embreex is not installed.
        """
        return _triangles(self)


@lru_cache(maxsize=1)
def _triangles(mesh: SceneMesh) -> LabelledTriangles:
    """A mesh; the last one stays in memory, because frames are mostly read scene by scene."""
    with scenezoo_errors(mesh.path):
        read = mesh.opened.get_mesh(mesh.scene, mesh_type=mesh.data.mesh)
        found = mesh.opened.get_segmentation(mesh.scene, **mesh.data.segmentation)
    faces, ids = np.asarray(read.triangles), np.asarray(found.labels)
    expected = len(faces) if found.domain == "face" else len(read.vertices)
    if ids.shape != (expected,):
        raise InputError(
            mesh.path, f"a label for each {found.domain} of the mesh ({expected})", f"{len(ids)}", mesh.scene
        )
    known = np.array([label_of(found.id_to_name.get(int(one)), mesh.table) for one in np.unique(ids)], np.uint8)
    labels = known[np.unique(ids, return_inverse=True)[1]]
    with input_error(mesh.path, "a mesh for ray casting", mesh.scene):
        caster = Raycaster(np.asarray(read.vertices), faces)
    of_faces = labels if found.domain == "face" else labels[faces[:, 0]]
    return LabelledTriangles(caster, of_faces, np.zeros(len(faces), bool))


def mesh_files(path: Path, scene: str) -> tuple[tuple[str, int, int], ...]:
    """The files that may hold a scene's mesh, its labels, or the names of these: path in the data set, size [bytes], time [ns].

    Args:
        path: the folder of the data set.
        scene: its name, which is also that of its folder.
    """
    held = [folder.glob("*") for folder in (path, path / "metadata")]
    held += [(path / above / scene).glob(depth) for above in SCENES_IN for depth in ("*", "*/*")]
    files = {one for found in held for one in found if one.suffix in HOLD_MESHES and one.is_file()}
    states = [(str(one.relative_to(path)), one.stat()) for one in sorted(files)]
    return tuple((name, state.st_size, state.st_mtime_ns) for name, state in states)


def label_of(name: str | None, table: LabelTable | None) -> int:
    """The label in `scannet20` of an object's name; 255 if it has none."""
    key = normal(name or "")
    nyu40 = (table.by_name.get(key) if table else None) or NYU40_OF.get(key)
    if nyu40 is None:
        nyu40 = NAMES.index(key) + 1 if key in NAMES else 0
    return int(scannet20_labels()[nyu40])

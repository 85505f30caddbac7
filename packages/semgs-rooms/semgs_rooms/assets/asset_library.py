"""The assets of one split: catalogue entries and their contents, which are read once and cached."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
from cachetools import LRUCache, cached
from jaxtyping import Bool, Float32

from semgs.files.errors import InputError
from semgs.files.paths import typed_path
from semgs_rooms.assets.asset_images import Pyramid, decode
from semgs_rooms.assets.catalogue import ImageEntry, MeshEntry, read_catalogue, usable
from semgs_rooms.assets.glb import Primitive, read_primitives
from semgs_rooms.assets.lock import LockEntry, lock_digest, lock_of, read_lock, verify
from semgs_rooms.assets.splits import Split, split_images, split_meshes
from semgs_rooms.pieces.solids import Shell, corner_normals

T = TypeVar("T")
Folders = str | Path | Sequence[str | Path]
"""One folder of assets, or several."""

MEMORY = 256 << 20
"""Size limit of the cache [bytes]."""

PANE_WIDTH = 0.12
"""Flat triangles of windows that are wider than this are panes [m]."""
WORKTOP = 0.06
"""Thickness of the worktop of kitchen cabinets [m]."""
DRAPES = ("cloth", "curtain", "couch")
"""Words in the material names of drapes; other materials of curtains are rods."""

SPLIT_OF_STYLE: dict[str, Split] = {"home": "training", "other": "other", "closeup": "training"}


@dataclass(frozen=True)
class Panel:
    """The triangles of one material of a mesh, rotated to the frame of our furniture: front = +y.

    Attributes:
        label: class of this part, None if it is that of the piece.
        material: the material's name.
        colour: linear RGB, multiplied with the texture.
        picture: the texture, None if there is none.
        clear: whether it is glass.
        shell: the triangles.
    """

    label: str | None
    material: str
    colour: tuple[float, float, float]
    picture: Pyramid | None
    clear: bool
    shell: Shell


class Library:
    """The meshes and images of one split of one or several folders.

    Contents are cached in memory up to a limit, with the least recently used evicted first. A copy sent to another process starts
    with an empty cache.

    Args:
        folders: each with `catalog.json` and `textures.json`. Each folder is split independently of the others.
        split: "training", "validation" or "other".
        check: verify every file against the folder's lock. Set it to False only if that was done before.
        memory: size limit of the cache [bytes].

    Raises:
        InputError: a folder is missing, a file is missing or altered, or two folders have a file of the same name.
    """

    def __init__(
        self, folders: Folders, split: Split = "training", *, check: bool = True, memory: int = MEMORY
    ) -> None:
        paths = [folders] if isinstance(folders, str | Path) else folders
        self.folders, self.split, self.memory = tuple(typed_path(folder) for folder in paths), split, memory
        self.meshes: tuple[MeshEntry, ...] = ()
        self.images: tuple[ImageEntry, ...] = ()
        self._folder_of: dict[str, Path] = {}
        self._cache: LRUCache[str, Any] = LRUCache(memory, _weight)
        for folder in self.folders:
            if check:
                verify(folder)
            self._add(folder)

    def _add(self, folder: Path) -> None:
        """Add the split's entries of a folder."""
        catalogue = read_catalogue(folder)
        meshes = [entry for entry in catalogue.meshes if usable(entry)]
        mesh_lists, image_lists = split_meshes(meshes), split_images(catalogue.images)
        self.meshes += tuple(entry for entry in meshes if mesh_lists[entry.name] == self.split)
        self.images += tuple(entry for entry in catalogue.images if image_lists[entry.name] == self.split)
        everything: list[MeshEntry | ImageEntry] = [*catalogue.meshes, *catalogue.images]
        for entry in everything:
            if self._folder_of.setdefault(entry.file, folder) != folder:
                other = self._folder_of[entry.file]
                raise InputError(folder, "file names that other folders do not use", f"{entry.file}, as in {other}")

    @property
    def lock(self) -> tuple[LockEntry, ...]:
        """The locks of all folders."""
        return tuple(entry for folder in self.folders for entry in read_lock(lock_of(folder)))

    @property
    def lock_digests(self) -> tuple[str, ...]:
        """Digests of the locks of the folders, which identify their contents."""
        return tuple(lock_digest(folder) for folder in self.folders)

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_cache": LRUCache(self.memory, _weight)}

    def of_kind(self, *kinds: str) -> list[ImageEntry]:
        """The images of some kinds."""
        return [entry for entry in self.images if entry.kind in kinds]

    def panels(self, entry: MeshEntry) -> tuple[Panel, ...]:
        """The contents of a mesh.

        Raises:
            InputError: the file cannot be read.
        """
        return self._cached(entry.name, lambda: _panels(self._path(entry), entry))

    def pyramid(self, entry: ImageEntry, upright: bool = True) -> Pyramid:
        """The contents of an image. If not `upright`, it is transposed if its grain runs along columns.

        Raises:
            InputError: the file cannot be read.
        """

        def read() -> Pyramid:
            pyramid = decode(self._path(entry).read_bytes(), self._path(entry))
            return pyramid if upright else _lay_down(pyramid)

        return self._cached(f"{entry.kind}/{entry.name}/{upright}", read)

    def _path(self, entry: MeshEntry | ImageEntry) -> Path:
        return self._folder_of[entry.file] / entry.file

    def _cached(self, key: str, read: Callable[[], T]) -> T:
        return cached(self._cache, key=lambda: key)(read)()


def open_library(folders: Folders, style: str = "home", *, check: bool = True) -> Library:
    """The assets that rooms of a style may use: the split `training` for `home`, the held-out split for `other`.

    Raises:
        ValueError: there is no such style.
        InputError: the folders cannot be used (see `Library`) or have nothing for such rooms.
    """
    if style not in SPLIT_OF_STYLE:
        raise ValueError(f"style {style!r}; expected one of {', '.join(SPLIT_OF_STYLE)}")
    library = Library(folders, SPLIT_OF_STYLE[style], check=check)
    if not library.meshes and not library.images:
        advice = "what semgs_rooms.furniture makes is for training and validation rooms" if style == "other" else None
        expected = f"meshes or images of the split {library.split}"
        raise InputError(", ".join(map(str, library.folders)), expected, "none", advice=advice)
    return library


def _panels(path: Path, entry: MeshEntry) -> tuple[Panel, ...]:
    labels = dict(entry.parts)
    panels = []
    primitives = read_primitives(path)
    triangles = [p.vertices[p.faces] * np.array([-1, -1, 1], np.float32) for p in primitives]
    side = _fuller_side(primitives, triangles)
    for primitive, corners in zip(primitives, triangles, strict=True):
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
        whole = (area > 1e-10) & _used_triangles(entry, primitive, corners, side)
        if not whole.any():
            continue
        corners = corners[whole]
        uv = primitive.uv[primitive.faces]
        picture = None if primitive.texture is None else decode(primitive.texture, path, uv)
        uv, normals = uv[whole], corner_normals(corners)
        for label, part in _label_triangles(entry, corners, labels.get(primitive.name)):
            shell = Shell(corners[part], normals[part], uv[part])
            panels.append(Panel(label, primitive.material, primitive.colour, picture, primitive.clear, shell))
    return tuple(panels)


def _label_triangles(
    entry: MeshEntry, corners: Float32[np.ndarray, "t 3 3"], label: str | None
) -> list[tuple[str | None, Bool[np.ndarray, " t"]]]:
    """The classes of a primitive's triangles, from the catalogue. Kitchen cabinets that it labels entirely as counter are split:
    below the worktop they are cabinets, as in the parametric ones."""
    if entry.label != "counter" or entry.subtype != "kitchen_base_cabinet" or entry.parts:
        return [(label, np.ones(len(corners), bool))]
    top = corners[..., 2].min(axis=1) > entry.extents[2] - WORKTOP
    return [(own, part) for own, part in ((None, top), ("cabinet", ~top)) if part.any()]


def _fuller_side(primitives: list[Primitive], triangles: list[Float32[np.ndarray, "_ 3 3"]]) -> int:
    """The side on which a pair of drapes has more cloth: 1 for positive x, else -1."""
    cloth = [c[..., 0].mean(axis=1) for p, c in zip(primitives, triangles, strict=True) if _is_cloth(p)]
    return 1 if cloth and (np.concatenate(cloth) > 0).mean() >= 0.5 else -1


def _is_cloth(primitive: Primitive) -> bool:
    return any(word in primitive.material.lower() for word in DRAPES)


def _used_triangles(
    entry: MeshEntry, primitive: Primitive, corners: Float32[np.ndarray, "t 3 3"], side: int
) -> Bool[np.ndarray, " t"]:
    """Which triangles rooms use: one drape of a curtain without its rod, a window without its panes."""
    name = primitive.material.lower()
    if entry.label == "curtain" and entry.subtype == "curtain":
        return (side * corners[..., 0].mean(axis=1) > 0) & _is_cloth(primitive)
    if entry.label == "window":
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(normals, axis=-1)
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(axis=1)
        pane = (np.abs(normals[:, 1]) > 0.95 * area) & (area > PANE_WIDTH * longest)
        return ~pane & (not primitive.clear and "glass" not in name)
    return np.ones(len(corners), bool)


def _weight(contents: tuple[Panel, ...] | Pyramid) -> int:
    """The memory of a mesh or an image [bytes]."""
    if isinstance(contents, Pyramid):
        return contents.pixels.nbytes
    shells = sum(panel.shell.corners.nbytes * 2 + panel.shell.uv.nbytes for panel in contents)
    return shells + sum(panel.picture.pixels.nbytes for panel in contents if panel.picture)


def _lay_down(upright: Pyramid) -> Pyramid:
    """The image, transposed if its grain runs along columns."""
    width, height = upright.size
    grey = upright.pixels[: width * height].mean(axis=1).reshape(height, width)
    if np.abs(np.diff(grey, axis=1)).mean() <= np.abs(np.diff(grey, axis=0)).mean():
        return upright
    levels, start = [], 0
    while start < len(upright.pixels):
        level = upright.pixels[start : start + width * height].reshape(height, width, 3)
        levels.append(cv2.transpose(level).reshape(-1, 3))
        start += width * height
        width, height = max(1, width // 2), max(1, height // 2)
    return Pyramid(np.concatenate(levels), (upright.size[1], upright.size[0]))

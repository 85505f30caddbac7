"""The catalogue of a folder of assets: what each mesh and image is, and which meshes rooms may use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from semgs.files.errors import InputError
from semgs.files.strict_json import read_json

EXCLUDED = {
    "kenney_bookcaseopen": "a ladder rather than a bookshelf",
    "kenney_bookcaseopenlow": "a trestle rather than a bookshelf",
    "ph_painted_wooden_shelves": "a holder for a wall, not a bookshelf",
    "qt_shelf_small1": "a box for a wall, not a bookshelf",
    "qt_shelf_small2": "a box for a wall, not a bookshelf",
    "qt_shelf_small3": "a box for a wall, not a bookshelf",
    "ph_wooden_display_shelves_01": "its front is on its side",
    "bp_dwr_matera_dresser2": "its front is on its side",
    "bp_cb_tecs_baked": "its front is on its side",
    "bp_cb_clapboard_baked": "a television is part of the mesh",
    "bp_cb_moore_baked": "a television is part of the mesh",
    "bp_open_door": "a frame without a leaf",
    "bp_whitewindow": "its panes cannot be separated from its frame",
    "kenney_wallwindow": "edges of a wall are part of the mesh",
    "kenney_wallwindowslide": "edges of a wall are part of the mesh",
    "kenney_kitchencabinetcornerinner": "a corner, which plans do not use",
    "kenney_kitchencabinetcornerround": "a corner, which plans do not use",
    "qt_window_round1": "the wall would be missing beside its arch",
    "qt_window_round2": "the wall would be missing beside its arch",
    "qt_window_round3": "the wall would be missing beside its arch",
    "khronos_avocado": "30 cm long",
}
"""Meshes that do not fit their class or cannot be placed in rooms, and why."""

TOYS = ("kkf_", "kkr_")
"""Makers whose furniture has the proportions of toys; only their clutter is used."""

STOOL = "stool"
"""A subtype of chair that ScanNet's annotators do not label as chair; excluded."""

FOOTREST_DEPTH = 1.2
"""Generated sofas and armchairs deeper than this have their footrest extended and are excluded [m]."""


@dataclass(frozen=True)
class Origin:
    """Where a file comes from.

    Attributes:
        source: the repository.
        commit: of the repository.
        path: in the repository.
        licence: of the file.
        author: empty if the source names none.
    """

    source: str = ""
    commit: str = ""
    path: str = ""
    licence: str = ""
    author: str = ""


@dataclass(frozen=True)
class MeshEntry:
    """One mesh of the catalogue. Its file is in metres, z up, base at z = 0, centred in x and y, front = -y.

    Attributes:
        name: unique.
        label: ScanNet-20 class, or "clutter" (ignored).
        subtype: finer kind, such as "office_chair".
        file: of the mesh, in the folder.
        extents: width (x), depth (y), height (z) [m].
        mount: "floor", "wall", "surface" or "ceiling".
        parts: the nodes whose class is not that of the piece, and their classes.
        origin: where it comes from.
    """

    name: str
    label: str
    subtype: str
    file: str
    extents: tuple[float, float, float]
    mount: str
    parts: tuple[tuple[str, str], ...] = ()
    origin: Origin = Origin()


@dataclass(frozen=True)
class ImageEntry:
    """One image of the catalogue.

    Attributes:
        name: unique.
        kind: "wood_floor", "painting", "outdoor", ...
        file: in the folder.
        size: width, height [px].
        tileable: whether it repeats without a seam.
        tile: width of one tile [m], None if unknown.
        origin: where it comes from.
    """

    name: str
    kind: str
    file: str
    size: tuple[int, int]
    tileable: bool
    tile: float | None
    origin: Origin


Entry = TypeVar("Entry", MeshEntry, ImageEntry)


@dataclass(frozen=True)
class Catalogue:
    """All entries of a folder, in its order."""

    meshes: tuple[MeshEntry, ...]
    images: tuple[ImageEntry, ...]


def read_catalogue(folder: str | Path) -> Catalogue:
    """Read `catalog.json` and `textures.json` of a folder, without opening the files that they list.

    Raises:
        InputError: one of the two is missing or malformed, or a name occurs twice.
    """
    meshes = tuple(_read(Path(folder) / "catalog.json", _mesh))
    images = tuple(_read(Path(folder) / "textures.json", _image))
    return Catalogue(meshes, images)


def usable(row: MeshEntry) -> bool:
    """Whether a mesh is what its class says, by the known faults of the collection."""
    footrest = row.name.startswith(("ig_sofa", "ig_armchair")) and row.extents[1] > FOOTREST_DEPTH
    toy = row.name.startswith(TOYS) and row.label != "clutter"
    return row.name not in EXCLUDED and row.subtype != STOOL and not footrest and not toy


def _read(path: Path, entry: Callable[[dict], Entry]) -> list[Entry]:
    """The entries of a list; their names are unique."""
    rows = read_json(path, "the list of a folder of assets", advice="give the folder that contains it")
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise InputError(path, "a list of objects", type(rows).__name__)
    found: dict[str, Entry] = {}
    for row in rows:
        try:
            one = entry(row)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(
                path, "rows with name, file, licence and the like", f"{type(error).__name__}: {error}",
                key=str(row.get("name")),
            ) from None  # fmt: skip
        if one.name in found:
            raise InputError(path, "names that occur once", f"{one.name} twice", key="name")
        found[one.name] = one
    return list(found.values())


def _mesh(row: dict) -> MeshEntry:
    x, y, z = (float(side) for side in row["extents_m"])
    parts = tuple((str(node), str(label)) for node, label in row.get("part_classes", {}).items())
    return MeshEntry(
        str(row["name"]), str(row["class"]), str(row["subtype"]), inside(row["file"]), (x, y, z), str(row["mount"]), parts,
        _origin(row),
    )  # fmt: skip


def _image(row: dict) -> ImageEntry:
    width, height = (int(side) for side in row["size"])
    tile = float(row["tile_cm"]) / 100 if row.get("tile_cm") else None
    return ImageEntry(
        str(row["name"]),
        str(row["kind"]),
        inside(row["file"]),
        (width, height),
        bool(row["tileable"]),
        tile,
        _origin(row),
    )


def _origin(row: dict) -> Origin:
    return Origin(
        str(row["source_repo"]), str(row["commit"]), str(row["path"]), str(row["licence"]), str(row.get("author") or "")
    )


def inside(file: str) -> str:
    """The path of a file inside a folder of assets; a ValueError if it leads out of the folder."""
    if Path(file).is_absolute() or ".." in Path(file).parts:
        raise ValueError(f"file {file!r} leads out of the folder")
    return file

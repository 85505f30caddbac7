"""The catalogue of a folder of assets: what each mesh and image is, and which meshes rooms may use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from semgs.files.errors import InputError
from semgs.files.strict_json import read_json

WHY_EXCLUDED = {
    "a ladder rather than a bookshelf": ("kenney_bookcaseopen",),
    "a trestle rather than a bookshelf": ("kenney_bookcaseopenlow",),
    "a holder for a wall, not a bookshelf": ("ph_painted_wooden_shelves",),
    "a box for a wall, not a bookshelf": ("qt_shelf_small1", "qt_shelf_small2", "qt_shelf_small3"),
    "its front is on its side": ("ph_wooden_display_shelves_01", "bp_dwr_matera_dresser2", "bp_cb_tecs_baked"),
    "a television is part of the mesh": ("bp_cb_clapboard_baked", "bp_cb_moore_baked"),
    "a frame without a leaf": ("bp_open_door",),
    "its panes cannot be separated from its frame": ("bp_whitewindow",),
    "edges of a wall are part of the mesh": ("kenney_wallwindow", "kenney_wallwindowslide"),
    "a corner, which plans do not use": ("kenney_kitchencabinetcornerinner", "kenney_kitchencabinetcornerround"),
    "the wall would be missing beside its arch": ("qt_window_round1", "qt_window_round2", "qt_window_round3"),
    "30 cm long": ("khronos_avocado",),
}
"""Meshes that do not fit their class or cannot be placed in rooms, by the reason."""
EXCLUDED = frozenset(name for names in WHY_EXCLUDED.values() for name in names)

TOYS = ("kkf_", "kkr_")
"""Makers whose furniture has the proportions of toys; only their clutter is used."""

STOOL = "stool"
"""A subtype of chair that ScanNet's annotators do not label as chair; excluded."""

FOOTREST_DEPTH = 1.2
"""Generated sofas and armchairs deeper than this have their footrest extended and are excluded [m]."""


@dataclass(frozen=True)
class FileSource:
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
    origin: FileSource = FileSource()


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
    origin: FileSource


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


def _read(path: Path, decode: Callable[[dict], Entry]) -> list[Entry]:
    """The entries of a list; their names are unique."""
    rows = read_json(path, "the list of a folder of assets", advice="give the folder that contains it")
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise InputError(path, "a list of objects", type(rows).__name__)
    entries: dict[str, Entry] = {}
    for row in rows:
        try:
            entry = decode(row)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            expected, reason = "rows with name, file, licence and the like", f"{type(error).__name__}: {error}"
            raise InputError(path, expected, reason, key=str(row.get("name"))) from None
        if entry.name in entries:
            raise InputError(path, "names that occur once", f"{entry.name} twice", key="name")
        entries[entry.name] = entry
    return list(entries.values())


def _mesh(row: dict) -> MeshEntry:
    x, y, z = (float(side) for side in row["extents_m"])
    parts = tuple((str(node), str(label)) for node, label in row.get("part_classes", {}).items())
    name, label, subtype, mount = (str(row[key]) for key in ("name", "class", "subtype", "mount"))
    return MeshEntry(name, label, subtype, inside(row["file"]), (x, y, z), mount, parts, _origin(row))


def _image(row: dict) -> ImageEntry:
    width, height = (int(side) for side in row["size"])
    tile = float(row["tile_cm"]) / 100 if row.get("tile_cm") else None
    name, kind, file = str(row["name"]), str(row["kind"]), inside(row["file"])
    return ImageEntry(name, kind, file, (width, height), bool(row["tileable"]), tile, _origin(row))


def _origin(row: dict) -> FileSource:
    source, commit, path, licence = (str(row[key]) for key in ("source_repo", "commit", "path", "licence"))
    return FileSource(source, commit, path, licence, str(row.get("author") or ""))


def inside(file: str) -> str:
    """The path of a file inside a folder of assets; a ValueError if it leads out of the folder."""
    if Path(file).is_absolute() or ".." in Path(file).parts:
        raise ValueError(f"file {file!r} leads out of the folder")
    return file

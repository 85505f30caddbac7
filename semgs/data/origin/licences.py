"""The terms of use of a scene, as far as its files say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from semgs.data.layouts import labelled_images
from semgs.data.layouts.replica import sequence as replica
from semgs.data.layouts.scannet import scannet_scan as scannet
from semgs.data.layouts.scannetpp import scannetpp_scan as scannetpp
from semgs.data.origin.terms import FURNISHED, REPLICA, ROOMS, SCANNET, SCANNETPP, Labeller, Terms
from semgs.data.scene import Scene
from semgs.data.tables.class_files import read_class_file
from semgs.files.archives import members
from semgs.files.strict_json import parse_json

ROOM = "room.json"
"""The file in the folder of a generated room: which room it is, and how many pixels each class has."""
ATTRIBUTION = "ATTRIBUTION.md"
"""The file next to rooms with third-party assets that credits their authors."""

RECORD = "prepared.json"


def terms_of(scene: Scene) -> Terms:
    """The terms of a scene, and of the network that its labels are from.

    Raises:
        InputError: an archive is damaged.
    """
    own, labeller = terms_of_photos(scene), labeller_of(scene)
    if labeller is None:
        return own
    return Terms(f"{own.text}; labels by {labeller.title}", own.own or labeller.restricted)


def labeller_of(scene: Scene) -> Labeller | None:
    """The network that a scene's labels are from, also if the scene was prepared from such a one; None for labels of its files.

    Raises:
        InputError: an archive is damaged.
    """
    if scene.labeller is None and (record := _record(scene)) and "labeller" in record:
        return Labeller(**record["labeller"])
    return scene.labeller


def terms_of_photos(scene: Scene) -> Terms:
    """The terms of a scene without its labels, by its layout or, if it was prepared, by that of its source.

    Generated rooms are known by their files.

    Raises:
        InputError: an archive is damaged.
    """
    layout = scene.layout
    if record := _record(scene):
        if "terms" in record:
            return Terms(**record["terms"])
        layout = str(record.get("source", {}).get("layout", layout))
    if layout == labelled_images.LAYOUT and (stated := read_class_file(scene.path / labelled_images.CLASSES).terms):
        return Terms(f"{scene.name}: {stated}")
    if known := _of_layout(layout):
        return known
    folder = scene.path if scene.path.is_dir() else scene.path.parent
    if (folder / ROOM).is_file():
        return FURNISHED if (folder.parent / ATTRIBUTION).is_file() or _has_assets(folder / ROOM) else ROOMS
    return Terms(f"scenes of layout {layout}: terms not known to semgs")


def _record(scene: Scene) -> dict[str, Any] | None:
    """The record of a prepared scene; None for any other.

    Raises:
        InputError: an archive is damaged.
    """
    return read_record(scene.path) if scene.path.suffix.lower() == ".zip" else None


def _of_layout(layout: str) -> Terms | None:
    """The terms of a data set with a layout of its own."""
    if layout.startswith(scannetpp.LAYOUT):
        return SCANNETPP
    return {scannet.LAYOUT: SCANNET, replica.LAYOUT: REPLICA}.get(layout)


def _has_assets(room: Path) -> bool:
    """Whether the file of a room lists assets."""
    try:
        content: Any = parse_json(room.read_bytes())
    except (OSError, ValueError):
        return False
    return isinstance(content, dict) and bool(content.get("assets"))


def read_record(archive: Path) -> dict[str, Any] | None:
    """The content of `prepared.json` in an archive; None if it is not a prepared scene.

    Raises:
        InputError: it is not a zip archive.
    """
    member = members(archive).get(RECORD)
    try:
        content = parse_json(member.read_bytes()) if member is not None else None
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None

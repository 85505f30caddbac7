"""Terms of use: the licences and agreements of scenes, as far as their files say. Weights store those of their training data."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from semgs.data.layouts import labelled_images
from semgs.data.layouts.replica import sequence as replica
from semgs.data.layouts.scannet import scannet_scan as scannet
from semgs.data.layouts.scannetpp import scannetpp_scan as scannetpp
from semgs.data.layouts.zoo.data_sets import DATA_SETS, LAYOUT
from semgs.data.origin.labeller import Labeller
from semgs.data.origin.prepared_record import read_record
from semgs.data.scene import Scene
from semgs.data.tables.class_files import read_class_file
from semgs.files.strict_json import parse_json

ROOM = "room.json"
"""The file in the folder of a generated room: which room it is, and how many pixels each class has."""
ATTRIBUTION = "ATTRIBUTION.md"
"""The file next to rooms with third-party assets that credits their authors."""


class TermsWarning(UserWarning):
    """Weights were trained on data with terms of use, which the warning quotes."""


@dataclass(frozen=True)
class Terms:
    """The terms of use of some data.

    Attributes:
        text: the data and its terms, in a few words.
        own: whether users of weights trained on the data should be warned.
    """

    text: str
    own: bool = False


ROOMS = Terms("CC0-1.0 rooms drawn by semgs")
FURNISHED = Terms("CC0-1.0 rooms drawn by semgs with third-party models and textures, see NOTICE")
SCANNET = Terms(
    "ScanNet: ScanNet Terms of Use, for non-commercial research and education, "
    "https://kaldir.vc.in.tum.de/scannet/ScanNet_TOS.pdf",
    own=True,
)
SCANNETPP = Terms(
    "ScanNet++: ScanNet++ Terms of Use, for non-commercial research and education, "
    "https://kaldir.vc.in.tum.de/scannetpp/static/scannetpp-terms-of-use.pdf",
    own=True,
)
REPLICA = Terms(
    "Replica: Replica Dataset Research Terms, for non-commercial research and education, "
    "https://github.com/facebookresearch/Replica-Dataset/blob/main/LICENSE",
    own=True,
)


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


def terms_text(terms: Iterable[Terms]) -> str:
    """Terms as text for a header: each once, in order."""
    return json.dumps([asdict(one) for one in dict.fromkeys(terms)])


def terms_from(text: str) -> tuple[Terms, ...]:
    """Terms from the text that `terms_text` wrote.

    Raises:
        ValueError, TypeError, KeyError: it is something else.
    """
    if not isinstance(text, str):
        raise TypeError(f"terms are {text!r:.40}; expected text")
    return tuple(Terms(str(one["text"]), bool(one["own"])) for one in parse_json(text))


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
    if layout.startswith(f"{LAYOUT} "):
        title = next(data.title for data in DATA_SETS if layout == f"{LAYOUT} {data.name}")
        return Terms(f"{title}: the terms of use of the data set", own=True)
    return {scannet.LAYOUT: SCANNET, replica.LAYOUT: REPLICA}.get(layout)


def _has_assets(room: Path) -> bool:
    """Whether the file of a room lists assets."""
    try:
        content: Any = parse_json(room.read_bytes())
    except (OSError, ValueError):
        return False
    return isinstance(content, dict) and bool(content.get("assets"))

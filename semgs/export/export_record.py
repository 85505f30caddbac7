"""export.json: the frame of every file beside it, and the table of the classes.

    {"format": "semgs.export", "version": 1, "software": "semgs 0.1.0", "scene": "office", "unit": "metric",
     "up": {"direction": [0.01, -0.94, -0.34], "reason": "57% of the surfaces are level or upright", "certain": true},
     "files": [{"name": "gaussians.ply", "up": "-y", "count": 38400, "scene_from_file": [[...], [...], [...], [0, 0, 0, 1]]}],
     "classes": [{"number": 0, "name": "wall", "colour": [174, 199, 232]}, ...]}

`scene_from_file` takes a position in the file to the coordinates of the scene's own poses. `up` of a file is the direction that is up in it, and
`up.direction` is that direction in the scene; both are null in the scene's own frame. `classes` is null for a scene without classes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from semgs._version import __version__
from semgs.data.tables.classes import ClassTable
from semgs.files.atomic import write_json
from semgs.scene.upright import FramedScene, UpDirection

FILE_NAME = "export.json"
"""Its name, in every folder with exports."""


@dataclass(frozen=True)
class ExportedFile:
    """A file, or a folder, with the whole scene or a part of it.

    Attributes:
        name: in the folder of export.json.
        framed: the scene in the file's frame.
        count: Gaussians or points in the file.
    """

    name: str
    framed: FramedScene
    count: int


def write_record(folder: Path, files: Sequence[ExportedFile], up: UpDirection | None) -> None:
    """Write export.json.

    Args:
        folder: of the files.
        files: at least one, all of one scene.
        up: what they were turned by; None if they are in the scene's own frame.

    Raises:
        OSError: it cannot be written.
    """
    scene = files[0].framed.scene
    content = {
        "format": "semgs.export",
        "version": 1,
        "software": f"semgs {__version__}",
        "scene": scene.source,
        "unit": scene.unit,
        "up": None if up is None else {"direction": up.direction.tolist(), "reason": up.reason, "certain": up.certain},
        "files": [
            {
                "name": file.name,
                "up": file.framed.axes,
                "count": file.count,
                "scene_from_file": file.framed.source_from_file.tolist(),
            }
            for file in files
        ],
        "classes": scene.classes and _table(scene.classes),
    }
    write_json(folder / FILE_NAME, content)


def _table(classes: ClassTable) -> list[dict]:
    """Number, name and colour of each class."""
    return [
        {"number": number, "name": name, "colour": list(colour)}
        for number, (name, colour) in enumerate(zip(classes.names, classes.colours, strict=True))
    ]

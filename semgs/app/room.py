"""The page of a room: a folder of `semgs reconstruct` becomes a page with the scene in 3D, its classes, notes and downloads. It needs no server."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from semgs.export.scene_objects import place_things, things_of
from semgs.files.atomic import new_file, write_json, write_text
from semgs.files.strict_json import read_json
from semgs.files.text import percent, printable
from semgs.robotics.objects import Objects
from semgs.scene.scene_file import SavedScene, load_scene
from semgs.scene.upright import up_of
from semgs.viewer.viewer_cameras import photos_in
from semgs.viewer.viewer_page import ScenePage, scene_page

PAGE, SCENE, RECORD, ZIP = "index.html", "scene.html", "room.json", "room.zip"

DOWNLOADS = {
    "gaussians.ply": "The room as Gaussians: opens in every splat viewer, such as SuperSplat",
    "semantics.ply": "The same, coloured by class",
    "points.ply": "Points with colour, class and confidence, for CloudCompare or MeshLab",
    "gaussians.glb": "glTF with Gaussians; other programs show points",
    "objects.json": "Things with class, box and position in metres",
    "report.html": "The full report with all numbers, which opens in a new tab",
    ZIP: "Everything, this page included: unpack it and open index.html",
}
"""Files to download, and what they are."""

MOST_GAUSSIANS = 80_000
"""More would make the page slow on phones."""


def write_room(folder: Path, title: str = "Your room", notes: Sequence[str] = ()) -> None:
    """Write the page of a room into a folder of `semgs reconstruct`: index.html, scene.html, room.json and room.zip.

    Args:
        folder: the output of `semgs reconstruct`; files of `semgs export` in it are offered as downloads, too.
        title: of the page.
        notes: what the user should know, in words for a page.

    Raises:
        InputError: the folder has no scene that can be read.
        ImportError: viser is not installed.
        OSError: a file cannot be written.
    """
    scene = load_scene(folder)
    report: Any = read_json(folder / "report.json")
    up = up_of(scene)
    things = things_of(scene, up) if scene.unit == "metric" and scene.classes is not None else None
    script = files("semgs.app").joinpath("web/scene.js").read_text(encoding="utf-8")
    page = scene_page(scene, photos_in(folder, scene), up=up, at_most=MOST_GAUSSIANS, things=things, script=script)
    write_text(folder / SCENE, page.html)
    record = {
        "title": title,
        "metric": scene.unit == "metric",
        "gaussians": len(scene.gaussians),
        "classes": [{"name": group.name, "share": round(group.share, 4)} for group in page.groups]
        if scene.classes
        else [],
        "things": _things(things, scene.origin),
        "notes": list(notes),
        "seconds": report["seconds"],
    }
    write_text(folder / PAGE, _page(folder, scene, report, page, record))
    _write_zip(folder)
    # Sizes of the downloads are only known now.
    write_text(folder / PAGE, _page(folder, scene, report, page, record))
    write_json(folder / RECORD, record)


def _page(
    folder: Path, scene: SavedScene, report: Mapping[str, Any], page: ScenePage, record: Mapping[str, Any]
) -> str:
    """The text of index.html."""
    from jinja2 import Environment, StrictUndefined

    web = files("semgs.app").joinpath("web")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(web.joinpath("room.html.j2").read_text(encoding="utf-8"))
    views = _views(folder, report)
    data = {
        "metric": record["metric"],
        "decimals": page.decimals,
        "classes": [{"name": printable(entry["name"])} for entry in record["classes"]],
        "things": record["things"],
        "camera": (scene.cameras.centres[0] + scene.cameras.centres.new_tensor(scene.origin)).tolist(),
    }
    height, width = scene.cameras.size
    return template.render(
        title=record["title"],
        lead=_lead(report, page),
        style=web.joinpath("room.css").read_text(encoding="utf-8"),
        script=web.joinpath("room.js").read_text(encoding="utf-8"),
        data=json.dumps(data).replace("<", "\\u003c"),
        classes=[
            {"name": printable(group.name), "colour": group.colour, "share": percent(group.share)}
            for group in page.groups
        ]
        if scene.classes
        else [],
        things=record["things"],
        inputs=[view for view in views if view["number"] is not None],
        views=views,
        notes=[printable(note) for note in record["notes"]],
        before=_before(folder, report),
        files=[
            {"name": name, "what": what, "size": _size(folder / name)}
            for name, what in DOWNLOADS.items()
            if (folder / name).exists() or name == ZIP
        ],
        height=height,
        width=width,
    )


def _lead(report: Mapping[str, Any], page: ScenePage) -> str:
    """The sentence below the title."""
    used = sum(view["role"] == "context" for view in report["views"])
    of = report["scene"]["usable_frames"]
    which = f"Made from {used} of {of} photos" if of > used else f"Made from {used} photos"
    shown = "" if page.shown == report["gaussians"] else f", {page.shown:,} of them in this page"
    return f"{which}: {report['gaussians']:,} Gaussians{shown}."


def _views(folder: Path, report: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Photo, rendering and class map of each view."""
    views = []
    for number, view in enumerate(report["views"]):
        held_out = view["role"] == "target"
        stem = f"renders/{view['role']}_{view['position']:03d}"
        title = f"Held-out photo, for comparison ({_name(view)})" if held_out else f"Photo {number + 1} ({_name(view)})"
        shots = [("truth" if held_out else "input", "Photo"), ("image", "Rendered"), ("classes", "Classes")]
        listed = [
            {"file": f"{stem}_{kind}.png", "name": name, "alt": f"{name}: {title}"}
            for kind, name in shots
            if (folder / f"{stem}_{kind}.png").exists()
        ]
        views.append({"title": title, "number": None if held_out else number, "shots": listed})
    return views


def _name(view: Mapping[str, Any]) -> str:
    """The name of a view's photo, without folders."""
    return printable(str(view["name"]).rsplit("/", 1)[-1])


def _before(folder: Path, report: Mapping[str, Any]) -> dict[str, str] | None:
    """A view before and after refinement; None without one."""
    if not report["refinement"]:
        return None
    roles = {
        role: f"renders/{role}_{view['position']:03d}" for view in reversed(report["views"]) for role in [view["role"]]
    }
    stem = roles.get("target") or roles["context"]
    if not (folder / f"{stem}_before.png").exists():
        return None
    role = "target" if "target" in roles else "context"
    old, new = report["refinement"]["before"].get(role), report["means"].get(role)
    text = ""
    if old and new and old["psnr"] and new["psnr"]:
        what = "photos that were not used" if role == "target" else "the photos"
        text = f"PSNR on {what}: {old['psnr']:.1f} dB before, {new['psnr']:.1f} dB after."
    return {"before": f"{stem}_before.png", "after": f"{stem}_image.png", "text": text}


def _things(things: Objects | None, origin: tuple[float, float, float]) -> dict[str, Any]:
    """Things by number, for clicks, in the coordinates of the scene's own poses, as what is clicked."""
    if things is None:
        return {}
    return {
        str(one.thing.instance): {
            "class": one.thing.name,
            "confidence": round(one.thing.confidence, 3),
            "size": [round(float(side), 3) for side in one.thing.box.size],
            "centre": [round(float(side), 3) for side in one.centre + np.array(origin)],
        }
        for one in place_things(things)
    }


def _size(path: Path) -> str:
    """The size of a file, for people."""
    if not path.exists():
        return ""
    size = path.stat().st_size
    return f"{size / 1e6:.1f} MB" if size >= 100_000 else f"{max(1, round(size / 1000))} kB"


def _write_zip(folder: Path) -> None:
    """Write everything in a folder into a zip in it."""
    with new_file(folder / ZIP) as file, zipfile.ZipFile(file, "w") as archive:
        for path in sorted(folder.rglob("*")):
            inside = path.relative_to(folder)
            if path.is_file() and not path.name.startswith(".") and inside.name != ZIP:
                archive.write(path, Path("room") / inside)

"""The worker of `semgs app`, with commands that only pretend: which photos a room has."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Literal

import pytest
from dropped_files import picture, written
from room_folders import write_reconstruction

from semgs.app.limits import Limits
from semgs.app.requests import Request, RoomOptions
from semgs.cli import app_worker

PHOTOS = (".jpg", ".png")


def pretend(arguments: Sequence[str]) -> int:
    """What `semgs reconstruct` and `semgs export` write for photos whose cameras were estimated."""
    out = Path(arguments[arguments.index("--out") + 1])
    if arguments[0] == "export":
        out.mkdir()
        return 0
    write_reconstruction(out)
    if "--drop-photos" in arguments:
        return 0
    images = out / "cameras" / "images"
    images.mkdir(parents=True)
    for number in range(3):
        picture(images / f"{number:03d}.jpg")
    return 0


def folders_of(photos: Iterable[Path]) -> set[Path]:
    """The folders of those paths that are photos."""
    return {path.parent for path in photos if path.suffix in PHOTOS}


@pytest.mark.parametrize("kind", ["photos", "clip"])
def test_a_room_and_its_zip_have_the_views_that_they_show_and_no_other_photo(
    kind: Literal["photos", "clip"], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    uploads = [written(tmp_path / "a.mp4", b"x")]
    if kind == "photos":
        uploads = [picture(tmp_path / f"{number}.jpg", seed=number) for number in range(3)]
    files = [[str(one.path), one.name] for one in uploads]
    request = Request(kind, files, str(tmp_path), asdict(RoomOptions()), asdict(Limits()))
    monkeypatch.chdir(tmp_path)  # the worker goes elsewhere
    monkeypatch.setattr(app_worker, "main", pretend)
    assert app_worker.work(json.dumps(request.data())) == 0
    room = tmp_path / "room"
    assert folders_of(path.relative_to(room) for path in room.rglob("*")) == {Path("renders")}
    with zipfile.ZipFile(room / "room.zip") as archive:
        assert folders_of(map(Path, archive.namelist())) == {Path("room/renders")}


def test_the_included_room_has_a_name_that_is_no_folder_of_this_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenes: list[Path] = []

    def noted(arguments: Sequence[str]) -> int:
        if arguments[0] == "reconstruct":
            scenes.append(Path(arguments[1]))
            assert (scenes[0] / "transforms.json").exists()
        return pretend(arguments)

    request = Request("example", [], str(tmp_path), asdict(RoomOptions()), asdict(Limits()))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(app_worker, "main", noted)
    assert app_worker.work(json.dumps(request.data())) == 0
    assert scenes == [Path("included_room")]

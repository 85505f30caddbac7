"""The worker of `semgs app`, with commands that only pretend: which photos a room has."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Literal

import pytest
from dropped_files import picture, written, zipped
from known_scenes import write_scene
from room_folders import write_reconstruction

from semgs.app.limits import Limits
from semgs.app.requests import Request, RoomOptions
from semgs.cli import app_worker
from semgs.data.confined import VARIABLE
from semgs.files.cache import VARIABLE as CACHE
from semgs.files.cache import cache_folder
from semgs.files.errors import ERROR_LINE

PHOTOS = (".jpg", ".png")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a test, this process is where it was and not confined, as the worker is."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setenv(CACHE, "")


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
    monkeypatch.setattr(app_worker, "main", noted)
    assert app_worker.work(json.dumps(request.data())) == 0
    assert scenes == [Path("included_room")]


def zip_of_a_scene(folder: Path, name: str, inside: str = "made") -> tuple[Request, Path]:
    """The request to make a room of a zip in which one photo has another name, and the folder of the job."""
    write_scene(folder / "made", 3, (24, 32))
    described = json.loads((folder / "made/transforms.json").read_text())
    described["frames"][1]["file_path"] = name
    (folder / "made/transforms.json").write_text(json.dumps(described))
    made = folder / "made"
    members = {f"{inside}/{one.relative_to(made).as_posix()}": one.read_bytes() for one in made.rglob("*.*")}
    upload = zipped(folder / "my.zip", members)
    job = folder / "job"
    job.mkdir()
    return Request("archive", [[str(upload.path), "my.zip"]], str(job), asdict(RoomOptions()), asdict(Limits())), job


@pytest.mark.parametrize("exists", [True, False])
@pytest.mark.parametrize("lead", ["", "../../../../../../../../../../../../.."])
def test_a_scene_that_names_a_photo_of_the_server_makes_no_room_and_says_nothing_of_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], exists: bool, lead: str
) -> None:
    secret = tmp_path / "secret.png"
    if exists:
        picture(secret, (32, 24))
    request, job = zip_of_a_scene(tmp_path, f"{lead}{secret}")
    assert app_worker.work(json.dumps(request.data())) == 2
    (line,) = [one for one in capsys.readouterr().err.splitlines() if one.startswith(ERROR_LINE)]
    shown = repr(f"{lead}{secret}")[:60]
    assert (
        line
        == f"{ERROR_LINE}scene/made/transforms.json: expected names of files inside the scene's folder, found {shown}"
    )
    assert not (job / "room").exists()
    assert not (job / "work/out").exists()


def test_the_worker_is_confined_to_the_zip_whose_cameras_it_reads_and_to_the_job_for_photos(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    confined: list[str] = []

    def noted(arguments: Sequence[str]) -> int:
        confined.append(os.environ[VARIABLE])
        return 2

    monkeypatch.setattr(app_worker, "main", noted)
    request, job = zip_of_a_scene(tmp_path, "images/001.png")
    assert app_worker.work(json.dumps(request.data())) == 2
    photos = [picture(tmp_path / f"{number}.jpg", seed=number) for number in range(2)]
    (tmp_path / "other").mkdir()
    request = replace(
        request, kind="photos", files=[[str(one.path), one.name] for one in photos], folder=str(tmp_path / "other")
    )
    assert app_worker.work(json.dumps(request.data())) == 2
    assert confined == [str((job / "work/scene").resolve()), str((tmp_path / "other/work").resolve())]


@pytest.mark.parametrize(("inside", "posed"), [("photos", True), ("made", True), ("photos", False)])
def test_only_photos_without_cameras_are_given_a_scale_whatever_their_folder_is_called(
    inside: str, posed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Sequence[str]] = []

    def noted(arguments: Sequence[str]) -> int:
        given.append(arguments)
        assert cache_folder() == job / "work/cache", "what is kept of the scene goes with its job"
        return 2

    monkeypatch.setattr(app_worker, "main", noted)
    request, job = zip_of_a_scene(tmp_path, "images/001.png", inside)
    if not posed:
        members = {
            f"{inside}/{number}.jpg": picture(tmp_path / f"{number}.jpg", seed=number).path.read_bytes()
            for number in range(2)
        }
        request = replace(request, files=[[str(zipped(tmp_path / "photos.zip", members).path), "photos.zip"]])
    request = replace(request, options=asdict(RoomOptions(first=1, second=2, metres=0.5)))
    assert app_worker.work(json.dumps(request.data())) == 2
    assert ("--scale-from" in given[0]) is not posed

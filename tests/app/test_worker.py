"""The worker of `semgs app`, with runs that only pretend: which photos a room has, which options it gets, and what the queue is told."""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Iterable
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, Literal

import pytest
from dropped_files import picture, written, zipped
from known_scenes import write_scene
from room_folders import write_reconstruction

from semgs.app import worker
from semgs.app.limits import Limits
from semgs.app.requests import Request, RoomOptions
from semgs.app.uploads import Prepared
from semgs.data.confined import VARIABLE
from semgs.files.paths import VARIABLE as CACHE
from semgs.files.paths import cache_folder
from semgs.run.export import Export
from semgs.run.options.depth_options import DepthOptions
from semgs.run.options.scene_options import PosingOptions
from semgs.run.options.segmenter_options import AnswerOptions, SegmenterOptions
from semgs.run.outcome import Outcome
from semgs.run.reconstruct import CHOOSING, Reconstruct
from semgs.run.steps.notes import UNKNOWN_SCALE
from semgs.run.usage_errors import UsageError
from semgs.runtime.notes import Progress
from semgs.sfm.solving import FOCAL_LENGTH

PHOTOS = (".jpg", ".png")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After a test, this process is where it was and not confined, as the worker is."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setenv(CACHE, "")


@pytest.fixture
def pretended(monkeypatch: pytest.MonkeyPatch) -> list[Reconstruct]:
    """What is reconstructed, and exported, in place of doing so."""
    runs: list[Reconstruct] = []

    def reconstruct(run: Reconstruct, progress: Progress) -> Outcome:
        """Write what is written for photos whose cameras were estimated."""
        runs.append(run)
        write_reconstruction(run.out)
        if not run.drop_photos:
            images = run.out / "cameras" / "images"
            images.mkdir(parents=True)
            for number in range(3):
                picture(images / f"{number:03d}.jpg")
        with progress.stage(CHOOSING(count=3)):
            return Outcome(notes=(UNKNOWN_SCALE(), FOCAL_LENGTH(focal="500 px, from EXIF"), "As it is."))

    def export(run: Export, progress: Progress) -> Outcome:
        run.out.mkdir()
        return Outcome()

    monkeypatch.setattr(Reconstruct, "run", reconstruct)
    monkeypatch.setattr(Export, "run", export)
    return runs


def told(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    """What the queue was told."""
    return [json.loads(line) for line in capsys.readouterr().err.splitlines()]


def folders_of(photos: Iterable[Path]) -> set[Path]:
    """The folders of those paths that are photos."""
    return {path.parent for path in photos if path.suffix in PHOTOS}


@pytest.mark.parametrize("kind", ["photos", "clip"])
def test_a_room_and_its_zip_have_the_views_that_they_show_and_no_other_photo(
    kind: Literal["photos", "clip"], tmp_path: Path, pretended: list[Reconstruct]
) -> None:
    uploads = [written(tmp_path / "a.mp4", b"x")]
    if kind == "photos":
        uploads = [picture(tmp_path / f"{number}.jpg", seed=number) for number in range(3)]
    files = [[str(one.path), one.name] for one in uploads]
    request = Request(kind, files, str(tmp_path), asdict(RoomOptions()), asdict(Limits()))
    assert worker.work(json.dumps(request.data())) == 0
    room = tmp_path / "room"
    assert folders_of(path.relative_to(room) for path in room.rglob("*")) == {Path("renders")}
    with zipfile.ZipFile(room / "room.zip") as archive:
        assert folders_of(map(Path, archive.namelist())) == {Path("room/renders")}


def test_the_included_room_has_a_name_that_is_no_folder_of_this_machine(
    tmp_path: Path, pretended: list[Reconstruct], capsys: pytest.CaptureFixture[str]
) -> None:
    request = Request("example", [], str(tmp_path), asdict(RoomOptions()), asdict(Limits()))
    assert worker.work(json.dumps(request.data())) == 0
    assert [run.scene for run in pretended] == [Path("included_room")]
    assert Path("included_room/transforms.json").exists()  # this process is in the working folder of the job


def test_stages_and_notes_are_in_words_of_the_page_and_none_of_the_command_line_alone_arrives(
    tmp_path: Path, pretended: list[Reconstruct], capsys: pytest.CaptureFixture[str]
) -> None:
    request = Request("example", [], str(tmp_path), asdict(RoomOptions()), asdict(Limits()))
    assert worker.work(json.dumps(request.data())) == 0
    assert [one["stage"] for one in told(capsys)] == [
        "Getting ready",
        "Choosing among 3 photos",
        "Writing files to download",
        "Making the page of your room",
    ]
    notes = json.loads((tmp_path / "room/room.json").read_text())["notes"]
    assert notes == [UNKNOWN_SCALE().on_page, "As it is."], "of the focal length from EXIF, nobody needs to know"


def test_the_options_of_the_page_become_those_of_the_reconstruction() -> None:
    options = RoomOptions(3, False, "seg.onnx", "mug, power socket", "sensor", 1, 4, 1.25)
    prepared = Prepared(Path("photos"), photos={1: "IMG_7.jpg", 4: "IMG_10.jpg"})
    assert worker.room_run(options, prepared, Path("out")) == Reconstruct(
        scene=Path("photos"),
        out=Path("out"),
        views=3,
        refine=0,
        drop_photos=True,
        segmenting=SegmenterOptions(segmenter="seg.onnx", answers=AnswerOptions(words=("mug", "power socket"))),
        placing=DepthOptions(depth="sensor"),
        posing=PosingOptions(scale_from=("IMG_7.jpg", "IMG_10.jpg", "1.25")),
    )
    plain = worker.room_run(RoomOptions(), prepared, Path("out"))
    assert plain == Reconstruct(scene=Path("photos"), out=Path("out"), drop_photos=True)


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
    assert worker.work(json.dumps(request.data())) == 2
    refused = told(capsys)[-1]["refused"]
    shown = repr(f"{lead}{secret}")[:60]
    assert refused.startswith("made/transforms.json: expected names of files inside the scene's folder, found ")
    assert shown.startswith(refused.rpartition("found ")[2].rstrip(".")[:20])
    assert not (job / "room").exists()
    assert not (job / "work/out").exists()


def test_the_worker_is_confined_to_the_zip_whose_cameras_it_reads_and_to_the_job_for_photos(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    confined: list[str] = []

    def noted(run: Reconstruct, progress: Progress) -> Outcome:
        confined.append(os.environ[VARIABLE])
        raise UsageError("enough")

    monkeypatch.setattr(Reconstruct, "run", noted)
    request, job = zip_of_a_scene(tmp_path, "images/001.png")
    assert worker.work(json.dumps(request.data())) == 2
    photos = [picture(tmp_path / f"{number}.jpg", seed=number) for number in range(2)]
    (tmp_path / "other").mkdir()
    request = replace(
        request, kind="photos", files=[[str(one.path), one.name] for one in photos], folder=str(tmp_path / "other")
    )
    assert worker.work(json.dumps(request.data())) == 2
    assert confined == [str((job / "work/scene").resolve()), str((tmp_path / "other/work").resolve())]


@pytest.mark.parametrize(("inside", "posed"), [("photos", True), ("made", True), ("photos", False)])
def test_only_photos_without_cameras_are_given_a_scale_whatever_their_folder_is_called(
    inside: str, posed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[Reconstruct] = []

    def noted(run: Reconstruct, progress: Progress) -> Outcome:
        given.append(run)
        assert cache_folder() == job / "work/cache", "what is kept of the scene goes with its job"
        raise UsageError("enough")

    monkeypatch.setattr(Reconstruct, "run", noted)
    request, job = zip_of_a_scene(tmp_path, "images/001.png", inside)
    if not posed:
        members = {
            f"{inside}/{number}.jpg": picture(tmp_path / f"{number}.jpg", seed=number).path.read_bytes()
            for number in range(2)
        }
        request = replace(request, files=[[str(zipped(tmp_path / "photos.zip", members).path), "photos.zip"]])
    request = replace(request, options=asdict(RoomOptions(first=1, second=2, metres=0.5)))
    assert worker.work(json.dumps(request.data())) == 2
    assert bool(given[0].posing.scale_from) is not posed

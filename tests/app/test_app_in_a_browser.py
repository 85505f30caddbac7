"""The app in a real browser: from dropped files to a room, and everything that can go wrong on the way."""

from __future__ import annotations

import json
import os
import re
import shutil
import time
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from app_server import App, drop, make_room, open_options, page_at, room_in, running_app, sentence_on
from dropped_files import picture, with_link, written, zipped
from PIL import Image
from ply import read_ply
from tunnels import tunnel_to
from turned_cameras import write_scene

if TYPE_CHECKING:
    from playwright.sync_api import Page

SECONDS = 60.0
"""From dropped photos to a labelled room, on two cores."""


@pytest.fixture(scope="module")
def app(tmp_path_factory: pytest.TempPathFactory) -> Iterator[App]:
    with running_app(tmp_path_factory.mktemp("app")) as running:
        yield running


@pytest.fixture
def fox(shared: Path, tmp_path: Path) -> list[Path]:
    """The photos of `fox`, without their cameras."""
    return [Path(shutil.copy(path, tmp_path)) for path in sorted((shared / "data/fox/images").glob("*.jpg"))]


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A zip of a small scene with cameras."""
    folder = write_scene(tmp_path / "scene")
    with zipfile.ZipFile(tmp_path / "scene.zip", "w") as archive:
        for path in folder.rglob("*"):
            archive.write(path, path.relative_to(folder.parent))
    return tmp_path / "scene.zip"


def test_the_page_opens_and_says_what_is_wrong_with_one_photo(tmp_path: Path):
    address = f"/?room={20 * 'a'}&theme=dark"
    with running_app(tmp_path / "app") as app, page_at(replace(app, url=app.url + address), (600, 390)) as page:
        assert sentence_on(page).startswith("This room is no longer here.")
        drop(page, [picture(tmp_path / "a.jpg").path])
        page.locator("ol.photos li", has_text="a.jpg").locator("img[src^='data:image/jpeg']").wait_for()
        make_room(page)
        page.get_by_text("One photo is not enough").wait_for()
        open_options(page)
        chosen = page.get_by_label("Classes from")
        chosen.wait_for()
        assert chosen.evaluate("input => input.scrollWidth <= input.clientWidth")  # all of the chosen name can be read
        assert page.evaluate("document.documentElement.scrollWidth") == 390


@pytest.mark.long
@pytest.mark.timeout(900)
def test_the_page_works_below_a_path_of_a_notebooks_proxy(tmp_path: Path):
    prefix = "/user/me@here/proxy/7860"
    with (
        running_app(tmp_path / "app") as app,
        tunnel_to(int(app.url.rsplit(":", 1)[1]), prefix=prefix) as port,
        page_at(replace(app, url=f"http://localhost:{port}{prefix}/")) as page,
    ):
        drop(page, [picture(tmp_path / "a.jpg").path])
        make_room(page)
        assert sentence_on(page).startswith("One photo is not enough")
        page.get_by_role("button", name="Try the included room").click()
        room_in(page)


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_photos_without_cameras_become_a_room_that_can_be_used_and_made_again_in_metres_without_an_upload(
    app: App, fox: list[Path], tmp_path: Path
):
    time.sleep(20)  # as a user, who does not drop photos in the second in which the app starts
    with page_at(app) as page:
        drop(page, fox)
        start = time.monotonic()
        make_room(page)
        page.locator("#status .now").first.wait_for()
        room = room_in(page)
        print(
            f"{time.monotonic() - start:.1f} s from dropping to the room. {page.locator('.status.done').inner_text()}"
        )
        scene = room.locator("#scene")
        scene.click()
        room.locator("#info").get_by_text("Confidence").wait_for()
        first = room.locator(".legend input").first
        first.uncheck()
        room.locator("#shown").filter(has_text="is shown", has_not_text="100 %").wait_for()
        with page.expect_download() as download:
            room.get_by_role("link", name="gaussians.ply").click()
        download.value.save_as(tmp_path / "gaussians.ply")
        assert len(read_ply(tmp_path / "gaussians.ply")) > 10_000
        page.reload()
        room_in(page)
        assert room.get_by_text("Photos alone do not show how large a room is").count() == 1
        folder = job_folder(app, page)
        assert not list((folder / "room").rglob("*.jpg"))  # photos that the room does not show
        names = {path.name for path in fox}
        assert {view["name"].rsplit("/")[-1] for view in report_of(app, page)["views"]} < names

        uploads: list[str] = []
        page.on("request", lambda request: uploads.append(request.url) if "/upload" in request.url else None)
        page.get_by_role("button", name="Change options").click()
        page.get_by_label("Refine").uncheck()
        page.get_by_label("First photo").fill("1")
        page.get_by_label("Second photo").fill("40")
        page.get_by_label("Metres between them").fill("0.5")
        again = page.get_by_role("button", name="Make it again", exact=True)
        again.click()
        assert sentence_on(page).startswith("Photo 40 cannot give the scale")
        assert job_folder(app, page) == folder  # the room is there as before
        page.get_by_label("Second photo").fill(str(len(fox)))
        again.click()
        page.locator("#status .now").first.wait_for()
        room_in(page)
        report = report_of(app, page)
        assert (report["scene"]["unit"], report["refinement"], uploads) == ("metric", None, [])
        assert [path.name for path in folder.iterdir()] == ["room"]


@pytest.mark.long
@pytest.mark.timeout(900)
def test_the_included_room_has_boxes_sizes_and_a_refinement(app: App):
    with page_at(app) as page:
        page.get_by_role("button", name="Try the included room").click()
        room = room_in(page)
        room.get_by_role("button", name="Boxes").click()
        room.get_by_text("Before and after refinement").wait_for()
        scene = room.locator("#scene")
        box = scene.bounding_box()
        assert box is not None
        scene.click(position={"x": 0.62 * box["width"], "y": 0.5 * box["height"]})
        room.locator("#info").get_by_text("(length × width × height)").wait_for()


@pytest.mark.long
@pytest.mark.timeout(900)
def test_on_a_phone_time_moves_without_requests_and_then_the_room_comes_first(app: App):
    with page_at(app, (844, 390)) as page:
        page.get_by_role("button", name="Try the included room").click()
        clock = page.locator("#status .now .clock").first
        clock.wait_for()
        requests: list[str] = []
        page.on("request", lambda request: requests.append(request.url))
        seen = set()
        while not seen > {"1 s", "2 s", "3 s"}:
            seen |= set(page.locator("#status .clock").all_inner_texts())
            assert page.locator("iframe.room").count() or not requests
        scene = room_in(page).locator("#scene")
        box = scene.bounding_box()
        assert box is not None
        assert box["y"] + 0.75 * box["height"] < 844
        assert page.evaluate("[scrollY, document.documentElement.scrollWidth]") == [0, 390]


@pytest.mark.long
@pytest.mark.timeout(300)
def test_numbers_and_pictures_follow_the_list_of_dropped_photos(app: App, tmp_path: Path):
    names = ["b.jpg", "a.jpg", "c.png"]
    files = [picture(tmp_path / name, seed=seed).path for seed, name in enumerate(names)]
    files[2].write_bytes(b"damaged")
    with page_at(app) as page:
        tiles = page.locator("#ask ol.photos li")
        drop(page, files)
        tiles.nth(2).wait_for()
        page.locator("#ask ol.photos img[src^='data:image/jpeg']").nth(1).wait_for()
        assert tiles.all_inner_texts() == names
        page.wait_for_function(
            "document.querySelectorAll('#ask ol.photos img').length === 2"
        )  # none of the damaged one
        page.locator("#drop .file-preview tr").first.get_by_role("button", name="Remove this file").click()
        page.wait_for_function("document.querySelectorAll('#ask ol.photos li').length === 2")
        assert tiles.all_inner_texts() == names[1:]
        page.get_by_role("button", name="Clear").click()
        tiles.first.wait_for(state="detached")


@pytest.fixture
def heic(fox: list[Path], tmp_path: Path) -> list[Path]:
    """Six of the photos as an iPhone writes them."""
    pillow_heif = pytest.importorskip("pillow_heif")
    paths = []
    for path in fox[::2]:
        with Image.open(path) as image:
            file = pillow_heif.from_pillow(image)
        paths.append(tmp_path / f"IMG_{len(paths)}.HEIC")
        file.save(paths[-1], quality=90)
    return paths


@pytest.mark.long
@pytest.mark.timeout(900)
def test_photos_of_a_phone_with_a_known_distance_become_a_room_in_metres(app: App, heic: list[Path]):
    with page_at(app) as page:
        drop(page, heic)
        open_options(page)
        page.get_by_label("First photo").fill("1")
        page.get_by_label("Second photo").fill("6")
        page.get_by_label("Metres between them").fill("1.5")
        make_room(page)
        room = room_in(page)
        room.locator("#scene").click()
        room.locator("#info").get_by_text(re.compile(r"\bm\b")).first.wait_for()
        assert report_of(app, page)["scene"]["unit"] == "metric"


@pytest.mark.long
@pytest.mark.timeout(900)
def test_a_clip_becomes_a_room(app: App, fox: list[Path], tmp_path: Path):
    import cv2

    frames = [cv2.imread(str(path)) for path in fox]
    height, width = frames[0].shape[0] // 2, frames[0].shape[1] // 2
    clip = cv2.VideoWriter(str(tmp_path / "clip.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 2, (width, height))
    for frame in frames:
        clip.write(cv2.resize(frame, (width, height), interpolation=cv2.INTER_AREA))
    clip.release()
    with page_at(app) as page:
        drop(page, [tmp_path / "clip.mp4"])
        make_room(page)
        page.get_by_text("Working on a clip").wait_for()
        assert room_in(page).get_by_text("Photos alone do not show how large a room is").count() == 1


@pytest.mark.long
@pytest.mark.timeout(900)
def test_a_segmenter_that_the_server_offers_says_the_classes(shared: Path, scene: Path, tmp_path: Path):
    pytest.importorskip("ai_edge_litert")
    network = Path(shutil.copy(shared / "pretrained/mosaic_ade32.tflite", tmp_path / "mosaic.tflite"))
    network.with_suffix(".json").write_text(json.dumps(MOSAIC))
    with running_app(tmp_path / "app", "--segmenter", os.path.relpath(network)) as app, page_at(app) as page:
        drop(page, [scene])
        open_options(page)
        page.get_by_label("Classes from").click()
        page.get_by_role("option", name="mosaic.tflite", exact=True).click()
        make_room(page)
        room_in(page)
        report = report_of(app, page)
        assert "mosaic" in report["model"]["segmenter"]
        assert str(tmp_path) not in json.dumps(report)


@pytest.mark.long
@pytest.mark.timeout(900)
def test_words_without_a_segmenter_and_half_a_scale_get_a_sentence(app: App, scene: Path):
    with page_at(app) as page:
        drop(page, [scene])
        open_options(page)
        page.get_by_label("Words").fill("chair, mug")
        make_room(page)
        assert sentence_on(page).startswith("Words need a segmenter")
        page.get_by_label("Words").fill("")
        page.get_by_label("Metres between them").fill("2")
        make_room(page)
        page.get_by_text("For the scale, give two photos by number").wait_for()


def job_folder(app: App, page: Page) -> Path:
    """The folder of the job whose room the page shows."""
    return app.folder / "rooms" / page.url.split("room=")[1]


def report_of(app: App, page: Page) -> dict[str, Any]:
    """The report of the room that the page shows."""
    report: dict[str, Any] = json.loads((job_folder(app, page) / "room/report.json").read_text())
    return report


MOSAIC = {
    "size": [512, 512], "scaling": {"offset": 0, "scale": 1}, "layout": "NHWC", "dtype": "uint8", "output": "logits",
    "tensor": "decoder/add", "licence": "Apache-2.0",
    "classes": [
        "background", "wall", "building", "sky", "floor", "tree", "ceiling", "road", "bed", "window", "grass", "cabinet", "sidewalk",
        "person", "earth", "door", "table", "mountain", "plant", "curtain", "chair", "car", "water", "painting", "sofa", "shelf",
        "house", "sea", "mirror", "rug", "field", "armchair",
    ],
}  # fmt: skip
"""The description of MOSAIC's file."""


@pytest.mark.long
@pytest.mark.timeout(900)
def test_two_jobs_wait_for_one_another_and_one_can_be_cancelled(app: App, scene: Path, tmp_path: Path):
    with page_at(app) as page:
        other = page.context.new_page()
        other.goto(app.url)
        page.get_by_role("button", name="Try the included room").click()
        page.get_by_text("Working on").wait_for()
        drop(other, [scene])
        make_room(other)
        other.get_by_text("1 room is before yours").wait_for()
        page.get_by_role("button", name="Cancel").click()
        page.get_by_text("Cancelled").wait_for()
        assert "room=" not in page.url
        room_in(other)
        other.get_by_role("button", name="Make another room").click()
        other.get_by_role("button", name="Make the room").wait_for()


def cut_off_clip(path: Path) -> Path:
    path.write_bytes(b"\0\0\0\x18ftypmp42" + bytes(1000))
    return path


def copies(folder: Path) -> list[Path]:
    """One photo three times."""
    first = picture(folder / "a.jpg", (400, 300)).path
    return [first, *(Path(shutil.copy(first, folder / f"{n}.jpg")) for n in range(2))]


def noise(folder: Path) -> list[Path]:
    """Photos that share nothing."""
    return [picture(folder / f"{n}.jpg", (400, 300), n).path for n in range(3)]


def blank(folder: Path) -> list[Path]:
    for n in range(2):
        Image.new("RGB", (300, 200), (0, 0, n)).save(folder / f"{n}.png")
    return [folder / f"{n}.png" for n in range(2)]


def cameras_as(folder: Path, change) -> list[Path]:  # type: ignore[no-untyped-def]
    """A zip of a scene with a changed description."""
    scene = write_scene(folder / "scene", change)
    with zipfile.ZipFile(folder / "a.zip", "w") as archive:
        for path in scene.rglob("*"):
            archive.write(path, path.relative_to(scene.parent))
    return [folder / "a.zip"]


def set_in(key: str, value: object):  # type: ignore[no-untyped-def]
    return lambda description: description.__setitem__(key, value)


WRONG = {
    "text": lambda folder: [written(folder / "a.txt", b"hello").path],
    "one photo": lambda folder: [picture(folder / "a.jpg").path],
    "broken photos": lambda folder: [written(folder / f"{n}.jpg", b"junk").path for n in range(2)],
    "copies of one photo": copies,
    "photos that share nothing": noise,
    "black photos": blank,
    "panoramas": lambda folder: [picture(folder / f"{n}.jpg", (900, 100), n).path for n in range(2)],
    "tiny photos": lambda folder: [picture(folder / f"{n}.jpg", (3, 2), n).path for n in range(2)],
    "a clip that is none": lambda folder: [written(folder / "a.mp4", b"junk" * 100).path],
    "a clip that is cut off": lambda folder: [cut_off_clip(folder / "a.mov")],
    "a photo and a clip": lambda folder: [picture(folder / "a.jpg").path, written(folder / "b.mp4", b"x").path],
    "a zip that is none": lambda folder: [written(folder / "a.zip", b"junk").path],
    "a zip of nothing": lambda folder: [zipped(folder / "a.zip", {}).path],
    "a zip of texts": lambda folder: [zipped(folder / "a.zip", {"a.txt": b"x"}).path],
    "a zip with a link": lambda folder: [with_link(folder / "a.zip").path],
    "a zip that leads outside": lambda folder: [zipped(folder / "a.zip", {"../a": b"x"}).path],
    "no frames": lambda folder: cameras_as(folder, set_in("frames", [])),
    "frames of another type": lambda folder: cameras_as(folder, set_in("frames", "none")),
    "a negative focal length": lambda folder: cameras_as(folder, set_in("fl_x", -1.0)),
    "a description that is no JSON": lambda folder: [zipped(folder / "a.zip", {"transforms.json": b"{"}).path],
    "photos that are missing": lambda folder: [zipped(folder / "a.zip", {"transforms.json": b'{"frames": [{"file_path": "a.jpg"}]}'}).path],
}  # fmt: skip
"""What is wrong, and the files."""


@pytest.mark.long
@pytest.mark.timeout(1800)
def test_wrong_inputs_get_a_sentence_and_never_a_traceback(app: App, tmp_path: Path):
    sentences = {}
    for name, make in WRONG.items():
        folder = tmp_path / name.replace(" ", "_")
        folder.mkdir()
        with page_at(app) as page:
            drop(page, make(folder))
            make_room(page)
            sentences[name] = sentence_on(page)
    print(*(f"{name}: {sentence}" for name, sentence in sentences.items()), sep="\n")
    for name, sentence in sentences.items():
        assert sentence.endswith((".", "!", "?")), (name, sentence)
        assert not any(
            word in sentence for word in ("Traceback", "Error", str(tmp_path), str(app.folder), "bug", "--")
        ), (name, sentence)
    assert list((app.folder / "rooms").glob("*/work")) == []


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_fifty_jobs_in_a_row_leave_memory_flat_and_no_files(app: App, scene: Path):
    status = Path(f"/proc/{app.process.pid}/status")
    if not status.exists():
        pytest.skip("memory is read from /proc, which is not here")
    memory = []
    before = {path for path in (app.folder / "rooms").iterdir() if path.is_dir()}
    with page_at(app) as page:
        for number in range(50):
            drop(page, [scene])
            make_room(page)
            if number % 2:
                page.get_by_role("button", name="Cancel").click()
                page.get_by_text("Cancelled").wait_for()
                page.reload()
            else:
                page.locator("iframe.room").wait_for()
                page.get_by_role("button", name="Make another room").click()
            page.get_by_role("button", name="Make the room").wait_for()
            memory.append(int(re.findall(r"VmRSS:\s+(\d+) kB", status.read_text())[0]) / 1000)
        time.sleep(5)
    print("memory of the server [MB]:", np.round(memory[::7]))
    assert np.median(memory[-10:]) < np.median(memory[5:15]) + 30
    rooms = {path for path in (app.folder / "rooms").iterdir() if path.is_dir()} - before
    assert len(rooms) == 25
    assert all(sorted(path.name for path in room.iterdir()) == ["files", "room"] for room in rooms)


@pytest.mark.long
def test_with_another_host_the_token_opens_the_page_and_nothing_else_does(tmp_path: Path):
    from urllib.error import HTTPError
    from urllib.request import urlopen

    with running_app(tmp_path / "app", "--host", "0.0.0.0") as app:
        address = app.url.split("/?")[0].rsplit(":", 1)
        with pytest.raises(HTTPError, match="403"):
            urlopen(f"http://127.0.0.1:{address[1]}/")
        with pytest.raises(HTTPError, match="403"):
            urlopen(f"http://127.0.0.1:{address[1]}/gradio_api/info?token=x")
        local = App(f"http://127.0.0.1:{address[1]}/?{app.url.split('?')[1]}", app.process, app.folder)
        with page_at(local) as page:
            assert "token" not in page.url

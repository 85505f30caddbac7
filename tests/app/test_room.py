"""The page of a room: what it says, what it offers, and what it does in a browser."""

from __future__ import annotations

import functools
import http.server
import json
import threading
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chromium import page_of
from room_folders import write_reconstruction

from semgs.app.room import plain_note, write_room
from semgs.scene.scene_file import FILE_NAME, load_scene, save_scene


@contextmanager
def served(folder: Path) -> Iterator[str]:
    """The address of a folder, on this machine."""

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *words: object) -> None: ...

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}"
        finally:
            server.shutdown()
            thread.join()


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = write_reconstruction(tmp_path_factory.mktemp("room") / "out", refined=True)
    write_room(folder, "My <room>", ["b.jpg is damaged and was left out."])
    return folder


def test_the_page_offers_what_there_is_and_the_zip_has_all_of_it(room: Path):
    page = (room / "index.html").read_text()
    assert "My &lt;room&gt;" in page
    assert '<a href="gaussians.ply" download>' in page
    assert "points.ply" not in page
    with zipfile.ZipFile(room / "room.zip") as archive:
        names = set(archive.namelist())
    assert {"room/index.html", "room/scene.html", "room/gaussians.ply", "room/renders/context_000_image.png"} <= names
    assert "room/room.zip" not in names


def test_a_thing_has_the_coordinates_that_a_click_on_it_has_also_far_from_the_origin_of_the_poses(tmp_path: Path):
    centres = {}
    for origin in ((0.0, 0.0, 0.0), (5000.0, -2000.0, 300.0)):
        folder = write_reconstruction(tmp_path / f"{origin[0]:.0f}")
        save_scene(folder / FILE_NAME, replace(load_scene(folder), origin=origin))
        write_room(folder)
        centres[origin] = json.loads((folder / "room.json").read_text())["things"]["1"]["centre"]
    near, far = (np.array(centre) for centre in centres.values())
    np.testing.assert_allclose(far - near, (5000.0, -2000.0, 300.0), atol=0.002)


def test_the_report_opens_where_the_files_are_that_it_links_to(tmp_path: Path):
    folder = write_reconstruction(tmp_path / "out")
    (folder / "report.html").write_text("report")
    write_room(folder)
    assert '<a href="report.html" target="_blank">' in (folder / "index.html").read_text()


def test_notes_are_in_plain_words_and_escaped_and_none_is_lost(room: Path):
    notes = json.loads((room / "room.json").read_text())["notes"]
    assert notes[0] == "b.jpg is damaged and was left out."
    assert notes[1].startswith("Only 2 of 3 photos could be placed")
    assert notes[2].startswith("Photos alone do not show how large a room is")
    assert notes[3:] == ["Something <b>new</b>.", "Fix it with --size."]
    assert "Something &lt;b&gt;new&lt;/b&gt;." in (room / "index.html").read_text()


@pytest.mark.parametrize(
    ("note", "shown"),
    [
        (
            "The cameras are slightly wrong: matches miss by 2.1 px. --refine-poses corrects that.",
            "The cameras are slightly wrong: matches miss by 2.1 px.",
        ),
        (
            "The sensor's depth does not fit the model's: a, b. Its unit (see --depth-unit) or the poses may be wrong.",
            "The sensor's depth does not fit the model's: a, b. Its unit or the poses may be wrong.",
        ),
        (
            "Depth is another (it fits if it is multiplied by 0.001; see --depth-unit); the poses fit.",
            "Depth is another (it fits if it is multiplied by 0.001); the poses fit.",
        ),
        (
            "Depth is looked for between 0.5 and 15 m, as in rooms. If the unit is not metres, say so: --unit unknown.",
            "Depth is looked for between 0.5 and 15 m, as in rooms. If the unit is not metres, say so.",
        ),
        ("The focal length is 500 px, solved. So few photos can get it wrong: if you know it, give it with --focal.",
         "The focal length is 500 px, solved. So few photos can get it wrong."),
        ("Use --anything.", "Use --anything."),
        ("A dash -- like this -- is no option.", "A dash -- like this -- is no option."),
    ],
)  # fmt: skip
def test_a_warning_keeps_all_but_the_options_of_the_command_line(note: str, shown: str):
    assert plain_note(note) == shown


def test_a_guessed_focal_length_is_told():
    assert plain_note("The focal length is a guess: 500 px. Two photos do not show it.").startswith(
        "The photos do not say"
    )
    assert plain_note("The focal length is 500 px, from EXIF.") == ""


def test_a_note_that_all_photos_were_placed_is_no_news():
    assert plain_note("The cameras of 3 of 3 photos were estimated from the photos.") == ""


@pytest.mark.long
def test_a_room_in_a_browser_hides_classes_names_what_is_clicked_and_measures(room: Path):
    with served(room) as address, page_of((700, 420), offline=False) as page:
        page.goto(f"{address}/index.html")
        page.locator("body[data-ready]").wait_for()
        scene, info = page.locator("#scene"), page.locator("#info")
        box = scene.bounding_box()
        assert box is not None
        on_wall = {"x": 0.35 * box["width"], "y": 0.4 * box["height"]}
        on_chair = {"x": 0.66 * box["width"], "y": 0.5 * box["height"]}
        scene.click(position=on_wall)
        info.get_by_text("wall", exact=True).wait_for()
        assert "80 %" in info.inner_text()
        page.get_by_role("button", name="Back to the photos").click()
        page.get_by_role("button", name="Stay near").click()
        page.get_by_role("button", name="Stay near", pressed=False).click()
        page.get_by_role("button", name="Measure").click()
        scene.click(position=on_wall)
        info.get_by_text("Click the second point.").wait_for()
        scene.click(position=on_chair)
        info.get_by_text("chair", exact=True).wait_for()
        distance = float(info.locator("dd").first.inner_text().split()[0])
        assert 0.3 < distance < 1.5
        page.get_by_role("button", name="Measure").click()
        page.get_by_label("wall").uncheck()
        page.get_by_text("40 % of the scene is shown.").wait_for()
        scene.click(position=on_wall)
        info.get_by_text("Nothing", exact=False).wait_for()
        page.locator("#confidence").fill("9")
        page.get_by_text("0 % of the scene is shown.", exact=True).wait_for()

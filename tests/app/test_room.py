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

from semgs.app.room import write_room
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
    write_room(folder, "My <room>", ["b.jpg is damaged and was left out.", "Something <b>new</b>."])
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


def test_notes_are_escaped_and_none_is_lost(room: Path):
    assert json.loads((room / "room.json").read_text())["notes"] == [
        "b.jpg is damaged and was left out.",
        "Something <b>new</b>.",
    ]
    assert "Something &lt;b&gt;new&lt;/b&gt;." in (room / "index.html").read_text()


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

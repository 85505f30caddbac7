"""The page and the table of a batch."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest
from chromium import page_of

from semgs.batch.overview import Scene, scene_of, write_overview
from semgs.batch.records import PICTURES, Record
from semgs.files.images.pictures import jpeg_bytes

SCORES = {"psnr": 21.53, "miou": 0.4, "gaussians": 38400.0}


def some_scenes(out: Path, count: int) -> list[Scene]:
    """Every tenth failed, the last one waits; PSNR falls with the number."""
    (out / PICTURES).mkdir()
    picture = jpeg_bytes(np.full((30, 40, 3), 128, np.uint8), 80)
    scenes = []
    for k in range(count):
        name = f"scene{k}"
        record = Record(name, "x", 0, "", 3.21, {**SCORES, "psnr": 30 - k / count}, ("dark <b>",) if k % 3 == 1 else ())
        if k % 10 == 5:
            record = Record(name, "x", 2, f"scans/{name}: no photos")
        else:
            (out / name).mkdir()
            (out / name / "report.html").touch()
            (out / PICTURES / f"{name}.jpg").write_bytes(picture)
        scenes.append(scene_of(out, name, name, None if k == count - 1 else record))
    return scenes


def test_the_table_has_a_row_for_each_scene_with_all_numbers(tmp_path: Path):
    write_overview(tmp_path, "reconstruct", some_scenes(tmp_path, 8))
    rows = list(csv.DictReader((tmp_path / "index.csv").read_text().splitlines()))
    assert [row["state"] for row in rows] == ["done"] * 5 + ["failed", "done", "waiting"]
    assert rows[1] == {
        "scene": "scene1", "state": "done", "psnr": "29.875", "miou": "0.4", "gaussians": "38400.0", "seconds": "3.21",
        "result": "scene1/report.html", "picture": "pictures/scene1.jpg", "notes": "dark <b>",
    }  # fmt: skip
    assert rows[5]["notes"] == "scans/scene5: no photos"
    assert (rows[5]["psnr"], rows[5]["result"], rows[7]["seconds"]) == ("", "", "")


def test_the_page_links_to_each_result_and_loads_nothing_from_elsewhere(tmp_path: Path):
    (tmp_path / "a b?").mkdir()
    record = Record("a b?", "x", 3, notes=("<script>",))
    write_overview(tmp_path, "doctor", [scene_of(tmp_path, "a b?", "a b?", record)])
    text = (tmp_path / "index.html").read_text()
    assert 'href="a%20b%3F/"' in text
    assert "&lt;script&gt;" in text
    assert "wrong cameras" in text
    assert not re.search(r"https?:|//", text.replace("// ", ""))


@pytest.mark.long
def test_two_thousand_scenes_open_in_two_seconds_and_can_be_sorted_and_filtered(tmp_path: Path):
    write_overview(tmp_path, "reconstruct", some_scenes(tmp_path, 2000))
    with page_of((800, 1280)) as page:
        start = perf_counter()
        page.goto((tmp_path / "index.html").as_uri())
        page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        assert perf_counter() - start < 2
        rows = page.locator("tbody tr:visible")
        assert rows.count() == 100
        page.keyboard.press("Tab")
        page.get_by_role("button", name="PSNR").press("Enter")
        assert rows.first.inner_text().startswith("\tscene1998")
        page.get_by_role("button", name="PSNR").press("Enter")
        assert rows.first.inner_text().startswith("\tscene0")
        page.get_by_label("State").select_option("failed")
        assert page.locator("output").inner_text() == "200 of 2000 scenes"
        page.get_by_label("Filter").fill("scene1995 PHOTOS")
        assert rows.count() == 1
        page.get_by_label("Filter").fill("")
        page.get_by_label("State").select_option("")
        for _ in range(3):
            page.mouse.wheel(0, 20000)
            page.wait_for_timeout(200)
        assert rows.count() > 200
        assert page.locator("img[alt=scene0]").count() == 1


def test_an_export_of_some_of_the_formats_is_partly_done_and_says_which_not(tmp_path: Path):
    (tmp_path / "a").mkdir()
    record = Record("a", "x", 3, "--as occupancy is not written: no clear floor")
    write_overview(tmp_path, "export", [scene_of(tmp_path, "a", "a", record)])
    (row,) = csv.DictReader((tmp_path / "index.csv").read_text().splitlines())
    assert (row["state"], row["notes"], row["result"]) == ("partly done", record.why, "a/")
    assert record.succeeded

"""What the page says about photos and rooms."""

from __future__ import annotations

import asyncio
import re
import time
from base64 import b64decode
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from semgs.app import page
from semgs.app.jobs import Job, Stage
from semgs.app.limits import Limits
from semgs.app.page import may_repeat, numbered_photos, privacy_statement, status_text
from semgs.app.requests import Request
from semgs.app.uploads import Upload

SIX_HOURS = Limits(kept_seconds=6 * 3600.0)


def test_a_server_says_which_photos_stay_and_for_how_long() -> None:
    said = privacy_statement(local=False, limits=SIX_HOURS)
    assert "except small copies of those that the room shows" in said
    assert "deleted an hour after the room is ready, or was made again, except small copies" in said
    assert said.endswith("the room is deleted after 6 hours.")
    short = privacy_statement(local=False, limits=Limits(kept_seconds=1200.0))
    assert "deleted 20 minutes after the room is ready" in short  # they go with the room
    assert privacy_statement(local=True, limits=SIX_HOURS) == "Your photos stay on this computer."


def test_a_room_that_is_ready_says_how_long_it_is_kept() -> None:
    job = Job("x", Path(), Request("example", [], "", {}), "a zip", state="done", started=10.0, ended=13.0)
    assert "Ready after 3 s. The room is kept for 6 hours at this address." in status_text(job, SIX_HOURS)


def test_of_very_many_uploads_that_somebody_follows_only_the_newest_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """gradio keeps something for each identifier that a browser asks for, for ever."""
    monkeypatch.setattr(page, "MOST_FOLLOWED", 3)
    kept = page.Newest(list)
    for name in "abcda":
        kept[name].append(name)
    assert dict(kept) == {"c": ["c"], "d": ["d"], "a": ["a"]}


def test_a_running_stage_says_for_how_long_it_has_run_so_that_the_browser_can_count_on() -> None:
    now = time.time()
    stages = [Stage("Reading", now - 9.0, 4.0), Stage("Rendering", now - 5.0)]
    job = Job("x", Path(), Request("example", [], "", {}), "a zip", state="working", started=now - 9.0, stages=stages)
    clocks = [float(seconds) for seconds in re.findall(r'data-seconds="([\d.]+)"', status_text(job, SIX_HOURS))]
    assert [round(seconds) for seconds in clocks] == [9, 5]  # all of it, and the stage
    assert "<time>4.0 s</time>" in status_text(job, SIX_HOURS)


def test_a_room_with_wrong_options_for_another_one_says_so() -> None:
    job = Job("x", Path(), Request("example", [], "", {}), "a zip", state="done")
    assert "Choose all photos, or 2 to 4 of them." in status_text(
        job, SIX_HOURS, sentence="Choose all photos, or 2 to 4 of them."
    )


def test_on_a_server_only_the_page_that_made_a_room_makes_it_again() -> None:
    job = Job("x", Path(), Request("example", [], "", {"views": 2}), "a zip", state="done", page="mine")
    assert [may_repeat(job, page, local=False) for page in ("mine", "another", "")] == [True, False, False]
    assert may_repeat(job, "another", local=True)
    job.page = ""
    assert not may_repeat(job, "", local=False)
    job.state = "failed"
    assert not may_repeat(job, "mine", local=True)


def test_names_of_photos_are_text_and_a_clip_has_no_numbers() -> None:
    uploads = [Upload(Path("000.jpg"), "<b>1.jpg"), Upload(Path("001.heic"), "Küche.HEIC")]
    items = "<li><span>&lt;b&gt;1.jpg</span></li><li><span>Küche.HEIC</span></li>"
    assert numbered_photos(uploads) == f'<ol class="photos">{items}</ol>'
    assert numbered_photos([Upload(Path("000.mp4"), "a.mp4")]) == '<ol class="photos"></ol>'


def test_an_answer_that_is_no_longer_needed_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two streams of a page: gradio ends the one that gets the last message, and keeps the other."""
    monkeypatch.setattr(page, "IDLE_SECONDS", 0.01)

    async def waited(needed: list[bool], sent: float) -> tuple[str, list[bool]]:
        async def receive() -> dict[str, str]:
            await asyncio.sleep(sent)
            return {"type": "http.request"}

        message = await page.while_needed(receive, lambda: needed.pop(0))()
        return message["type"], needed

    assert asyncio.run(waited([True, False, True, False, False, True], 60.0)) == ("http.disconnect", [True])
    assert asyncio.run(waited([False], 0.0)) == ("http.request", [False])


def test_when_a_browser_goes_away_the_task_that_signals_life_to_it_ends_and_no_other() -> None:
    async def left(session: str) -> list[bool]:
        tasks = []
        for session_hash in ("a1", "b2"):

            async def heartbeat(session_hash: str = session_hash) -> None:  # named as gradio names it
                while session_hash:
                    await asyncio.sleep(15)

            tasks.append(asyncio.create_task(heartbeat()))
        await asyncio.sleep(0)
        page.end_heartbeats(session)
        await asyncio.sleep(0)
        return [task.cancelled() for task in tasks]

    assert asyncio.run(left("a1")) == [True, False]


@pytest.mark.parametrize(("end", "kept"), [("--a--\r\n", ["photo"]), ("--a\r\n", ["photo"]), ("", [])])
def test_an_upload_that_does_not_end_leaves_no_file(
    end: str, kept: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    gradio = pytest.importorskip("gradio", reason="gradio is not installed; make .venv/app installs it")
    from gradio import queueing, route_utils, routes
    from starlette.datastructures import Headers

    for module, names in (
        (route_utils, ("GradioMultiPartParser", "GradioUploadFile", "traceback")),
        (queueing, ("traceback",)),
        (routes, ("traceback",)),
    ):
        for name in names:
            monkeypatch.setattr(module, name, getattr(module, name))
    monkeypatch.setattr(gradio.File, "_process_single_file", gradio.File._process_single_file)
    page._restrain(gradio, Limits())
    body = f'--a\r\nContent-Disposition: form-data; name="files"; filename="a.jpg"\r\n\r\nphoto\r\n{end}'

    async def stream() -> AsyncIterator[bytes]:
        yield body.encode()

    headers = Headers({"content-type": "multipart/form-data; boundary=a"})
    parser = route_utils.GradioMultiPartParser(headers, stream(), max_file_size=1000, upload_dir=str(tmp_path))
    form = asyncio.run(parser.parse())
    assert len(form.multi_items()) == len(kept)
    assert [path.read_text() for path in tmp_path.iterdir()] == kept


def test_gradio_remembers_no_upload_for_ever():
    paths = page.Forgetful()
    paths.update({"a", "b"})
    assert len(paths) == 0


def test_the_page_shows_where_to_stand():
    """A drawing in the page itself, so that nothing is loaded from elsewhere."""
    drawing = page.HEAD.format(privacy="", drawing=page._drawing()).split("base64,")[1].split('"')[0]
    assert b64decode(drawing).startswith(b"<svg")

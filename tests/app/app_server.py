"""The app as a user starts it, and a page of it in a browser."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from chromium import page_of

if TYPE_CHECKING:
    from playwright.sync_api import FrameLocator, Page

LEFT = "BodyStreamBuffer was aborted|Connection errored out"
"""What gradio says when a page is left while it listens to the server."""

UNKNOWN = rf"{LEFT}|Failed to load resource: the server responded with a status of 404"


@dataclass(frozen=True)
class App:
    """A running app.

    Attributes:
        url: its address.
        process: of its server.
        folder: with its rooms and uploads.
    """

    url: str
    process: subprocess.Popen[str]
    folder: Path


@contextmanager
def running_app(folder: Path, *options: str) -> Iterator[App]:
    """`semgs app`, until the end of the block; the test is skipped where gradio is not installed."""
    pytest.importorskip("gradio", reason="gradio is not installed; pip install '.[app]' in SemGS's folder")
    command = [sys.executable, "-m", "semgs", "app", "--port", "0", "--folder", str(folder), *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    lines: list[str] = []
    rest = threading.Thread(target=lambda: lines.extend(process.stdout or ()), daemon=True)
    try:
        for line in process.stdout:
            lines.append(line)
            if found := re.search(r"Open (http://\S+) in a browser", line):
                break
        else:
            raise AssertionError("".join(lines))
        rest.start()
        yield App(found[1], process, folder)
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(120)
        if rest.ident is not None:
            rest.join(120)
        process.stdout.close()
    assert not [line for line in lines if "Traceback" in line], "".join(lines)


@contextmanager
def page_at(app: App, size: tuple[int, int] = (900, 1200)) -> Iterator[Page]:
    """The page of the app in a browser."""
    with page_of(size, offline=False, known=UNKNOWN) as page:
        page.goto(app.url)
        page.get_by_role("button", name="Make the room").wait_for()
        yield page


def drop(page: Page, paths: Sequence[Path]) -> None:
    """Drop files, and wait until they are uploaded."""
    page.locator("#drop input[type=file]").set_input_files(list(map(str, paths)))
    page.locator("#drop .file-preview tr").nth(len(paths) - 1).wait_for()


def open_options(page: Page) -> None:
    """Unfold the options, and wait until they can be filled in: gradio loads their scripts only now."""
    page.get_by_role("button", name="Options").click()
    page.get_by_label("Words").wait_for()
    page.wait_for_load_state("networkidle")


def make_room(page: Page) -> None:
    """Press the button."""
    page.get_by_role("button", name="Make the room").click()


def room_in(page: Page) -> FrameLocator:
    """The room, as soon as it can be used."""
    page.locator("iframe.room").wait_for(timeout=600_000)
    room = page.frame_locator("iframe.room")
    room.locator("body[data-ready]").wait_for()
    return room


def sentence_on(page: Page) -> str:
    """The error that the page shows."""
    alert = page.locator("[role=alert].error")
    alert.wait_for()
    return alert.inner_text()

"""A headless browser for tests: Chromium with WebGL in software."""

from __future__ import annotations

import io
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

if TYPE_CHECKING:
    from playwright.sync_api import ConsoleMessage, Page

FLAGS = (
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run",
    "--disable-features=LocalNetworkAccessChecks",  # it asks before a page of another site may show one of this machine
)  # fmt: skip
NAMES = ("chromium", "chromium-browser", "google-chrome")
SECONDS = 200
"""How long to wait for a frame; one takes seconds in software, if nothing else runs."""


@contextmanager
def page_of(size: tuple[int, int], *, offline: bool = True, known: str = "$^") -> Iterator[Page]:
    """An empty page of (height, width) pixels; the test is skipped where there is no browser, and fails if a script on the page does.

    Args:
        size: (height, width) [px].
        offline: without a network, not even this machine's own.
        known: a regular expression for errors in the console that do not count.
    """
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip(f"there is no browser here: none of {', '.join(NAMES)}")
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright, which controls browsers, is not installed"
    )
    errors: list[str] = []
    with playwright.sync_playwright() as running:
        browser = running.chromium.launch(executable_path=program, args=list(FLAGS), timeout=SECONDS * 1000)
        height, width = size
        page = browser.new_context(viewport={"width": width, "height": height}, offline=offline).new_page()
        page.set_default_timeout(SECONDS * 1000)

        def note(text: str) -> None:
            if not re.search(known, text):
                errors.append(text)

        def note_message(message: ConsoleMessage) -> None:
            if message.type == "error":
                note(message.text)

        page.on("pageerror", lambda error: note(str(error)))
        page.on("console", note_message)
        yield page
        browser.close()
    assert not errors, errors


def picture_of(page: Page) -> np.ndarray:
    """What the page shows, [h w 3] in 0..1."""
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")) / 255

"""A headless browser for tests: Chromium with WebGL in software, without a network."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

if TYPE_CHECKING:
    from playwright.sync_api import Page

FLAGS = (
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run",
)  # fmt: skip
NAMES = ("chromium", "chromium-browser", "google-chrome")
SECONDS = 200
"""How long to wait for a frame; one takes seconds in software, if nothing else runs."""


@contextmanager
def page_of(size: tuple[int, int]) -> Iterator[Page]:
    """An empty page of (height, width) pixels; the test is skipped where there is no browser, and fails if a script on the page does."""
    program = next(filter(None, map(shutil.which, NAMES)), None)
    if program is None:
        pytest.skip(f"there is no browser here: none of {', '.join(NAMES)}")
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright, which controls browsers, is not installed"
    )
    errors: list[str] = []
    with playwright.sync_playwright() as running:
        browser = running.chromium.launch(executable_path=program, args=list(FLAGS))
        height, width = size
        page = browser.new_context(viewport={"width": width, "height": height}, offline=True).new_page()
        page.set_default_timeout(SECONDS * 1000)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
        yield page
        browser.close()
    assert errors == []


def picture_of(page: Page) -> np.ndarray:
    """What the page shows, [h w 3] in 0..1."""
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")) / 255

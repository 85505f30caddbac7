"""A real browser without a screen, with WebGL in software."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from playwright.sync_api import Page

PROGRAM = shutil.which("chromium")

MISSING = "" if PROGRAM and find_spec("playwright") else "chromium or the Python package playwright is not installed"
"""Why there is no browser; "" if there is one."""

FLAGS = (
    "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--no-first-run", "--disable-quic",
)  # fmt: skip

KNOWN_ERRORS = (r"computeBoundingSphere\(\): Computed radius is NaN",)
"""Console errors that viser's client always prints: its quads of splats have positions with two coordinates."""

SECONDS = 120.0
"""The longest wait for the first image of splats: 15 to 30 s on two cores that have nothing else to do."""

LOOK = """() => {
    const canvas = [...document.querySelectorAll("canvas")].sort((a, b) => b.width * b.height - a.width * a.height)[0];
    window.coloursAt = (places) => {
        const gl = canvas.getContext("webgl2"), pixel = new Uint8Array(4);
        return places.map(([x, y]) => {
            gl.readPixels(Math.floor(x * canvas.width), Math.floor((1 - y) * canvas.height), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
            return [...pixel.slice(0, 3)];
        });
    };
}"""
"""Makes a function that reads colours of the canvas at places (x, y) in 0..1 from the upper left corner."""


@dataclass
class Opened:
    """A page in the browser.

    Attributes:
        page: playwright's.
        errors: in the console, except known ones.
        requests: the addresses that the page loaded, except data inside of it.
    """

    page: Page
    errors: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)

    def wait_for_canvas(self) -> None:
        """Wait until viser has a canvas."""
        self.page.wait_for_selector("canvas", timeout=1000 * SECONDS)
        self.page.wait_for_function(
            "[...document.querySelectorAll('canvas')].some(one => one.width > 300)", timeout=1000 * SECONDS
        )
        self.page.evaluate(LOOK)

    def colour_at(self, x: float, y: float) -> tuple[int, int, int]:
        """The colour of the canvas at a place."""
        red, green, blue = self.page.evaluate("places => window.coloursAt(places)", [[x, y]])[0]
        return red, green, blue

    def wait_for_colour(self, x: float, y: float, colour: tuple[int, int, int], tolerance: int = 40) -> None:
        """Wait until the canvas has about this colour at a place."""
        self.page.wait_for_function(
            "([place, colour, most]) => window.coloursAt([place])[0].every((one, i) => Math.abs(one - colour[i]) <= most)",
            arg=[[x, y], colour, tolerance],
            timeout=1000 * SECONDS,
            polling=200,
        )


@contextmanager
def opened(url: str, size: tuple[int, int], offline: bool = False) -> Iterator[Opened]:
    """A page in a new browser with an empty profile.

    Args:
        url: of the page.
        size: (width, height) of the window [px].
        offline: without a network.
    """
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=PROGRAM, args=list(FLAGS))
        try:
            context = browser.new_context(viewport={"width": size[0], "height": size[1]}, offline=offline)
            found = Opened(context.new_page())
            found.page.set_default_timeout(1000 * SECONDS)
            found.page.on("console", lambda message: _note(found, message))
            found.page.on("pageerror", lambda error: found.errors.append(str(error)))
            found.page.on("request", lambda request: _note_request(found, request.url))
            found.page.goto(url)
            found.wait_for_canvas()
            yield found
        finally:
            browser.close()


def _note(opened: Opened, message: Any) -> None:
    if message.type == "error" and not any(re.search(known, message.text) for known in KNOWN_ERRORS):
        opened.errors.append(message.text)


def _note_request(opened: Opened, url: str) -> None:
    if not url.startswith(("data:", "blob:")):
        opened.requests.append(url)


def file_url(path: Path) -> str:
    """The address of a file."""
    return path.resolve().as_uri()

"""The canvas of viser's client in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from chromium import page_of

if TYPE_CHECKING:
    from playwright.sync_api import Page

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


@dataclass(frozen=True)
class Canvas:
    """A page with a scene of viser.

    Attributes:
        page: playwright's.
        loaded: the addresses that it loaded, except data inside of it.
    """

    page: Page
    loaded: list[str]

    def wait_for_colour(self, place: tuple[float, float], colour: tuple[int, int, int], tolerance: int = 40) -> None:
        """Wait until the canvas has about this colour at a place."""
        self.page.wait_for_function(
            "([place, colour, most]) => window.coloursAt([place])[0].every((one, i) => Math.abs(one - colour[i]) <= most)",
            arg=[list(place), list(colour), tolerance],
            polling=200,
        )


@contextmanager
def canvas_of(url: str, size: tuple[int, int], offline: bool = False) -> Iterator[Canvas]:
    """A page with a scene of viser, as soon as it has a canvas; skips and fails as `page_of`.

    Args:
        url: of the page.
        size: (height, width) of the window [px].
        offline: without a network.
    """
    with page_of(size, offline=offline) as page:
        loaded: list[str] = []
        page.on("request", lambda request: loaded.append(request.url))
        page.goto(url)
        page.wait_for_function("[...document.querySelectorAll('canvas')].some(one => one.width > 300)")
        page.evaluate(LOOK)
        yield Canvas(page, loaded)

"""Make docs/images/app.gif: the included room in the app, from the empty page to its classes. Needs the extras app and dev, and Chromium.

.venv/bin/python docs/app_picture.py
"""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

from PIL import Image, ImageChops
from playwright.sync_api import Page, sync_playwright

OUT = Path(__file__).parent / "images" / "app.gif"
SIZE = (720, 1080)
"""(height, width) of the browser's window [px]."""

WIDTH, COLOURS = 760, 112
BLOCK, WORST_COLOUR = 8, 48
"""How far the mean difference of so many pixels may be from 0, of 255: one palette for all frames turned chairs into the blue of cabinets."""

TURN = 0.035
"""Between two frames [radians]."""

FLAGS = ("--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars")


class Film:
    """Frames of a page, each with how long it is shown [ms]."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._frames: list[tuple[Image.Image, int]] = []
        self._cuts: list[int] = []

    def add(self, milliseconds: int) -> None:
        """Add what the page shows."""
        picture = Image.open(io.BytesIO(self._page.screenshot())).convert("RGB")
        height = round(WIDTH * picture.height / picture.width)
        self._frames.append((picture.resize((WIDTH, height), Image.Resampling.LANCZOS), milliseconds))

    def cut(self) -> None:
        """What follows has other colours."""
        self._cuts.append(len(self._frames))

    def save(self, path: Path) -> None:
        """Write a GIF that repeats."""
        frames = [few for group in self._groups() for few in reduced(group)]
        times = [milliseconds for _, milliseconds in self._frames]
        frames[0].save(path, save_all=True, append_images=frames[1:], duration=times, loop=0, optimize=True)

    def _groups(self) -> Iterator[list[Image.Image]]:
        """The frames up to each cut: each group has a palette of its own."""
        pictures, cuts = [frame for frame, _ in self._frames], [0, *self._cuts, len(self._frames)]
        return (pictures[begin:end] for begin, end in pairwise(cuts))


def reduced(group: Sequence[Image.Image]) -> list[Image.Image]:
    """Frames with few colours, the same for all.

    Raises:
        ValueError: a colour changes too much.
    """
    together = Image.new("RGB", (WIDTH, sum(frame.height for frame in group)))
    for number, frame in enumerate(group):
        together.paste(frame, (0, number * frame.height))
    palette = together.quantize(COLOURS, kmeans=1)
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in group]
    for frame, few in zip(group, frames, strict=True):
        off = ImageChops.difference(frame, few.convert("RGB")).reduce(BLOCK).getextrema()
        if (worst := max(high for _, high in off)) > WORST_COLOUR:
            raise ValueError(f"a block of {BLOCK} pixels is off by {worst}")
    return frames


def scene_of(page: Page) -> Any:
    """The frame with the scene in 3D."""
    return next(frame for frame in page.frames if frame.url.endswith("scene.html"))


def turn(page: Page, angle: float) -> None:
    """Turn the scene, and wait until it is drawn."""
    scene_of(page).evaluate(
        "(angle) => { __viserMutable.cameraControl.rotate(angle, 0, false); __viserMutable.requestRender(); }", angle
    )
    page.wait_for_timeout(1200)


def film(page: Page, url: str) -> Film:
    """The room from the empty page to its classes."""
    frames = Film(page)
    page.goto(url)
    page.get_by_role("button", name="Try the included room").wait_for()
    page.wait_for_timeout(500)
    frames.add(1200)
    page.get_by_role("button", name="Try the included room").click()
    page.get_by_text("Building the room").wait_for()
    page.wait_for_timeout(500)
    frames.add(1200)
    frames.cut()
    page.locator("iframe.room").wait_for()
    room = page.frame_locator("iframe.room")
    room.locator("body[data-ready]").wait_for()
    room.locator(".grid").evaluate("(grid) => grid.scrollIntoView()")
    page.wait_for_timeout(15_000)  # viser fades scenes in, which takes this long in software
    frames.add(1200)
    for step in range(6):
        turn(page, TURN * (1 if step < 3 else -1))
        frames.add(140)
    frames.cut()
    room.get_by_role("button", name="Classes").click()
    page.wait_for_timeout(3000)
    frames.add(1200)
    for step in range(6):
        turn(page, TURN * (1 if step < 3 else -1))
        frames.add(140)
    room.get_by_label("wall").uncheck()
    room.get_by_role("button", name="Boxes").click()
    page.wait_for_timeout(3000)
    frames.add(1400)
    box = room.locator("#scene").bounding_box()
    assert box is not None
    room.locator("#scene").click(position={"x": 0.62 * box["width"], "y": 0.5 * box["height"]})
    room.locator("#info").get_by_text("Class", exact=True).wait_for()
    page.wait_for_timeout(2000)
    frames.add(2600)
    return frames


def main() -> None:
    """Start the app, film it, and write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "semgs", "app", "--port", "0", "--folder", folder]
        app = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert app.stdout is not None
        try:
            url = next(found[1] for line in app.stdout if (found := re.search(r"Open (http://\S+)", line)))
            with sync_playwright() as playwright:
                program = shutil.which("chromium") or shutil.which("chromium-browser")
                browser = playwright.chromium.launch(executable_path=program, args=list(FLAGS))
                height, width = SIZE
                page = browser.new_page(viewport={"width": width, "height": height})
                page.set_default_timeout(300_000)
                film(page, url).save(OUT)
                browser.close()
        finally:
            app.terminate()
            app.wait(30)
    print(f"{OUT}: {OUT.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()

"""The viewer and its page in a real browser, with WebGL in software."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from viewer.chromium import MISSING, file_url, opened
from wall_and_chair import GREEN, RED, WALL, wall_and_chair

from semgs.data.classes import SCANNET20
from semgs.viewer.page import scene_page
from semgs.viewer.window import viewing

pytestmark = pytest.mark.skipif(bool(MISSING), reason=MISSING)

SIZE = (640, 360)
"""Of the browser's window; the panel covers its right half."""

ON_WALL, ON_CHAIR = (0.25, 0.6), (0.5, 0.8)
"""Places of the canvas, from its upper left corner."""

BACKGROUND = (20, 20, 20)


def bytes_of(colour: tuple[float, float, float]) -> tuple[int, int, int]:
    red, green, blue = (round(255 * one) for one in colour)
    return red, green, blue


def test_the_viewer_shows_the_scene_and_a_click_names_the_class_under_it():
    with viewing(wall_and_chair(), up="z") as window, opened(window.url, SIZE) as browser:
        browser.wait_for_colour(*ON_WALL, bytes_of(RED))
        browser.page.mouse.click(SIZE[0] * ON_WALL[0], SIZE[1] * ON_WALL[1])
        browser.page.get_by_text("wall, 80 %").wait_for()
        assert browser.page.locator(".tabler-icon-share").count() == 0
        assert browser.errors == []

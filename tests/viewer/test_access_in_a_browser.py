"""The viewer by other ways than its own address, in a real browser: a tunnel, a proxy, two tabs, a frame of another page."""

from __future__ import annotations

from urllib.parse import urlsplit

import pytest
from tunnels import tunnel_to
from viser_canvas import canvas_of
from wall_and_chair import RED, wall_and_chair

from semgs.viewer.access import Access
from semgs.viewer.window import open_window

pytestmark = [pytest.mark.long, pytest.mark.timeout(900)]

SIZE = (360, 640)
ON_WALL = (0.25, 0.6)

NEAR_RED = tuple(round(255 * one) for one in RED)


def port_of(url: str) -> int:
    """The port of an address."""
    port = urlsplit(url).port
    assert port is not None
    return port


def test_a_tunnel_with_another_port_shows_the_scene():
    with (
        open_window(wall_and_chair(), up="z") as window,
        tunnel_to(port_of(window.url)) as port,
        canvas_of(f"http://localhost:{port}", SIZE) as canvas,
    ):
        canvas.wait_for_colour(ON_WALL, NEAR_RED)


def test_a_proxy_that_writes_its_own_host_needs_its_name():
    with (
        open_window(wall_and_chair(), up="z", access=Access(names=("localhost",))) as window,
        tunnel_to(port_of(window.url), host="127.0.0.1:1") as port,
        canvas_of(f"http://localhost:{port}", SIZE) as canvas,
    ):
        canvas.wait_for_colour(ON_WALL, NEAR_RED)


def test_two_tabs_share_the_cookie_of_a_token():
    access = Access(None, "a-token")
    with open_window(wall_and_chair(), up="z", access=access) as window, canvas_of(window.url, SIZE) as canvas:
        canvas.wait_for_colour(ON_WALL, NEAR_RED)
        assert "token" not in canvas.page.url
        tab = canvas.page.context.new_page()
        tab.goto(window.url.partition("/?")[0])
        tab.locator("canvas").first.wait_for()
        tab.close()


def test_no_page_elsewhere_shows_the_viewer_in_a_frame():
    with open_window(wall_and_chair(), up="z") as window, canvas_of(window.url, SIZE) as canvas:
        page = canvas.page.context.new_page()
        page.set_content(f"<iframe src='{window.url}'></iframe>")
        page.wait_for_timeout(3000)
        assert page.frames[1].locator("canvas").count() == 0
        page.close()

"""The files of the Space: its settings fit the package, and it starts."""

from __future__ import annotations

import importlib.util
import os
import re
import runpy
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.request import urlopen

import pytest
from chromium import page_of
from tunnels import tunnel_to

from semgs import __version__
from semgs.app.page import privacy_statement

ROOT = Path(__file__).resolve().parents[2]
SPACE = ROOT / "space"


def test_its_settings_name_what_is_there():
    front = re.match(r"---\n(.*?)\n---\n", (SPACE / "README.md").read_text(), re.DOTALL)
    assert front is not None
    settings = dict(line.split(": ", 1) for line in front[1].splitlines())
    assert len(settings["short_description"]) <= 60
    assert settings["sdk"] == "docker"
    steps = (SPACE / "Dockerfile").read_text()
    assert f"EXPOSE {settings['app_port']}\n" in steps
    assert f"semgs-{__version__}-py3-none-any.whl[app]" in steps
    assert f'"GRADIO_SERVER_PORT", "{settings["app_port"]}"' in (SPACE / "app.py").read_text()


def test_it_starts_a_worker_that_exists():
    (module,) = re.findall(r'"-m", "([\w.]+)"', (SPACE / "app.py").read_text())
    assert importlib.util.find_spec(module) is not None


def test_its_page_says_which_photos_stay_and_for_how_long():
    limits = runpy.run_path(str(SPACE / "app.py"))["LIMITS"]
    said = (SPACE / "README.md").read_text()
    assert privacy_statement(local=False, limits=limits).split("deleted", 1)[1] in said


@contextmanager
def running_space() -> Iterator[int]:
    """The Space as its host starts it; its port."""
    pytest.importorskip("gradio", reason="gradio is not installed; pip install '.[app]' in SemGS's folder")
    environment = {**os.environ, "GRADIO_SERVER_PORT": "0", "SPACE_HOST": "localhost"}
    command = [sys.executable, str(SPACE / "app.py")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    try:
        yield int(next(found[1] for line in process.stdout if (found := re.search(r"port (\d+)", line))))
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(120)
        process.stdout.close()


@pytest.mark.long
def test_it_starts_and_serves_the_page():
    with running_space() as port, urlopen(f"http://127.0.0.1:{port}/") as answer:
        assert "processed on this server" in answer.read().decode()


@pytest.mark.long
@pytest.mark.timeout(600)
def test_it_works_in_a_frame_of_the_hub_behind_its_proxy_and_in_no_other_frame():
    around = "<!doctype html><iframe src='http://localhost:{}/' style='width: 900px; height: 900px'></iframe>"
    with (
        running_space() as own,
        tunnel_to(own) as port,
        page_of((1000, 1000), offline=False, known="frame-ancestors|aborted|errored out") as page,
    ):
        for address in ("https://huggingface.co/spaces/somebody/room", "https://evil.example/"):
            page.route(address, lambda route: route.fulfill(body=around.format(port), content_type="text/html"))
        page.goto("https://evil.example/")
        page.wait_for_timeout(3000)
        assert page.frames[1].get_by_role("button").count() == 0
        page.goto("https://huggingface.co/spaces/somebody/room")
        frame = page.frame_locator("iframe")
        frame.get_by_role("button", name="Try the included room").click()
        frame.get_by_text(re.compile("Waiting|Working on the included room")).first.wait_for()
        frame.get_by_role("button", name="Cancel").click()
        frame.get_by_text("Cancelled").wait_for()

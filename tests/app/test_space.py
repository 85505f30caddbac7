"""The files of the Space: its settings fit the package, and it starts."""

from __future__ import annotations

import os
import re
import runpy
import signal
import subprocess
import sys
import tomllib
from pathlib import Path
from urllib.request import urlopen

import pytest

from semgs import __version__

ROOT = Path(__file__).resolve().parents[2]
SPACE = ROOT / "space"


def test_its_settings_name_what_is_there():
    front = re.match(r"---\n(.*?)\n---\n", (SPACE / "README.md").read_text(), re.DOTALL)
    assert front is not None
    settings = dict(line.split(": ", 1) for line in front[1].splitlines())
    assert (SPACE / settings["app_file"]).exists()
    assert f"gradio=={settings['sdk_version']}" in (ROOT / "constraints.txt").read_text().splitlines()
    assert len(settings["short_description"]) <= 60
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    required = (SPACE / "requirements.txt").read_text().strip()
    assert required == f"./semgs-{__version__}-py3-none-any.whl[app]"
    assert "app" in extras


def test_its_page_says_which_photos_stay_and_for_how_long():
    limits = runpy.run_path(str(SPACE / "app.py"))["LIMITS"]
    said = (SPACE / "README.md").read_text()
    assert f"except small copies of those that the room shows; the room is deleted after {limits.kept}." in said


@pytest.mark.long
def test_it_starts_and_serves_the_page():
    pytest.importorskip("gradio", reason="gradio is not installed; pip install '.[app]' in SemGS's folder")
    environment = {**os.environ, "GRADIO_SERVER_PORT": "0"}
    command = [sys.executable, str(SPACE / "app.py")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    assert process.stdout is not None
    try:
        port = next(found[1] for line in process.stdout if (found := re.search(r"port (\d+)", line)))
        with urlopen(f"http://127.0.0.1:{port}/") as answer:
            page = answer.read().decode()
        assert "processed on this server" in page
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(120)
        process.stdout.close()

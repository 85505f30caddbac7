"""Attacks on the app and the viewer as they are installed here. The door in front of gradio is tested without gradio in test_door.py."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "attack_app.py"


@pytest.mark.parametrize(
    ("option", "least"),
    [("--few", 300), pytest.param("--rooms", 3000, marks=[pytest.mark.long, pytest.mark.timeout(1800)])],
)
def test_nothing_gets_through(option: str, least: int):
    pytest.importorskip("gradio", reason="gradio is not installed; pip install '.[app]' in SemGS's folder")
    done = subprocess.run(
        [sys.executable, str(SCRIPT), option], capture_output=True, text=True, timeout=1700, check=False
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    counted = re.search(r"^(\d+) attacks, 0 got through$", done.stdout, re.MULTILINE)
    assert counted is not None
    assert int(counted[1]) >= least

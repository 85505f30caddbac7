"""gsplat compiles itself when it is imported; processes that import it at the same time must not compile at the same time."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent

BACKEND = """
import time
from pathlib import Path
building = Path(__file__).with_name("building")
building.touch(exist_ok=False)  # fails if another process is at it
time.sleep(0.5)
building.unlink()
_C = object()
"""
"""A stand-in for the module that compiles: like the real one it cannot bear company."""


@pytest.mark.long
def test_processes_that_start_together_compile_one_after_the_other(tmp_path: Path):
    package = tmp_path / "gsplat"
    (package / "cuda").mkdir(parents=True)
    (package / "__init__.py").write_text("rasterization = print")
    (package / "cuda" / "__init__.py").write_text("")
    (package / "cuda" / "_backend.py").write_text(BACKEND)
    program = "from semgs.rendering.gsplat_backend import rasterizer; rasterizer()(rasterizer() is print)"
    environment = {
        **os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}", "SEMGS_CACHE": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"
    }  # fmt: skip
    started = [
        subprocess.Popen(
            [sys.executable, "-c", program], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    assert [(*one.communicate(timeout=120), one.returncode) for one in started] == [("True\n", "", 0)] * 2
    assert (tmp_path / "cache" / "gsplat.lock").exists()

"""Programs in JavaScript that open our files in tests: `tests/node/package.json` names them, `make long` installs them."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "node"
SECONDS = 250


def node(script: str, *arguments: str | Path) -> str:
    """What a script below `tests/node` prints; the test is skipped where Node or the packages are missing."""
    program = shutil.which("node")
    if program is None:
        pytest.skip("there is no node here")
    if not package("").is_dir():
        pytest.skip(f"the packages of {FOLDER.name}/package.json are not installed; `make long` does")
    done = subprocess.run(
        [program, FOLDER / script, *arguments], capture_output=True, text=True, timeout=SECONDS, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def package(name: str) -> Path:
    """The folder of an installed package."""
    return FOLDER / "node_modules" / name


def splat_transform(*arguments: str | Path) -> None:
    """Run splat-transform on the CPU."""
    node("node_modules/@playcanvas/splat-transform/bin/cli.mjs", "--quiet", "--overwrite", "--gpu", "cpu", *arguments)

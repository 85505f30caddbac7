"""The pins of constraints.txt, as uv resolves them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def resolved(*options: str) -> subprocess.CompletedProcess[str]:
    """What `uv pip compile` makes of pyproject.toml at the versions of constraints.txt; macOS is at least version 14, as torch needs."""
    command = ["-m", "uv", "pip", "compile", "pyproject.toml", "-c", "constraints.txt", "--no-header", "-q", *options]
    environment = os.environ | {"MACOSX_DEPLOYMENT_TARGET": "14.0"}
    settings: dict = {"cwd": ROOT, "env": environment, "capture_output": True, "text": True, "check": False}
    return subprocess.run([sys.executable, *command], **settings)

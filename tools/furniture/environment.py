"""The environment that Infinigen runs in: a Python 3.11 of its own with Blender, made once from pinned packages."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path

from semgs.files.atomic import write_text
from semgs.files.errors import InputError

PYTHON = (3, 11)
"""The one version that Blender's package is built for."""
DOWNLOAD_MB, DISK_GB = 600, 2.5
"""What making the environment takes, about."""
MARK, STAMP, LOG = "semgs-bake", "complete", "install.log"
"""Files in the folder: that it is ours, that everything is in it, and what pip said."""
PATIENCE = 300.0
"""Longest that Blender may take to be imported [s]."""


def default_folder() -> Path:
    """Where the environment is kept unless another place is named; other pins have another folder."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "semgs" / f"infinigen-{_pins()[:12]}"


def python_of(folder: Path) -> Path:
    """The interpreter of an environment."""
    return folder / "Scripts" / "python.exe" if os.name == "nt" else folder / "bin" / "python"


def is_ready(folder: Path) -> bool:
    """Whether a folder holds the whole environment, of the pins of this version."""
    stamp = folder / STAMP
    return stamp.is_file() and stamp.read_text(encoding="utf-8") == _pins() and python_of(folder).exists()


def prepare(folder: Path, python: str | None = None, say: Callable[[str], None] = lambda line: None) -> None:
    """The interpreter of the environment in a folder, which is made if it is not there yet.

    Args:
        folder: a new or empty one, or one that was made here; one that was left half-made is made anew.
        python: the Python 3.11 to make it with; None looks for one.
        say: told what will be downloaded, before it is.

    Raises:
        InputError: the folder holds something else or has no room; there is no Python 3.11; a package cannot be had; or
            Blender cannot be imported.
    """
    if is_ready(folder):
        return
    if folder.exists() and not (folder.is_dir() and ((folder / MARK).is_file() or not any(folder.iterdir()))):
        raise InputError(folder, "a new folder or one that semgs made", "something else", advice="name another folder")
    chosen = find_python(python)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    write_text(
        folder / MARK, "An environment for `python -m tools.furniture`; remove it as a whole when it is not needed.\n"
    )
    free = shutil.disk_usage(folder).free / 1e9
    if free < DISK_GB:
        raise InputError(folder, f"{DISK_GB} GB of free disk for Blender and Infinigen", f"{free:.1f} GB")
    say(
        f"making an environment for Infinigen in {folder}: {DOWNLOAD_MB} MB to download from the package index that pip uses "
        f"(Blender, GPL; Infinigen, BSD-3), {DISK_GB} GB on disk; once, minutes"
    )
    _do([chosen, "-m", "venv", str(folder)], folder, "a Python with venv and pip")
    _do([str(python_of(folder)), *_pip_arguments()], folder, "the packages of Blender and Infinigen")
    _do([str(python_of(folder)), "-c", "import bpy, infinigen"], folder, "Blender, importable", PATIENCE)
    write_text(folder / STAMP, _pins())


def find_python(asked: str | None) -> str:
    """A Python 3.11: the one that was asked for, else this one, else the one on the path.

    Raises:
        InputError: there is none.
    """
    candidates = (asked,) if asked is not None else (sys.executable, "python3.11", "python3")
    for candidate in candidates:
        try:
            told = subprocess.run(
                [candidate, "-c", "import sys; print(*sys.version_info[:2])"],
                capture_output=True, text=True, timeout=60, check=False, env=surroundings(),
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired):
            continue
        if told.returncode == 0 and told.stdout.split() == [str(part) for part in PYTHON]:
            return candidate
    wanted = ".".join(map(str, PYTHON))
    raise InputError(
        asked or "python3.11", f"Python {wanted}, for which Blender's package is built", "none",
        advice=f"install it, or name one with --python /path/to/python{wanted}",
    )  # fmt: skip


def surroundings(folder: Path | None = None) -> dict[str, str]:
    """Environment variables for programs in the other environment: one thread, and nothing of this Python's or of a user's
    Blender."""
    ours = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "BLENDER_"))}
    ours.pop("VIRTUAL_ENV", None)
    ours |= {"PYTHONNOUSERSITE": "1", "PYTHONHASHSEED": "0", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return ours | ({"BLENDER_USER_RESOURCES": str((folder / "blender").absolute())} if folder is not None else {})


def _pip_arguments() -> list[str]:
    pins = str(files("tools.furniture") / "requirements.txt")
    quiet = ["--disable-pip-version-check", "--no-input", "--progress-bar", "off"]
    # Everything is pinned, also what Infinigen's own pins would have otherwise, so nothing is left to resolve or to build.
    return ["-m", "pip", "install", *quiet, "--only-binary", ":all:", "--no-deps", "-r", pins]


def _do(command: Sequence[str], folder: Path, expected: str, limit: float | None = None) -> None:
    """Run one step, with what it says in the log.

    Raises:
        InputError: it failed, or took longer than `limit` seconds.
    """
    with (folder / LOG).open("a", encoding="utf-8") as log:
        try:
            done = subprocess.run(
                command, stdout=log, stderr=subprocess.STDOUT, env=surroundings(folder), timeout=limit, check=False
            )
        except subprocess.TimeoutExpired:
            raise InputError(folder, expected, f"nothing after {limit:.0f} s", advice=f"see {folder / LOG}") from None
        except OSError as error:
            raise InputError(folder, expected, str(error)) from error
    if done.returncode:
        raise InputError(folder, expected, _reason(folder / LOG), advice=f"see {folder / LOG}")


def _reason(log: Path) -> str:
    """The last line of a log that tells of an error, else the last."""
    lines = [line.strip() for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    errors = [line for line in lines if "error" in line.lower()]
    return (errors or lines or ["nothing said"])[-1][:300]


def _pins() -> str:
    return hashlib.sha256((files("tools.furniture") / "requirements.txt").read_bytes()).hexdigest()

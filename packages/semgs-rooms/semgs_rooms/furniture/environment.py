"""The environment that Infinigen runs in: Python 3.11 with Blender, created once from pinned packages."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path

from semgs.files.atomic import write_text
from semgs.files.contents import sha256
from semgs.files.errors import InputError

PYTHON = (3, 11)
"""The only version that Blender's package supports."""
DOWNLOAD_MB, DISK_GB = 600, 2.5
"""Approximate size of the environment."""
MARK, STAMP, LOG = "semgs-bake", "complete", "install.log"
"""Files in the folder: a mark that it is ours, a stamp that it is complete, and the output of pip."""
PATIENCE = 300.0
"""Maximum time to import Blender [s]."""


def default_folder() -> Path:
    """The default folder of the environment; it depends on the pinned versions."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "semgs" / f"infinigen-{_pins()[:12]}"


def python_of(folder: Path) -> Path:
    """The interpreter of an environment."""
    return folder / "Scripts" / "python.exe" if os.name == "nt" else folder / "bin" / "python"


def is_ready(folder: Path) -> bool:
    """Whether a folder contains the complete environment with the versions pinned here."""
    stamp = folder / STAMP
    return stamp.is_file() and stamp.read_text(encoding="utf-8") == _pins() and python_of(folder).exists()


def prepare(folder: Path, python: str | None = None, say: Callable[[str], None] = lambda line: None) -> None:
    """Create the environment in a folder, unless it is there already.

    Args:
        folder: a new or empty one, or an environment of ours; an incomplete one is created again.
        python: the Python 3.11 to create it with; None searches for one.
        say: called before the download, with a message about it.

    Raises:
        InputError: the folder contains something else or has too little space, there is no Python 3.11, a package cannot be
            installed, or Blender cannot be imported.
    """
    if is_ready(folder):
        return
    if folder.exists() and not (folder.is_dir() and ((folder / MARK).is_file() or not any(folder.iterdir()))):
        raise InputError(
            folder, "a new folder or an environment of ours", "something else", advice="name another folder"
        )
    chosen = find_python(python)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    purpose = (
        "An environment for `python -m semgs_rooms.furniture`. You can delete this folder if you no longer need it.\n"
    )
    write_text(folder / MARK, purpose)
    free = shutil.disk_usage(folder).free / 1e9
    if free < DISK_GB:
        raise InputError(folder, f"{DISK_GB} GB of free disk for Blender and Infinigen", f"{free:.1f} GB")
    say(
        f"creating an environment for Infinigen in {folder}, once: {DOWNLOAD_MB} MB to download from pip's package index "
        f"(Blender, GPL; Infinigen, BSD-3), {DISK_GB} GB on disk, a few minutes"
    )
    _do([chosen, "-m", "venv", str(folder)], folder, "a Python with venv and pip")
    _do([str(python_of(folder)), *_pip_arguments()], folder, "the packages of Blender and Infinigen")
    _do([str(python_of(folder)), "-c", "import bpy, infinigen"], folder, "Blender, importable", PATIENCE)
    write_text(folder / STAMP, _pins())


def find_python(given: str | None) -> str:
    """A Python 3.11: the given one, or else this interpreter or one on the path.

    Raises:
        InputError: there is none.
    """
    candidates = (given,) if given is not None else (sys.executable, "python3.11", "python3")
    for candidate in candidates:
        try:
            answer = subprocess.run(
                [candidate, "-c", "import sys; print(*sys.version_info[:2])"],
                capture_output=True, text=True, timeout=60, check=False, env=surroundings(),
            )  # fmt: skip
        except (OSError, subprocess.TimeoutExpired):
            continue
        if answer.returncode == 0 and answer.stdout.split() == [str(part) for part in PYTHON]:
            return candidate
    wanted = ".".join(map(str, PYTHON))
    raise InputError(
        given or "python3.11", f"Python {wanted}, which Blender's package needs", "none",
        advice=f"install it, or name one with --python /path/to/python{wanted}",
    )  # fmt: skip


def surroundings(folder: Path | None = None) -> dict[str, str]:
    """Environment variables for programs in the environment: one thread, and no settings of this Python or of the user's Blender."""
    ours = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "BLENDER_"))}
    ours.pop("VIRTUAL_ENV", None)
    ours |= {"PYTHONNOUSERSITE": "1", "PYTHONHASHSEED": "0", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return ours | ({"BLENDER_USER_RESOURCES": str((folder / "blender").absolute())} if folder is not None else {})


def _pip_arguments() -> list[str]:
    pins = str(files("semgs_rooms.furniture") / "requirements.txt")
    quiet = ["--disable-pip-version-check", "--no-input", "--progress-bar", "off"]
    # All dependencies are pinned, some differently from Infinigen's own pins, so pip resolves and builds nothing.
    return ["-m", "pip", "install", *quiet, "--only-binary", ":all:", "--no-deps", "-r", pins]


def _do(command: Sequence[str], folder: Path, expected: str, limit: float | None = None) -> None:
    """Run one step with its output in the log; an InputError if it fails or takes longer than `limit` seconds."""
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
    """The last line of a log that mentions an error, or else the last line."""
    lines = [line.strip() for line in log.read_text(encoding="utf-8", errors="replace").splitlines() if line.strip()]
    errors = [line for line in lines if "error" in line.lower()]
    return (errors or lines or ["no output"])[-1][:300]


def _pins() -> str:
    return sha256(Path(str(files("semgs_rooms.furniture"))) / "requirements.txt")

"""The index of the included weights: the file of each name, and its hash.

shipped/index.json    {"small": {"file": "small.safetensors", "sha256": "...", "bytes": 2048452}, ...}
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from semgs.files.atomic import write_json
from semgs.files.contents import sha256
from semgs.files.errors import InputError
from semgs.files.records import make_record
from semgs.files.strict_json import parse_json

FILE_NAME = "index.json"
SHOWN = 12
"""How many characters of a hash are shown."""


@dataclass(frozen=True)
class Entry:
    """An entry of the index: a file's name, hash and size."""

    file: str
    sha256: str
    bytes: int


@dataclass(frozen=True)
class Shipped:
    """Weights that are included in the package.

    Attributes:
        name: to load them by.
        path: of the file.
        sha256: of the file.
        bytes: size of the file.
    """

    name: str
    path: Path
    sha256: str
    bytes: int


def shipped_folder() -> Path:
    """The folder of weights inside the package."""
    return Path(str(resources.files("semgs.model.weights"))) / "shipped"


def read_index(folder: Path | None = None) -> tuple[Shipped, ...]:
    """The included weights, or those in another folder, by name.

    Raises:
        InputError: the index is missing or invalid.
    """
    folder = shipped_folder() if folder is None else folder
    path = folder / FILE_NAME
    try:
        entries = {name: make_record(Entry, entry) for name, entry in parse_json(path.read_bytes()).items()}
    except (OSError, ValueError, AttributeError) as error:
        raise InputError(
            path, "the index of the included weights", f"{type(error).__name__}: {error}", advice="install semgs again"
        ) from None
    return tuple(
        Shipped(name, folder / Path(entry.file).name, entry.sha256, entry.bytes)
        for name, entry in sorted(entries.items())
    )


def write_index(folder: Path | None = None) -> None:
    """Write the index of a folder of weights. Each file is named without its ending."""
    folder = shipped_folder() if folder is None else folder
    files = sorted(folder.glob("*.safetensors"))
    content = {file.stem: {"file": file.name, "sha256": sha256(file), "bytes": file.stat().st_size} for file in files}
    write_json(folder / FILE_NAME, content)


def check(shipped: Shipped) -> None:
    """Check included weights against the index.

    Raises:
        InputError: the file is missing or was changed.
    """
    if not shipped.path.is_file():
        raise InputError(shipped.path, f'the weights "{shipped.name}"', "no such file", advice="install semgs again")
    found = sha256(shipped.path)
    if found != shipped.sha256:
        raise InputError(
            shipped.path, f"sha256 {shipped.sha256[:SHOWN]} and {shipped.bytes:,} bytes",
            f"{found[:SHOWN]} and {shipped.path.stat().st_size:,}", advice="the file was changed; install semgs again",
        )  # fmt: skip


def matching(file: Path, index: Sequence[Shipped]) -> Shipped:
    """The weights of the index that a file, from anywhere, is a copy of.

    Raises:
        InputError: the file cannot be read, or is none of them.
    """
    if not file.is_file():
        names = " or ".join(shipped.name for shipped in index)
        raise InputError(file, f"a weights file, or {names}", "a folder" if file.is_dir() else "nothing")
    found = sha256(file)
    for shipped in index:
        if found == shipped.sha256:
            return shipped
    known = ", ".join(f"{shipped.name} {shipped.sha256[:SHOWN]}" for shipped in index)
    raise InputError(
        file, f"the sha256 of included weights ({known})", found[:SHOWN],
        advice="the file was changed, or belongs to another version of semgs",
    )  # fmt: skip

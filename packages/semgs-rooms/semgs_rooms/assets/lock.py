"""The lock of a folder of assets: origin, licence and SHA-256 of each file."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from semgs.files.atomic import write_bytes
from semgs.files.contents import sha256
from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json
from semgs.files.text import listed
from semgs_rooms.assets.catalogue import FileSource, ImageEntry, MeshEntry, inside, read_catalogue

NAME = "lock.json"
LISTS = ("catalog.json", "textures.json")
SHOWN = 3
"""How many files at fault an error names."""


@dataclass(frozen=True)
class LockEntry:
    """One file of the folder.

    Attributes:
        file: path in the folder.
        origin: where it comes from.
        sha256: of its bytes.
    """

    file: str
    origin: FileSource
    sha256: str


def make_lock(folder: str | Path) -> tuple[LockEntry, ...]:
    """The lock of a folder in its current state: both lists, then every mesh and image in them.

    Raises:
        InputError: a list cannot be read, or a listed file is missing.
    """
    folder = Path(folder)
    catalogue = read_catalogue(folder)
    lists = tuple(LockEntry(name, FileSource(), _digest(folder, name)) for name in LISTS)
    named: list[MeshEntry | ImageEntry] = [*catalogue.meshes, *catalogue.images]
    return (*lists, *(LockEntry(row.file, row.origin, _digest(folder, row.file)) for row in named))


def write_lock(path: str | Path, rows: Sequence[LockEntry]) -> None:
    """Write a lock; origins shared by several files are written once."""
    origins: dict[tuple[str, str, str, str], int] = {}
    lines = []
    for row in rows:
        origin = row.origin
        number = origins.setdefault((origin.source, origin.commit, origin.licence, origin.author), len(origins))
        lines.append(json.dumps([row.file, number, origin.path, row.sha256], ensure_ascii=False))
    head = ",\n".join(json.dumps(list(shared), ensure_ascii=False) for shared in origins)
    text = f'{{"origins": [\n{head}\n], "files": [\n' + ",\n".join(lines) + "\n]}\n"
    write_bytes(Path(path), text.encode())


def read_lock(path: str | Path | None = None) -> tuple[LockEntry, ...]:
    """Read a lock, by default that of the package.

    Raises:
        InputError: it is missing or malformed, or has a path that leads out of the folder.
    """
    path = Path(str(files("semgs_rooms.assets"))) / NAME if path is None else Path(path)
    try:
        content = parse_json(path.read_bytes())
        rows = []
        for file, origin, inner, sha256 in content["files"]:
            source, commit, licence, author = content["origins"][origin]
            rows.append(LockEntry(inside(file), FileSource(source, commit, inner, licence, author), sha256))
        return tuple(rows)
    except (OSError, KeyError, IndexError, TypeError, ValueError) as error:
        reason, advice = f"{type(error).__name__}: {error}", "install semgs, or generate the folder, again"
        raise InputError(path, "a lock of assets", reason, advice=advice) from None


def lock_of(folder: str | Path) -> Path:
    """The lock that applies to a folder: its own if it has one, as generated furniture does, else that of the package."""
    own = Path(folder) / NAME
    return own if own.is_file() else Path(str(files("semgs_rooms.assets"))) / NAME


def lock_digest(folder: str | Path) -> str:
    """The first digits of the SHA-256 of a folder's lock, which identify its assets."""
    return sha256(lock_of(folder))[:16]


def verify(folder: str | Path, lock: Sequence[LockEntry] | None = None) -> None:
    """Check that every file in the lock exists and is unaltered.

    Args:
        folder: of the assets.
        lock: None for `lock_of` the folder.

    Raises:
        InputError: the folder is missing, or files are missing or altered; the message names the first ones and counts the others.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(folder, "a folder of assets", "no such folder")
    missing, altered = [], []
    for row in read_lock(lock_of(folder)) if lock is None else lock:
        try:
            if _digest(folder, row.file) != row.sha256:
                altered.append(row.file)
        except InputError:
            missing.append(row.file)
    faults = [(what, names) for what, names in (("missing", missing), ("altered", altered)) if names]
    if faults:
        reason = "; ".join(f"{len(names)} {what}: {listed(names, SHOWN)}" for what, names in faults)
        advice = "fetch or generate the assets again, in a folder of their own"
        raise InputError(folder, "the files of the lock, byte for byte", reason, advice=advice)


def attribution(used: Iterable[str], lock: Sequence[LockEntry] | None = None) -> str:
    """The text of `ATTRIBUTION.md` for a data set: the assets that it uses, by licence and author.

    Args:
        used: files, as in the lock.
        lock: of all folders with these files; None for the package's lock.

    Raises:
        ValueError: a file is not in the lock.
    """
    rows = {row.file: row for row in (read_lock() if lock is None else lock)}
    unknown = sorted(set(used) - rows.keys())
    if unknown:
        raise ValueError(f"the lock has no {listed(unknown, SHOWN)}; expected files that it names")
    notice = "These pictures show models and textures by others, under the licences named here."
    lines = ["# Attribution", "", notice, ""]
    groups: dict[tuple[str, str], list[LockEntry]] = {}
    for file in sorted(set(used)):
        groups.setdefault((rows[file].origin.licence, rows[file].origin.author), []).append(rows[file])
    for (licence, author), members in sorted(groups.items()):
        lines += [f"## {licence}" + (f", by {author}" if author else ""), ""]
        origins = [(row.file, row.origin) for row in members]
        lines += [f"- `{file}`: {origin.source}@{origin.commit[:12]}, `{origin.path}`" for file, origin in origins]
        lines.append("")
    return "\n".join(lines)


def _digest(folder: Path, name: str) -> str:
    try:
        return sha256(folder / name)
    except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
        advice = "fetch the assets again"
        raise InputError(folder / name, "a file of the assets", "no such file", advice=advice) from None

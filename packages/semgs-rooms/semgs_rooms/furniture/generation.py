"""Generate the pieces of a seed into a folder of assets with its own lock."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from threading import Event

from semgs._version import __version__
from semgs.files.atomic import write_json, write_text
from semgs.files.claims import is_begun
from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json
from semgs_rooms.assets.lock import LISTS, NAME, make_lock, write_lock
from semgs_rooms.furniture.finish import finish
from semgs_rooms.furniture.kinds import PieceJob, make_job
from semgs_rooms.furniture.raw import Incomplete, RawMesh
from semgs_rooms.furniture.runner import OutOfTime, run_job

SETTINGS, RECORDS, MODELS, WORK = "bake.json", "pieces", "models", "work"

RECIPE = "e68229d504d60207"
"""Identifies, with the version, which pieces a seed gives. Change it whenever a piece of a seed would differ: folders with another
recipe are refused. It is no hash of the source, which comments would change."""


@dataclass(frozen=True)
class Generated:
    """Contents of a folder.

    Attributes:
        rows: of `catalog.json`.
        left_out: why a piece was excluded, by name.
        late: pieces that took too long, by name; the next call tries them again.
    """

    rows: tuple[dict, ...]
    left_out: dict[str, str]
    late: dict[str, str]


def generate(
    folder: str | Path,
    seed: int,
    pieces: int,
    *,
    environment: Path,
    limit: float = 1200.0,
    workers: int = 1,
    done: Callable[[int], None] = lambda count: None,
) -> Generated:
    """Generate those of pieces 0 .. pieces - 1 of a seed that are missing in a folder, then write its lists and its lock.

    Piece i depends only on the seed, on i and on the versions. To resume, repeat the call; a larger number adds pieces. Incomplete
    pieces are recorded and excluded.

    Args:
        folder: a new or empty one, or one with pieces of the same seed.
        seed: of the pieces.
        pieces: how many to try; some are excluded, and a kitchen may give two.
        environment: folder that `semgs_rooms.furniture.environment.prepare` made ready.
        limit: maximum time for one piece [s].
        workers: pieces generated in parallel, each in a process of its own.
        done: called with the number of pieces tried so far.

    Raises:
        ValueError: a number is too small, or the folder has pieces of another seed or version, or more of them.
        InputError: the folder is not ours, or the environment does not work or returns something other than pieces.
        ImportError: embreex is not installed; the message names the extra to install.
        OSError: the disk is full.
    """
    target = Path(folder)
    claim(target, seed, pieces)
    jobs = [make_job(seed, number) for number in range(pieces)]
    missing = [job for job in jobs if not record_of(target, job).is_file()]
    late: dict[str, str] = {}
    count = pieces - len(missing)
    done(count)
    stop, work = Event(), target / WORK

    def make(job: PieceJob) -> None:
        try:
            _record(target, job, run_job(environment, job, work, limit, stop))
        except OutOfTime as error:
            late[job.name] = str(error)
        except Incomplete as error:
            write_json(record_of(target, job), {"left_out": str(error)})

    shutil.rmtree(work, ignore_errors=True)  # from a call that was killed
    work.mkdir()
    crew = ThreadPoolExecutor(workers)
    try:
        for _ in (map if workers == 1 else crew.map)(make, missing):
            count += 1
            done(count)
    finally:
        stop.set()  # ends pieces in progress
        crew.shutdown(cancel_futures=True)
        shutil.rmtree(work, ignore_errors=True)
    return _listed(target, jobs, late)


def claim(folder: Path, seed: int, pieces: int) -> None:
    """Make the folder a library of this seed.

    Raises:
        ValueError: the seed or the number is too small, or it has pieces of another seed or version, or more of them.
        InputError: it contains something else.
    """
    if seed < 0 or pieces < 1:
        raise ValueError(f"seed is {seed} and pieces {pieces}; expected 0 or more, and 1 or more")
    settings = {"semgs": __version__, "recipe": RECIPE, "seed": seed}
    if is_begun(folder / SETTINGS, settings, "a library of furniture"):
        most = max((int(path.stem.rsplit("_", 1)[1]) for path in (folder / RECORDS).glob("bake_*.json")), default=-1)
        if most >= pieces:
            raise ValueError(
                f"{folder} contains pieces up to number {most}, more than the {pieces} requested; request at least {most + 1}"
            )
    else:
        folder.mkdir(parents=True, exist_ok=True)
        write_json(folder / SETTINGS, settings)
    for part in (RECORDS, MODELS):
        (folder / part).mkdir(exist_ok=True)


def record_of(folder: Path, job: PieceJob) -> Path:
    """The record of a piece that was tried: its catalogue rows, or why it was excluded."""
    return folder / RECORDS / f"{job.name}.json"


def _record(folder: Path, job: PieceJob, meshes: list[RawMesh]) -> None:
    """Finish one piece, write its files and record it."""
    rows = []
    for piece in finish(job, meshes):
        file = f"{MODELS}/{piece.name}.glb"
        piece.write(folder / file)
        rows.append(piece.row(file, (folder / file).stat().st_size, _infinigen_version()))
    write_json(record_of(folder, job), {"rows": rows})


def _listed(folder: Path, jobs: list[PieceJob], late: dict[str, str]) -> Generated:
    """Write both lists and the lock; returns what the folder contains."""
    rows: list[dict] = []
    left_out = {}
    for job in jobs:
        path = record_of(folder, job)
        if not path.is_file():
            continue
        try:
            record = parse_json(path.read_bytes())
            rows += record.get("rows", [])
        except (ValueError, AttributeError, TypeError) as error:
            raise InputError(
                path, "the record of a piece", str(error), advice="remove it to generate the piece again"
            ) from error
        if "left_out" in record:
            left_out[job.name] = str(record["left_out"])
    write_json(folder / LISTS[0], rows)
    write_text(folder / LISTS[1], "[]\n")
    write_lock(folder / NAME, make_lock(folder))
    return Generated(tuple(rows), left_out, late)


def _infinigen_version() -> str:
    """The version of Infinigen in the environment."""
    found = re.search(
        r"^infinigen==(\S+)", (files("semgs_rooms.furniture") / "requirements.txt").read_text(encoding="utf-8"), re.M
    )
    assert found is not None
    return found[1]

"""Prepared data sets: a folder of prepared scenes that is filled by worker processes and goes on where it was left.

settings.json     what all scenes were prepared with
SCENE.zip         one each, as `semgs.preparation.archive` has them
SHA256SUMS        their hashes, as `sha256sum -c` takes them
index.json        what is in each, those that could not be prepared and why, and the pixels of every class
"""

from __future__ import annotations

import json
import re
import shutil
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from semgs.data.asked import Asked
from semgs.data.layouts.parts.recordings import sequence_name
from semgs.data.prepared_record import read_record
from semgs.data.scene import Scene
from semgs.data.scene_lists import SceneList, calls
from semgs.data.scenes import open_scenes, scene_paths
from semgs.data.workers import outcomes
from semgs.files.atomic import write_json, write_text
from semgs.files.claims import is_begun
from semgs.files.errors import InputError
from semgs.files.folders import alone, check_writable
from semgs.files.hashes import sha256
from semgs.files.paths import typed_path
from semgs.preparation.archive import Preparation, estimated_bytes, fingerprint, prepare_scene

SETTINGS, INDEX, SUMS = "settings.json", "index.json", "SHA256SUMS"
SAMPLED_SCENES = 3
"""Of so many scenes some frames are prepared on trial, to find how much space all need."""
MARGIN = 1.05
"""The space asked for is this much more than what the trial says."""


@dataclass(frozen=True)
class SceneSource:
    """A scene to prepare.

    Attributes:
        path: where it is.
        name: of its archive; no other scene of the set has it.
    """

    path: Path
    name: str


@dataclass(frozen=True)
class Reading:
    """How sources are read.

    Attributes:
        as_peers: as for `open_scene`.
        asked: what the user says of all of them.
    """

    as_peers: tuple[str, ...] = ()
    asked: Asked = Asked()  # noqa: RUF009

    def open(self, source: SceneSource) -> Scene:
        """The scene of a source.

        Raises:
            InputError: as `open_scene`.
        """
        (scene,) = open_scenes(source.path, self.as_peers, self.asked)
        return scene

    def as_json(self) -> dict[str, Any]:
        """As `settings.json` keeps it: what was told, and nothing of what was not."""
        told = {name: value for name, value in vars(self.asked).items() if value is not None}
        return {"as_peers": sorted(self.as_peers), "told": json.loads(json.dumps(told))}


def sources(path: Path, wanted: SceneList | None = None) -> list[SceneSource]:
    """The scenes at a path, named by where they are below it.

    Args:
        path: a scene, or a folder with scenes, or one of such folders.
        wanted: those to take; None takes all.

    Raises:
        InputError: there is none, or not one that is wanted.
    """
    path = typed_path(path)
    paths = scene_paths(path)
    if paths == (path,):
        below = [Path(sequence_name(path) if path.is_dir() else path.stem)]
    else:
        below = [one.relative_to(path) for one in paths]
    found = [
        SceneSource(one, _safe("_".join((place if one.is_dir() else place.with_suffix("")).parts)))
        for one, place in zip(paths, below, strict=True)
    ]
    twice = [name for name, count in Counter(source.name for source in found).items() if count > 1]
    if twice:
        raise InputError(path, "scenes of different names", f"{twice[0]} twice")
    if wanted is None:
        return found
    by_path = {source.path: source for source in found}
    called = {**{source.name: source.path for source in found}, **calls(path, paths)}
    return [by_path[one] for one in wanted.choose(called, str(path))]


def prepare_set(
    out: Path,
    found: Sequence[SceneSource],
    settings: Preparation,
    reading: Reading,
    *,
    workers: int = 0,
    done: Callable[[int], None] = lambda count: None,
    frame_done: Callable[[int], None] | None = None,
) -> dict[str, Any]:
    """Prepare the scenes that a folder does not hold yet, then write its hashes and index.

    Every archive appears complete or not at all, so the same call goes on where an earlier one was cut short; an archive whose source has
    changed is made anew. A scene that cannot be prepared is passed over and listed.

    Args:
        out: a new or empty folder, or one that holds scenes of the same settings.
        found: the scenes.
        settings: how to prepare them.
        reading: how to read them.
        workers: processes that prepare; 0 prepares in this one.
        done: told how many scenes are done, at the start and after each.
        frame_done: told how many frames of the present scene are done; with it all work is done in this process.

    Returns:
        What `index.json` holds.

    Raises:
        ValueError: the folder holds scenes of other settings.
        InputError: the folder holds something else, another process is filling it, or no scene could be prepared (the first one's error).
        OSError: the disk is full.
    """
    check(out, settings, reading)
    out.mkdir(parents=True, exist_ok=True)
    if not (out / SETTINGS).is_file():
        write_json(out / SETTINGS, _settings(settings, reading))
    with _alone(out):
        for path in out.glob(".*.zip.*.part"):  # archives that were cut short
            path.unlink(missing_ok=True)
        work = partial(_entry, out, settings, reading, frame_done)
        failed = _prepared(work, found, workers if frame_done is None else 0, done)
        return _write_index(out, settings, reading, failed)


def _alone(out: Path) -> AbstractContextManager[None]:
    """Be the only one that prepares into a folder.

    Raises:
        InputError: another process does.
    """
    return alone(out / SETTINGS, "a folder that nobody prepares scenes into", "one that another process is filling")


def _prepared(
    work: Callable[[SceneSource], object], found: Sequence[SceneSource], workers: int, done: Callable[[int], None]
) -> dict[str, InputError]:
    """Prepare the scenes that are not there yet; those that could not be, and why.

    Raises:
        InputError: none could be (the first one's error).
    """
    failed: dict[str, InputError] = {}
    done(0)
    with closing(outcomes(work, found, workers)) as prepared:
        for count, (source, outcome) in enumerate(zip(found, prepared, strict=True), start=1):
            if isinstance(outcome, InputError):
                failed[source.name] = outcome
            elif isinstance(outcome, Exception):
                raise outcome
            done(count)
    if len(failed) == len(found):
        raise next(iter(failed.values()))
    return failed


def check(out: Path, settings: Preparation, reading: Reading) -> None:
    """See that a folder is or can become a prepared set of these settings.

    Raises:
        ValueError: it holds scenes of other settings, which are told.
        InputError: it holds something else, nothing can be written there, or another process is filling it.
    """
    begun = is_begun(out / SETTINGS, _settings(settings, reading), "a prepared set")
    with _alone(out) if begun else nullcontext():
        check_writable(out)


def _settings(settings: Preparation, reading: Reading) -> dict[str, Any]:
    """What `settings.json` holds."""
    return {**settings.as_json(), **reading.as_json()}


def needed_space(out: Path, found: Sequence[SceneSource], settings: Preparation, reading: Reading) -> int:
    """How many bytes the scenes that are not there yet will take, from some frames of some of them.

    Raises:
        InputError: none of those that were tried can be read (the first one's error).
    """
    missing = [source for source in found if not (out / f"{source.name}.zip").is_file()]
    sizes: list[int] = []
    errors: list[InputError] = []
    for index in sorted({round(step) for step in np.linspace(0, len(missing) - 1, min(len(missing), SAMPLED_SCENES))}):
        try:
            sizes.append(estimated_bytes(reading.open(missing[index]), settings))
        except InputError as error:
            errors.append(error)
    if errors and not sizes:
        raise errors[0]
    return round(MARGIN * len(missing) * float(np.mean(sizes))) if sizes else 0


def free_space(out: Path) -> int:
    """How many bytes are free where a folder is or will be."""
    nearest = next(one for one in (out.absolute(), *out.absolute().parents) if one.exists())
    return shutil.disk_usage(nearest).free


def _entry(
    out: Path, settings: Preparation, reading: Reading, frame_done: Callable[[int], None] | None, source: SceneSource
) -> dict[str, Any]:
    """The entry of a scene in the index; it is prepared if that is not there yet.

    Raises:
        InputError: it cannot be.
    """
    target = out / f"{source.name}.zip"
    scene = reading.open(source)
    there = read_record(target) if target.is_file() else None
    if there is not None and there.get("source") == fingerprint(scene):
        return there
    return prepare_scene(scene, target, settings, done=frame_done)


def _write_index(out: Path, settings: Preparation, reading: Reading, failed: dict[str, InputError]) -> dict[str, Any]:
    """Write the hashes and the index of all archives in a folder; what the index holds."""
    known = _sums(out)
    scenes, total, sums = [], Counter[str](), {}
    for archive in sorted(out.glob("*.zip")):
        record = read_record(archive)
        if record is None:
            continue
        stamp = archive.stat()
        old = known.get(archive.name)
        sums[archive.name] = old if old is not None and _older(archive, out / SUMS) else sha256(archive)
        total.update(record["pixels"])
        entry = {key: record[key] for key in ("frames", "depths", "labels", "label_set", "pixels", "notes")}
        layout = {"layout": record["source"]["layout"], "unit": record["source"]["unit"]}
        scenes.append(
            {"name": archive.stem, "file": archive.name, "bytes": stamp.st_size, "sha256": sums[archive.name], **layout, **entry}
        )  # fmt: skip
    write_text(out / SUMS, "".join(f"{digest}  {name}\n" for name, digest in sums.items()))
    index = {
        **settings.as_json(),
        **reading.as_json(),
        "frames": sum(scene["frames"] for scene in scenes),
        "bytes": sum(scene["bytes"] for scene in scenes),
        "pixels": dict(total),
        "failed": [{"name": name, "error": str(error)} for name, error in failed.items()],
        "scenes": scenes,
    }
    write_json(out / INDEX, index)
    return index


def _sums(out: Path) -> dict[str, str]:
    """The hashes that an earlier run wrote, by file."""
    try:
        lines = (out / SUMS).read_text(encoding="utf-8").splitlines()
    except OSError:
        return {}
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines)}


def _older(file: Path, than: Path) -> bool:
    """Whether a file was last written before another."""
    return file.stat().st_mtime_ns < than.stat().st_mtime_ns


def _safe(name: str) -> str:
    """A name as a file may have it anywhere."""
    return re.sub(r"[^\w.+-]+", "_", name).strip("._") or "scene"

"""Prepared data sets: a folder of prepared scenes, filled by worker processes; interrupted work can be resumed.

settings.json     the settings, the same for all scenes
SCENE.zip         one for each scene, see `semgs.data.preparation.archive`
SHA256SUMS        their hashes, for `sha256sum -c`
index.json        the content of each, scenes that failed and why, and the pixels of every class
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
from typing import Any, Protocol, runtime_checkable

import numpy as np

from semgs.data.layouts.parts.usable_frames import sequence_name
from semgs.data.origin.licences import read_record
from semgs.data.preparation.archive import Preparation, estimate_bytes, fingerprint, prepare_scene
from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.data.scene_lists import SceneList, scenes_by_name
from semgs.data.scenes import open_with_details, scene_paths
from semgs.data.spread import spread
from semgs.files.atomic import remove_parts, write_json, write_text
from semgs.files.claims import is_begun
from semgs.files.contents import sha256
from semgs.files.errors import InputError
from semgs.files.folders import check_writable, lock_folder
from semgs.files.paths import not_hidden, typed_path
from semgs.runtime.workers import WorkerKilledError, outcomes

SETTINGS, INDEX, SUMS = "settings.json", "index.json", "SHA256SUMS"
SAMPLED_SCENES = 3
"""The needed space is estimated from this many scenes."""
MARGIN = 1.05
"""Safety factor of the estimate."""


@dataclass(frozen=True)
class SceneSource:
    """A scene to prepare.

    Attributes:
        path: of the scene.
        name: of its archive, unique in the set.
    """

    path: Path
    name: str


@runtime_checkable
class Reader(Protocol):
    """How to read the scenes."""

    def open(self, source: SceneSource) -> Scene:
        """Open a scene.

        Raises:
            InputError: it cannot be opened.
        """
        ...

    def as_json(self) -> dict[str, Any]:
        """The details for `settings.json`."""
        ...


@dataclass(frozen=True)
class Reading:
    """Reads the scenes as they are.

    Attributes:
        as_peers: as for `open_scene`.
        details: details that apply to all scenes.
        needs_labels: as for `open_scene`.
    """

    as_peers: tuple[str, ...] = ()
    details: SceneDetails = SceneDetails()  # noqa: RUF009
    needs_labels: bool = True

    def open(self, source: SceneSource) -> Scene:
        """Open a scene.

        Raises:
            InputError: as `open_scene`.
        """
        return open_with_details(source.path, self.as_peers, self.details, self.needs_labels)

    def as_json(self) -> dict[str, Any]:
        """The given details for `settings.json`."""
        given = {name: value for name, value in vars(self.details).items() if value is not None}
        return {"as_peers": sorted(self.as_peers), "told": json.loads(json.dumps(given))}


def find_sources(path: Path, wanted: SceneList | None = None) -> list[SceneSource]:
    """The scenes at a path, named by their place below it.

    Args:
        path: a scene, a folder of scenes, or a folder of such folders.
        wanted: the scenes to take; None for all.

    Raises:
        InputError: there is none, or one in `wanted` is missing.
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
    called = {**{source.name: source.path for source in found}, **scenes_by_name(path, paths)}
    return [by_path[one] for one in wanted.choose(called, str(path))]


@dataclass(frozen=True)
class PreparedSet:
    """A folder of prepared scenes, or one that becomes it.

    Attributes:
        out: the folder; new, empty, or with scenes of the same settings.
        settings: how to prepare the scenes.
        reading: how to read them.
    """

    out: Path
    settings: Preparation
    reading: Reader

    def as_json(self) -> dict[str, Any]:
        """The content of `settings.json`."""
        return {**self.settings.as_json(), **self.reading.as_json()}

    def check(self) -> None:
        """Check that the folder is, or can become, a prepared set with these settings.

        Raises:
            ValueError: it was made with other settings; the error lists the differences.
            InputError: it contains something else, is not writable, or another process is using it.
        """
        begun = is_begun(self.out / SETTINGS, self.as_json(), "a prepared set")
        with self._alone() if begun else nullcontext():
            check_writable(self.out)

    def needed_space(self, found: Sequence[SceneSource]) -> int:
        """Estimate the bytes that the missing scenes will need, from some frames of some of them.

        Raises:
            InputError: none of the sampled scenes can be read (the first one's error).
        """
        missing = [source for source in found if not self._archive(source).is_file()]
        sizes: list[int] = []
        errors: list[InputError] = []
        for source in spread(missing, SAMPLED_SCENES):
            try:
                sizes.append(estimate_bytes(self.reading.open(source), self.settings))
            except InputError as error:
                errors.append(error)
        if errors and not sizes:
            raise errors[0]
        return round(MARGIN * len(missing) * float(np.mean(sizes))) if sizes else 0

    def prepare(
        self,
        found: Sequence[SceneSource],
        *,
        workers: int = 0,
        done: Callable[[int], None] = lambda count: None,
        frame_done: Callable[[int], None] | None = None,
    ) -> dict[str, Any]:
        """Prepare the scenes that are not in the folder yet, then write its hashes and index.

        Archives are written atomically, so the same call resumes an interrupted one. If the source of an archive has changed, it is
        prepared again. Scenes that fail are skipped and listed.

        Args:
            found: the scenes.
            workers: number of processes; 0 works in this one.
            done: called with the number of finished scenes, at the start and after each scene.
            frame_done: called with the number of finished frames of the current scene; if given, all work is done in this process.

        Returns:
            The content of `index.json`.

        Raises:
            ValueError: the folder was made with other settings.
            InputError: the folder contains something else, another process is using it, or all scenes failed (the first one's error).
            OSError: the disk is full.
        """
        self.check()
        self.out.mkdir(parents=True, exist_ok=True)
        if not (self.out / SETTINGS).is_file():
            write_json(self.out / SETTINGS, self.as_json())
        with self._alone():
            remove_parts(self.out, self.out / SETTINGS)
            work = partial(self._entry, frame_done)
            failed = _prepared(work, found, workers if frame_done is None else 0, done)
            return self._write_index(failed)

    def _alone(self) -> AbstractContextManager[None]:
        """Lock the folder against other processes that prepare scenes into it."""
        return lock_folder(self.out, "a folder that no other process prepares scenes into", "one in use")

    def _archive(self, source: SceneSource) -> Path:
        return self.out / f"{source.name}.zip"

    def _entry(self, frame_done: Callable[[int], None] | None, source: SceneSource) -> dict[str, Any]:
        """The record of a scene, which is prepared if its archive is missing or outdated."""
        target = self._archive(source)
        scene = self.reading.open(source)
        there = read_record(target) if target.is_file() else None
        if there is not None and there.get("source") == fingerprint(scene):
            return there
        return prepare_scene(scene, target, self.settings, done=frame_done)

    def _write_index(self, failed: dict[str, InputError | WorkerKilledError]) -> dict[str, Any]:
        """Write the hashes and index of all archives in the folder; returns the content of the index."""
        known = _sums(self.out)
        scenes, total, sums = [], Counter[str](), {}
        for archive in not_hidden(self.out.glob("*.zip")):
            record = read_record(archive)
            if record is None:
                continue
            stamp = archive.stat()
            old = known.get(archive.name)
            sums[archive.name] = old if old is not None and _older(archive, self.out / SUMS) else sha256(archive)
            total.update(record["pixels"])
            entry = {key: record[key] for key in ("frames", "depths", "labels", "label_set", "pixels", "notes")}
            layout = {"layout": record["source"]["layout"], "unit": record["source"]["unit"]}
            scenes.append(
                {"name": archive.stem, "file": archive.name, "bytes": stamp.st_size, "sha256": sums[archive.name], **layout, **entry}
            )  # fmt: skip
        write_text(self.out / SUMS, "".join(f"{digest}  {name}\n" for name, digest in sums.items()))
        index = {
            **self.as_json(),
            "frames": sum(scene["frames"] for scene in scenes),
            "bytes": sum(scene["bytes"] for scene in scenes),
            "pixels": dict(total),
            "failed": [{"name": name, "error": str(error)} for name, error in failed.items()],
            "scenes": scenes,
        }
        write_json(self.out / INDEX, index)
        return index


def _prepared(
    work: Callable[[SceneSource], object], found: Sequence[SceneSource], workers: int, done: Callable[[int], None]
) -> dict[str, InputError | WorkerKilledError]:
    """Prepare scenes; returns those that failed, and why. Raises the first error if all failed."""
    failed: dict[str, InputError | WorkerKilledError] = {}
    done(0)
    with closing(outcomes(work, found, workers)) as prepared:
        for count, (source, outcome) in enumerate(zip(found, prepared, strict=True), start=1):
            if isinstance(outcome, InputError | WorkerKilledError):
                failed[source.name] = outcome
            elif isinstance(outcome, Exception):
                raise outcome
            done(count)
    if len(failed) == len(found):
        raise next(iter(failed.values()))
    return failed


def free_space(out: Path) -> int:
    """Free bytes on the disk of a folder that may not exist yet."""
    nearest = next(one for one in (out.absolute(), *out.absolute().parents) if one.exists())
    return shutil.disk_usage(nearest).free


def _sums(out: Path) -> dict[str, str]:
    """The hashes from an earlier call, by file name."""
    try:
        lines = (out / SUMS).read_text(encoding="utf-8").splitlines()
    except OSError:
        return {}
    return {name: digest for digest, _, name in (line.partition("  ") for line in lines)}


def _older(file: Path, than: Path) -> bool:
    """Whether a file is older than another."""
    return file.stat().st_mtime_ns < than.stat().st_mtime_ns


def _safe(name: str) -> str:
    """A name that is a valid file name on any system."""
    return re.sub(r"[^\w.+-]+", "_", name).strip("._") or "scene"

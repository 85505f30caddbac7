"""RUN/data.json: the scenes that a run started with, their class counts, and the terms of its data.

Samples choose scenes by number, so a run only resumes with the scenes that it started with.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from semgs.data.origin.licences import terms_of, terms_of_photos
from semgs.data.origin.terms import FURNISHED, Terms, terms_from, terms_text
from semgs.data.origin.terms import ROOMS as ROOMS_TERMS
from semgs.data.scene import Scene
from semgs.files.atomic import write_json
from semgs.files.errors import InputError
from semgs.files.records import make_record
from semgs.files.strict_json import parse_json
from semgs.model.weights.load import data_terms, trained_scenes
from semgs.training.data.data_check.counts import Pixels
from semgs.training.data.data_settings import DataSettings

RECORD = "data.json"

UNSTATED = Terms("data of a run that an older version of semgs began: terms not stated")


@dataclass(frozen=True)
class RoomCounts:
    """The pixels of each class in some generated rooms; None if they were not counted."""

    pixels: tuple[float, ...] | None


@dataclass(frozen=True)
class SceneCounts:
    """A scene: its name, how many frames it has, its pixels of each class (None: not counted), and whether it is a saved room."""

    name: str
    frames: int
    pixels: tuple[float, ...] | None
    drawn: bool = False


@dataclass(frozen=True)
class DataRecord:
    """The data of a run.

    Attributes:
        scenes: of all folders.
        rooms: those generated while training.
        before: names of the scenes that the initial weights have seen.
        terms: of all data, from `terms_text`; None if a version wrote it that did not state them.
    """

    scenes: tuple[SceneCounts, ...]
    rooms: RoomCounts
    before: tuple[str, ...] = ()
    terms: str | None = None


def read_record(path: Path) -> DataRecord | None:
    """The record of a run; None if it has none.

    Raises:
        InputError: it is damaged.
    """
    try:
        return make_record(DataRecord, parse_json(path.read_bytes()))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise InputError(path, "the record of the run's data", str(error)) from error


def scenes_of(path: Path) -> tuple[str, ...]:
    """The names of all scenes that a run has seen, including those of its initial weights; none if there is no record.

    Generated rooms are left out, because they have the same names with every seed.

    Raises:
        InputError: the record is damaged.
    """
    record = read_record(path)
    if record is None:
        return ()
    return tuple(dict.fromkeys([*record.before, *(scene.name for scene in record.scenes if not scene.drawn)]))


def data_terms_of(path: Path) -> tuple[Terms, ...]:
    """The terms of all data that a run has seen, including those of its initial weights.

    Raises:
        InputError: the record is damaged.
    """
    record = read_record(path)
    if record is None or record.terms is None:
        return (UNSTATED,)
    try:
        return terms_from(record.terms)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(path, "the record of the run's data", str(error)) from error


def write_record(
    path: Path,
    scenes: Sequence[Scene],
    pixels: Sequence[Pixels | None],
    before: Sequence[str],
    terms: Sequence[Terms],
) -> None:
    """Write the scenes and their counts, the scenes that the initial weights have seen, and the terms of both."""
    counts = [None if count is None else tuple(count.tolist()) for count in pixels]
    scene_counts = tuple(
        SceneCounts(scene.name, len(scene), count, terms_of_photos(scene) in (ROOMS_TERMS, FURNISHED))
        for scene, count in zip(scenes, counts[:-1], strict=True)
    )
    write_json(path, asdict(DataRecord(scene_counts, RoomCounts(counts[-1]), tuple(before), terms_text(terms))))


def read_counts(path: Path, scenes: Sequence[Scene]) -> list[Pixels | None] | None:
    """The pixels that were counted when the run started, in each scene and, last, in rooms; None if it starts now.

    Raises:
        InputError: the record is damaged, or lists other scenes.
    """
    record = read_record(path)
    if record is None:
        return None
    there = [(scene.name, scene.frames) for scene in record.scenes]
    here = [(scene.name, len(scene)) for scene in scenes]
    if there != here:
        other = sorted({name for name, _ in set(there) ^ set(here)})
        raise InputError(
            path, f"the {len(there)} scenes that the run started with", f"{len(here)}, of which {other[0]} differs",
            advice="restore those, or train in a new folder",
        )  # fmt: skip
    pixels = [*(scene.pixels for scene in record.scenes), record.rooms.pixels]
    return [None if counts is None else np.array(counts, dtype=np.float64) for counts in pixels]


def scenes_before(init: str) -> tuple[str, ...]:
    """The scenes that the initial weights have seen, if they say so."""
    return () if init == "random" else trained_scenes(init)


def terms_of_run(settings: DataSettings, init: str, scenes: Sequence[Scene]) -> tuple[Terms, ...]:
    """The terms of rooms and scenes, and of the data that the initial weights were trained on."""
    live = any(source.is_rooms for source in settings.sources)
    rooms = [FURNISHED if settings.assets else ROOMS_TERMS] if live else []
    before = () if init == "random" else data_terms(init)
    return tuple(dict.fromkeys([*rooms, *(terms_of(scene) for scene in scenes), *before]))

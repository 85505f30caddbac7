"""RUN/data.json: the scenes that a run started with, their class counts, and the terms of its data.

Samples choose scenes by number, so a run only resumes with the scenes that it started with.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from semgs.data.origin.licences import FURNISHED, Terms, terms_from, terms_of, terms_of_photos, terms_text
from semgs.data.origin.licences import ROOMS as ROOMS_TERMS
from semgs.data.scene import Scene
from semgs.files.atomic import write_json
from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json
from semgs.model.weights.load import data_terms, trained_scenes
from semgs.training.data.data_check.counts import Pixels
from semgs.training.training_settings import TrainingSettings

RECORD = "data.json"

UNSTATED = Terms("data of a run that an older version of semgs began: terms not stated")


def scenes_of(record: Path) -> tuple[str, ...]:
    """The names of all scenes that a run has seen, including those of its initial weights; none if there is no record.

    Generated rooms are left out, because they have the same names with every seed.

    Raises:
        InputError: the record is damaged.
    """
    if not record.is_file():
        return ()
    try:
        content = parse_json(record.read_bytes())
        return tuple(
            dict.fromkeys(
                [*content.get("before", ()), *(one["name"] for one in content["scenes"] if not one.get("drawn"))]
            )
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(record, "the record of the run's data", str(error)) from error


def data_terms_of(record: Path) -> tuple[Terms, ...]:
    """The terms of all data that a run has seen, including those of its initial weights.

    Raises:
        InputError: the record is damaged.
    """
    try:
        content = parse_json(record.read_bytes())
        return terms_from(content["terms"]) if "terms" in content else (UNSTATED,)
    except FileNotFoundError:
        return (UNSTATED,)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(record, "the record of the run's data", str(error)) from error


def remember(
    record: Path,
    scenes: Sequence[Scene],
    pixels: Sequence[Pixels | None],
    before: Sequence[str],
    terms: Sequence[Terms],
) -> None:
    """Write the scenes and their counts, the scenes that the initial weights have seen, and the terms of both."""
    counts = [None if one is None else one.tolist() for one in pixels]
    rooms = (ROOMS_TERMS, FURNISHED)
    listed = [
        {"name": scene.name, "frames": len(scene), "pixels": held, "drawn": terms_of_photos(scene) in rooms}
        for scene, held in zip(scenes, counts[:-1], strict=True)
    ]
    write_json(
        record, {"scenes": listed, "rooms": {"pixels": counts[-1]}, "before": list(before), "terms": terms_text(terms)}
    )


def remembered(record: Path, scenes: Sequence[Scene]) -> list[Pixels | None] | None:
    """The pixels that were counted when the run started; None if it starts now.

    Raises:
        InputError: the record is damaged, or lists other scenes.
    """
    if not record.is_file():
        return None
    try:
        before = parse_json(record.read_bytes())
        there = [(str(one["name"]), int(one["frames"])) for one in before["scenes"]]
        pixels = [*(one["pixels"] for one in before["scenes"]), before["rooms"]["pixels"]]
        counts = [None if one is None else np.array(one, dtype=np.float64) for one in pixels]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(record, "the record of the run's data", str(error)) from error
    here = [(scene.name, len(scene)) for scene in scenes]
    if there != here:
        other = sorted({name for name, _ in set(there) ^ set(here)})
        raise InputError(
            record, f"the {len(there)} scenes that the run started with", f"{len(here)}, of which {other[0]} differs",
            advice="restore those, or train in a new folder",
        )  # fmt: skip
    return counts


def started_on(settings: TrainingSettings) -> tuple[str, ...]:
    """The scenes that the initial weights have seen, if they say so."""
    return () if settings.init == "random" else trained_scenes(settings.init)


def terms_of_run(settings: TrainingSettings, scenes: Sequence[Scene]) -> tuple[Terms, ...]:
    """The terms of rooms and scenes, and of the data that the initial weights were trained on."""
    drawn = [FURNISHED if settings.assets else ROOMS_TERMS] if any(one.is_rooms for one in settings.sources) else []
    before = () if settings.init == "random" else data_terms(settings.init)
    return tuple(dict.fromkeys([*drawn, *(terms_of(scene) for scene in scenes), *before]))

"""Survey of a run's data, made once before it starts and recorded in RUN/data.json."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.errors import InputError
from semgs.rooms.sets.room_stream import RoomSamples
from semgs.training.data.data_check.checks import check_cameras, check_depth, check_labels, check_validation, notes_on
from semgs.training.data.data_check.counts import class_shares, count_pixels, inverse_frequency, with_chances
from semgs.training.data.data_check.open_sources import check_bad, open_source, training_paths
from semgs.training.data.data_check.scene_record import RECORD, remember, remembered, started_on, terms_of_run
from semgs.training.data.data_sources import ROOMS
from semgs.training.data.samples import Folder
from semgs.training.training_settings import CLASS_WEIGHTINGS, TrainingSettings


@dataclass(frozen=True)
class Survey:
    """A run's data.

    Attributes:
        classes: the class table of the run.
        folders: the scenes of each folder among the sources.
        scenes: number of scenes in folders, including bad ones.
        bad: scenes that cannot be used: path and reason.
        class_weights: those of the settings, as numbers.
        notes: sentences for the user.
    """

    classes: ClassTable
    folders: tuple[Folder, ...]
    scenes: int
    bad: tuple[tuple[str, str], ...]
    class_weights: tuple[float, ...] | None
    notes: tuple[str, ...] = ()


def survey(settings: TrainingSettings, out: Path, rooms: Callable[[], RoomSamples]) -> Survey:
    """Survey the data, or read the record from when the run started.

    Args:
        settings: of the run.
        out: its folder, for the record.
        rooms: makes small rooms to count classes in, if they are needed.

    Raises:
        InputError: there are no scenes or too many bad ones, labels or depth are missing, labels are of other classes, validation scenes
            show the same rooms, or the scenes are not those that the run started with.
    """
    classes = settings.classes or SCANNET20
    if settings.sampling == "balanced" and all(source.is_rooms for source in settings.sources):
        raise InputError(ROOMS, "scenes in folders, for balanced sampling", "only rooms, which are generated at random")
    opened = [open_source(source, paths, settings.contexts[1], settings) for source, paths in training_paths(settings)]
    good = [scene for folder in opened for scene in folder.scenes]
    bad = tuple(one for folder in opened for one in folder.bad)
    check_bad(bad, len(good) + len(bad))
    for folder in opened:
        if not folder.scenes:
            path, why = folder.bad[0]
            raise InputError(folder.source.path, "usable scenes", f"none; {path}: {why}")
    check_cameras(settings, good)
    check_labels(settings, good, classes)
    check_depth(settings, good)
    pixels = remembered(out / RECORD, good)
    before = started_on(settings) if pixels is None else ()
    terms = terms_of_run(settings, good) if pixels is None else ()
    check_validation(settings, classes, [*before, *(scene.name for scene in good)])
    if pixels is None:
        pixels = count_pixels(settings, good, rooms, classes)
        remember(out / RECORD, good, pixels, before, terms)
    shares = class_shares(settings, opened, pixels, classes)
    weights = settings.class_weights
    if (isinstance(weights, str) or settings.sampling == "balanced") and not shares.any():
        raise InputError(", ".join(settings.data), f"pixels of the classes of {classes.name}, to count them", "none")
    return Survey(
        classes=classes,
        folders=with_chances(settings, opened, pixels, shares),
        scenes=len(good) + len(bad),
        bad=bad,
        class_weights=inverse_frequency(shares, CLASS_WEIGHTINGS[weights]) if isinstance(weights, str) else weights,
        notes=tuple(notes_on(settings, good, classes)),
    )

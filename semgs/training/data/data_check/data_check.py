"""The check of a run's data, made once before it starts and recorded in RUN/data.json."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from semgs.data.tables.classes import ClassTable
from semgs.files.errors import InputError
from semgs.training.data.data_check.checks import check_labelled, check_scenes, check_validation, label_notes
from semgs.training.data.data_check.counts import (
    any_labelled,
    class_shares,
    count_pixels,
    inverse_frequency,
    make_folders,
)
from semgs.training.data.data_check.open_sources import check_bad, open_source, training_paths
from semgs.training.data.data_check.scene_record import RECORD, read_counts, scenes_before, terms_of_run, write_record
from semgs.training.data.data_settings import ROOMS, DataSettings, view_counts
from semgs.training.data.samples import Folder
from semgs.training.supervision.supervision_settings import CLASS_WEIGHTINGS, SupervisionSettings


@dataclass(frozen=True)
class RunData:
    """A run's data, checked.

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


def check_data(settings: DataSettings, learning: SupervisionSettings, init: str, out: Path) -> RunData:
    """Check the data of a run, and count its classes or read the counts from when the run started.

    Args:
        settings: of the data.
        learning: settings of the supervision: whether labels and depth are needed, and the class weights.
        init: the initial weights.
        out: the run folder, for the record.

    Raises:
        InputError: there are no scenes or too many bad ones, labels or depth are missing, labels are of other classes, validation scenes
            show the same rooms, or the scenes are not those that the run started with.
    """
    balanced, rule = settings.sampling == "balanced", learning.class_weights
    if balanced and all(source.is_rooms for source in settings.sources):
        raise InputError(ROOMS, "scenes in folders, for balanced sampling", "only rooms, which are generated at random")
    (_, most), targets = view_counts(settings, learning.single_images)
    opened = [open_source(source, paths, most, targets) for source, paths in training_paths(settings)]
    scenes = [scene for source in opened for scene in source.scenes]
    bad = tuple(scene for source in opened for scene in source.bad)
    check_bad(bad, len(scenes) + len(bad))
    for source in opened:
        if not source.scenes:
            path, why = source.bad[0]
            raise InputError(source.source.path, "usable scenes", f"none; {path}: {why}")
    check_scenes(scenes, settings, learning)
    check_labelled(scenes, settings, learning)
    pixels = read_counts(out / RECORD, scenes)
    before = scenes_before(init) if pixels is None else ()
    terms = terms_of_run(settings, init, scenes) if pixels is None else ()
    check_validation(settings, learning, [*before, *(scene.name for scene in scenes)])
    needs_counts = isinstance(rule, str) or balanced
    if pixels is None:
        pixels = count_pixels(settings, scenes) if needs_counts else [None] * (len(scenes) + 1)
        write_record(out / RECORD, scenes, pixels, before, terms)
    shares = class_shares(settings, opened, pixels)
    if needs_counts and not shares.any():
        any_labelled(settings, scenes)  # files that cannot be read are the better reason
        raise InputError(
            ", ".join(settings.data), f"pixels of the classes of {settings.table.name}, to count them", "none"
        )
    return RunData(
        classes=settings.table,
        folders=make_folders(opened, pixels, shares if balanced else None),
        scenes=len(scenes) + len(bad),
        bad=bad,
        class_weights=inverse_frequency(shares, CLASS_WEIGHTINGS[rule]) if isinstance(rule, str) else rule,
        notes=label_notes(scenes, settings) if learning.uses_labels else (),
    )

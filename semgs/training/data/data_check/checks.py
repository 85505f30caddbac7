"""Check that scenes have the labels and depth that the settings need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from semgs.data.scene import Scene
from semgs.data.scene_lists import check_unseen
from semgs.data.scenes import scene_paths
from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.errors import InputError
from semgs.training.data.data_check.open_sources import check_bad, open_source
from semgs.training.data.data_sources import Source
from semgs.training.supervision.supervision import supervision_of
from semgs.training.training_settings import TrainingSettings


def check_labels(settings: TrainingSettings, scenes: Sequence[Scene], classes: ClassTable) -> None:
    """Refuse labels that do not fit the class table of the run, and data without labels if classes are to be learned.

    Raises:
        InputError: the labels do not fit (`check_tables`), or there are none at all.
    """
    check_tables(settings, scenes, classes)
    advice = supervision_of(replace(settings, class_weights=None)).without_labels
    labelled = any(scene.classes is not None for scene in scenes)
    if advice is not None and not labelled and not any(source.is_rooms for source in settings.sources):
        raise InputError(scenes[0].path, "scenes with labels, to learn classes from", "none", advice=advice)


def check_tables(settings: TrainingSettings, scenes: Sequence[Scene], classes: ClassTable) -> None:
    """Refuse labels that do not fit the class table of the run, unless labels do not matter.

    Raises:
        InputError: they are of another table and the settings name none, or the named table has none of their classes.
    """
    for scene in scenes:
        if scene.classes is None or settings.supervision == "depth":
            continue
        if settings.classes is None and scene.classes != classes:
            raise InputError(
                scene.path, f"labels of class table {classes.name}", f"labels of {scene.classes.name}",
                advice="name the class table to train with: --classes FILE",
            )  # fmt: skip
        if not set(scene.classes.names) & set(classes.names):
            raise InputError(
                scene.path, f"classes of table {classes.name}: {', '.join(classes.names)}",
                f"table {scene.classes.name}, which has none of them",
            )  # fmt: skip


def check_depth(settings: TrainingSettings, scenes: Sequence[Scene]) -> None:
    """Refuse scenes without any depth, if depth is to be learned.

    Raises:
        InputError: there are such scenes; the first one is named.
    """
    advice = supervision_of(replace(settings, class_weights=None)).without_depth
    without = [scene for scene in scenes if all(frame.depth is None for frame in scene.frames)]
    if advice is not None and without:
        raise InputError(
            without[0].path, "frames with depth, to learn depth from",
            f"none; {len(without)} of {len(scenes)} scenes have no depth", advice=advice,
        )  # fmt: skip


def check_cameras(settings: TrainingSettings, scenes: Sequence[Scene]) -> None:
    """Refuse images without cameras, unless each sample is a single image.

    Raises:
        InputError: there are such images.
    """
    for scene in scenes:
        if not scene.posed and not settings.single_pictures:
            raise InputError(
                scene.path, f"images with cameras, for --supervision {settings.supervision}",
                f"{scene.layout}, which have none",
                advice="train on single images: --supervision pictures --contexts 1 1 --targets 0",
            )  # fmt: skip


def check_validation(settings: TrainingSettings, classes: ClassTable, trained: Sequence[str]) -> None:
    """Refuse validation scenes that cannot be used, by the same rules as training scenes.

    Raises:
        InputError: too many are bad, their labels are of another class table, one lacks depth that is to be learned, or they show the
            same rooms as the training scenes.
    """
    source = Source.parsed(settings.validation)
    if not source.is_rooms and settings.validation_scenes:
        opened = open_source(source, scene_paths(source.path), settings.contexts[0], settings)
        check_bad(opened.bad, len(opened.scenes) + len(opened.bad))
        check_cameras(settings, opened.scenes)
        check_tables(settings, opened.scenes, classes)
        check_depth(settings, opened.scenes)
        names = [scene.name for scene in opened.scenes]
        check_unseen(source.path, trained, names, "validate on other rooms, or train without these")


def notes_on(settings: TrainingSettings, scenes: Sequence[Scene], classes: ClassTable) -> list[str]:
    """Notes on other class tables and on scenes without labels; none if labels do not matter."""
    if settings.supervision == "depth":
        return []
    tables = {scene.classes.name: scene.classes for scene in scenes if scene.classes not in (None, classes)}
    if classes != SCANNET20 and any(
        source.is_rooms for source in (*settings.sources, Source.parsed(settings.validation))
    ):
        tables["rooms"] = SCANNET20
    notes = []
    for name, table in tables.items():
        kept = [one for one in table.names if one in classes.names]
        notes.append(
            f"labels of {name}: {len(kept)} of {len(table)} classes are in {classes.name}; pixels of the other classes are ignored"
        )
    without = sum(scene.classes is None for scene in scenes)
    if without:
        notes.append(f"{without} of {len(scenes)} scenes have no labels and only teach colour")
    return notes

"""Check that scenes can teach what the settings ask for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from semgs.data.classes import SCANNET20, ClassTable
from semgs.data.scene import Scene
from semgs.data.scene_lists import check_unseen
from semgs.data.scenes import scene_paths
from semgs.files.errors import InputError
from semgs.training.settings import TrainingSettings
from semgs.training.source import Source
from semgs.training.supervision import supervision_of
from semgs.training.survey.opened import check_bad, open_source


def check_labels(settings: TrainingSettings, scenes: Sequence[Scene], classes: ClassTable) -> None:
    """Refuse labels that the table of the run cannot say, and data without any.

    Raises:
        InputError: as `check_tables`, or there are no labels at all although classes are to be learned.
    """
    check_tables(settings, scenes, classes)
    advice = supervision_of(replace(settings, class_weights=None)).without_labels
    labelled = any(scene.classes is not None for scene in scenes)
    if advice is not None and not labelled and not any(source.is_rooms for source in settings.sources):
        raise InputError(scenes[0].path, "scenes with labels, to learn classes from", "none with any", advice=advice)


def check_tables(settings: TrainingSettings, scenes: Sequence[Scene], classes: ClassTable) -> None:
    """Refuse labels that the table of the run cannot say, unless no label counts.

    Raises:
        InputError: they are of another table and none was asked for, or none of their classes is in the one asked for.
    """
    for scene in scenes:
        if scene.classes is None or settings.supervision == "depth":
            continue
        if settings.classes is None and scene.classes != classes:
            raise InputError(
                scene.path, f"labels of table {classes.name}", f"those of {scene.classes.name}",
                advice="name the table of the training with --classes FILE",
            )  # fmt: skip
        if not set(scene.classes.names) & set(classes.names):
            raise InputError(
                scene.path, f"classes of table {classes.name}: {', '.join(classes.names)}",
                f"table {scene.classes.name}, which has none of them",
            )  # fmt: skip


def check_depth(settings: TrainingSettings, scenes: Sequence[Scene]) -> None:
    """Refuse scenes that teach nothing because none of their frames has depth.

    Raises:
        InputError: there are some and depth is to be learned; the first one is named.
    """
    advice = supervision_of(replace(settings, class_weights=None)).without_depth
    without = [scene for scene in scenes if all(frame.depth is None for frame in scene.frames)]
    if advice is not None and without:
        raise InputError(
            without[0].path, "frames with depth, to learn depth from",
            f"none with any; {len(without)} of {len(scenes)} scenes are like that", advice=advice,
        )  # fmt: skip


def check_validation(settings: TrainingSettings, classes: ClassTable, trained: Sequence[str]) -> None:
    """Refuse scenes of validation that cannot be used; as strict as with those of the training.

    Raises:
        InputError: too many of them are bad, their labels are of another table, one has no depth although that is to be
            learned, or they show rooms of the scenes that are trained on.
    """
    source = Source.parsed(settings.validation)
    if not source.is_rooms and settings.validation_scenes:
        opened = open_source(source, scene_paths(source.path), settings.contexts[0], settings)
        check_bad(opened.bad, len(opened.scenes) + len(opened.bad))
        check_tables(settings, opened.scenes, classes)
        check_depth(settings, opened.scenes)
        names = [scene.name for scene in opened.scenes]
        check_unseen(source.path, trained, names, "validate on other rooms, or train without these")


def notes_on(settings: TrainingSettings, scenes: Sequence[Scene], classes: ClassTable) -> list[str]:
    """What becomes of tables that are not that of the run, and of scenes without labels; nothing if no label counts."""
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
            f"labels of {name}: {len(kept)} of {len(table)} classes are in table {classes.name}; pixels of the others are ignored"
        )
    without = sum(scene.classes is None for scene in scenes)
    if without:
        notes.append(f"{without} of {len(scenes)} scenes have no labels; they teach colour alone")
    return notes

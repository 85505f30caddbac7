"""Check that scenes have the labels and depth that the settings need."""

from __future__ import annotations

from collections.abc import Sequence

from semgs.data.scene import Scene
from semgs.data.scene_lists import check_unseen
from semgs.data.scenes import scene_paths
from semgs.data.tables.classes import SCANNET20
from semgs.files.errors import InputError
from semgs.training.data.data_check.counts import any_labelled
from semgs.training.data.data_check.open_sources import check_bad, open_source
from semgs.training.data.data_settings import DataSettings, Source, view_counts
from semgs.training.supervision.supervision_settings import SupervisionSettings


def check_scenes(scenes: Sequence[Scene], settings: DataSettings, learning: SupervisionSettings) -> None:
    """Refuse scenes from which the network cannot learn.

    Raises:
        InputError: images have no cameras and each sample is more than a single image; labels are of another table and the settings name
            none, or the named table has none of their classes; or a scene has no depth, which is to be learned.
    """
    table = settings.table
    for scene in scenes:
        if not scene.posed and not learning.single_images:
            raise InputError(
                scene.path, f"images with cameras, for --supervision {learning.supervision}",
                f"{scene.layout}, which have none", advice="to train on single images, give --supervision pictures",
            )  # fmt: skip
    for scene in scenes if learning.uses_labels else ():
        if scene.classes is None:
            continue
        if settings.classes is None and scene.classes != table:
            raise InputError(
                scene.path, f"labels of class table {table.name}", f"labels of {scene.classes.name}",
                advice="name the class table to train with: --classes FILE",
            )  # fmt: skip
        if not set(scene.classes.names) & set(table.names):
            raise InputError(
                scene.path, f"classes of table {table.name}: {', '.join(table.names)}",
                f"table {scene.classes.name}, which has none of them",
            )  # fmt: skip
    without = [scene for scene in scenes if all(frame.depth is None for frame in scene.frames)]
    if learning.without_depth is not None and without:
        raise InputError(
            without[0].path, "frames with depth, to learn depth from",
            f"none; {len(without)} of {len(scenes)} scenes have no depth", advice=learning.without_depth,
        )  # fmt: skip


def check_labelled(scenes: Sequence[Scene], settings: DataSettings, learning: SupervisionSettings) -> None:
    """Refuse data without labels if classes are to be learned.

    Raises:
        InputError: there are no labels at all, no pixel has one, or the files cannot be read.
    """
    labelled = any(scene.classes is not None for scene in scenes) or any(source.is_rooms for source in settings.sources)
    if learning.without_labels is not None and not labelled:
        raise InputError(
            scenes[0].path, "scenes with labels, to learn classes from", "none", advice=learning.without_labels
        )
    blank = not learning.teacher and not any(source.is_rooms for source in settings.sources)
    if learning.without_labels is not None and blank and not any_labelled(settings, scenes):
        raise InputError(
            scenes[0].path, f"pixels of the classes of {settings.table.name}, to learn classes from",
            "label maps in which no pixel has a label", advice=learning.without_labels,
        )  # fmt: skip


def check_validation(settings: DataSettings, learning: SupervisionSettings, trained: Sequence[str]) -> None:
    """Refuse validation scenes that cannot be used, by the same rules as training scenes.

    Raises:
        InputError: too many are bad, `check_scenes` refuses them, or they show the same rooms as the training scenes.
    """
    source = Source.parsed(settings.validation)
    if not source.is_rooms and settings.validation_scenes:
        (fewest, _), targets = view_counts(settings, learning.single_images)
        opened = open_source(source, scene_paths(source.path), fewest, targets)
        check_bad(opened.bad, len(opened.scenes) + len(opened.bad))
        check_scenes(opened.scenes, settings, learning)
        names = [scene.name for scene in opened.scenes]
        check_unseen(source.path, trained, names, "validate on other rooms, or train without these")


def label_notes(scenes: Sequence[Scene], settings: DataSettings) -> tuple[str, ...]:
    """Notes on other class tables and on scenes without labels."""
    classes = settings.table
    tables = {scene.classes.name: scene.classes for scene in scenes if scene.classes not in (None, classes)}
    sources = (*settings.sources, Source.parsed(settings.validation))
    if classes != SCANNET20 and any(source.is_rooms for source in sources):
        tables["rooms"] = SCANNET20
    notes = []
    for name, table in tables.items():
        common = [label for label in table.names if label in classes.names]
        notes.append(
            f"labels of {name}: {len(common)} of {len(table)} classes are in {classes.name}; pixels of the other classes are ignored"
        )
    without = sum(scene.classes is None for scene in scenes)
    if without:
        notes.append(f"{without} of {len(scenes)} scenes have no labels and only teach colour")
    return tuple(notes)

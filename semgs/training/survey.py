"""Survey: what the data of a run are, found out once before it starts and kept in RUN/data.json.

Every scene is opened (headers, not pictures), so that what is missing is told before hours are spent; where the settings ask
for it, it is counted how often each class occurs. A run goes on with the scenes that it began with or not at all: sample k is
drawn from them by number.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from semgs.data.classes import IGNORE, SCANNET20, ClassTable
from semgs.data.scene import Scene
from semgs.data.scene_lists import calls, check_unseen, read_list
from semgs.data.scenes import open_scene, scene_paths
from semgs.data.terms import FURNISHED, Terms, terms_from, terms_of, terms_text
from semgs.data.terms import ROOMS as ROOMS_TERMS
from semgs.data.views import Views
from semgs.files.atomic import write_json
from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json
from semgs.rooms.stream import RoomSamples
from semgs.training.samples import Folder, relabelled
from semgs.training.settings import CLASS_WEIGHTINGS, ROOMS, Source, TrainingSettings
from semgs.training.supervision import supervision_of
from semgs.weights.load import data_terms, trained_scenes

RECORD = "data.json"

TOLERATED = 0.05
"""The part of all scenes that may be bad."""

UNSTATED = Terms("data of a run that an older version of semgs began: terms not stated")

FRAMES_COUNTED = 4
"""Frames of each scene in which classes are counted."""

BALANCE = 0.5
"""Balanced sampling goes by the mean factor of a scene's pixels, of `inverse_frequency` with this power."""

Pixels = np.ndarray
"""Pixels of each class [class], float64."""


@dataclass(frozen=True)
class Survey:
    """What the data are.

    Attributes:
        classes: the table of the run.
        folders: the scenes of each source that is not the rooms.
        scenes: how many scenes they have, bad ones included.
        bad: scenes that cannot be used: path and why.
        class_weights: what the settings ask for, as numbers.
        notes: what the user should be told, a sentence each.
    """

    classes: ClassTable
    folders: tuple[Folder, ...]
    scenes: int
    bad: tuple[tuple[str, str], ...]
    class_weights: tuple[float, ...] | None
    notes: tuple[str, ...] = ()


def survey(settings: TrainingSettings, out: Path, rooms: Callable[[], RoomSamples]) -> Survey:
    """Look at the data, or read what was found when the run began.

    Args:
        settings: of the run.
        out: its folder, for the record.
        rooms: gives small rooms to count classes in, if they are asked for.

    Raises:
        InputError: there are no scenes, too many bad ones, none with labels, one without depth that is to be learned from, labels of
            other classes, rooms of the validation among them, or other scenes than those that the run began with.
    """
    classes = settings.classes or SCANNET20
    if settings.sampling == "balanced" and all(source.is_rooms for source in settings.sources):
        raise InputError(
            ROOMS, "scenes in folders, to balance the sampling of", "rooms alone, which are drawn as they come"
        )
    opened = [_opened(source, paths, settings.contexts[1], settings) for source, paths in training_paths(settings)]
    good = [scene for folder in opened for scene in folder.scenes]
    bad = tuple(one for folder in opened for one in folder.bad)
    check_bad(bad, len(good) + len(bad))
    for folder in opened:
        if not folder.scenes:
            path, why = folder.bad[0]
            raise InputError(folder.source.path, "scenes that can be used", f"none; of {path}: {why}")
    _check_labels(settings, good, classes)
    _check_depth(settings, good)
    pixels = _remembered(out / RECORD, good)
    before = _started_on(settings) if pixels is None else ()
    terms = _terms(settings, good) if pixels is None else ()
    _check_validation(settings, classes, [*before, *(scene.name for scene in good)])
    if pixels is None:
        pixels = _pixels(settings, good, rooms, classes)
        _remember(out / RECORD, good, pixels, before, terms)
    shares = _shares(settings, opened, pixels, classes)
    weights = settings.class_weights
    if (isinstance(weights, str) or settings.sampling == "balanced") and not shares.any():
        raise InputError(
            ", ".join(settings.data), f"pixels of the classes of {classes.name}, to find how often each occurs", "none"
        )
    return Survey(
        classes=classes,
        folders=_folders(settings, opened, pixels, shares),
        scenes=len(good) + len(bad),
        bad=bad,
        class_weights=inverse_frequency(shares, CLASS_WEIGHTINGS[weights]) if isinstance(weights, str) else weights,
        notes=tuple(_notes(settings, good, classes)),
    )


def training_paths(settings: TrainingSettings) -> list[tuple[Source, tuple[Path, ...]]]:
    """Where the scenes of each source that is not the rooms are: all of them, or those of the list that is asked for.

    Raises:
        InputError: a source has no scene, or none of the list; or a scene of the list is in no source.
    """
    sources = [source for source in settings.sources if not source.is_rooms]
    found = [scene_paths(source.path) for source in sources]
    if settings.scenes:
        known: dict[str, Path] = {}
        for source, paths in zip(sources, found, strict=True):
            known = calls(Path(source.path), paths) | known
        chosen = set(read_list(settings.scenes).choose(known, ", ".join(settings.data)))
        found = [tuple(path for path in paths if path in chosen) for paths in found]
        for source, paths in zip(sources, found, strict=True):
            if not paths:
                raise InputError(source.path, f"scenes of {settings.scenes}", "none of them")
    return list(zip(sources, found, strict=True))


def scenes_of(record: Path) -> tuple[str, ...]:
    """The names of all scenes that a run has seen, those of the weights that it began with included; none where there is no record.

    Rooms that semgs drew are left out: those of every seed have the same names.

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
        raise InputError(record, "what the data of the run are", str(error)) from error


def data_terms_of(record: Path) -> tuple[Terms, ...]:
    """The terms of all data that a run has seen, those of the weights that it began with included.

    Raises:
        InputError: the record is damaged.
    """
    try:
        content = parse_json(record.read_bytes())
        return terms_from(content["terms"]) if "terms" in content else (UNSTATED,)
    except FileNotFoundError:
        return (UNSTATED,)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(record, "what the data of the run are", str(error)) from error


def check_bad(bad: Sequence[tuple[str, str]], scenes: int) -> None:
    """End a training whose scenes are bad.

    Raises:
        InputError: more than 5 % of them are; the first one is named.
    """
    if len(bad) > TOLERATED * scenes:
        path, why = bad[0]
        raise InputError(
            path, f"at most {TOLERATED:.0%} bad scenes", f"{len(bad)} of {scenes}", advice=f"of this one: {why}"
        )


def inverse_frequency(shares: Pixels, power: float) -> tuple[float, ...]:
    """Factors 1 / share**power of each class, scaled so that a mean labelled pixel has 1; one that never occurs has that of the rarest.

    Raises:
        ValueError: no class occurs.
    """
    if not shares.sum() > 0:
        raise ValueError("no class of the table occurs in the data, so they cannot be weighed by how often they do")
    shares = shares / shares.sum()
    weights = np.where(shares > 0, shares, shares[shares > 0].min()) ** -power
    return tuple(float(weight) for weight in np.round(weights / (weights * shares).sum(), 4))


@dataclass(frozen=True)
class _Opened:
    """A source whose scenes have been opened."""

    source: Source
    scenes: tuple[Scene, ...]
    bad: tuple[tuple[str, str], ...]


def _opened(source: Source, paths: Sequence[Path], contexts: int, settings: TrainingSettings) -> _Opened:
    """The scenes of a source at these paths, and those that cannot be used or are too short for so many contexts."""
    scenes, bad = [], []
    needed = contexts + settings.targets
    for path in paths:
        try:
            scene = open_scene(path)
            if len(scene) < needed:
                raise InputError(
                    path,
                    f"at least {needed} usable frames ({contexts} input views and {settings.targets} to compare with)",
                    f"{len(scene)}",
                    advice="ask for fewer --contexts or --targets",
                )
        except InputError as error:
            bad.append((str(path), str(error)))
        else:
            scenes.append(scene)
    return _Opened(source, tuple(scenes), tuple(bad))


def _check_tables(settings: TrainingSettings, scenes: Sequence[Scene], classes: ClassTable) -> None:
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


def _check_labels(settings: TrainingSettings, scenes: Sequence[Scene], classes: ClassTable) -> None:
    """Refuse labels that the table of the run cannot say, and data without any.

    Raises:
        InputError: as `_check_tables`, or there are no labels at all although classes are to be learned.
    """
    _check_tables(settings, scenes, classes)
    advice = supervision_of(replace(settings, class_weights=None)).without_labels
    labelled = any(scene.classes is not None for scene in scenes)
    if advice is not None and not labelled and not any(source.is_rooms for source in settings.sources):
        raise InputError(scenes[0].path, "scenes with labels, to learn classes from", "none with any", advice=advice)


def _check_depth(settings: TrainingSettings, scenes: Sequence[Scene]) -> None:
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


def _started_on(settings: TrainingSettings) -> tuple[str, ...]:
    """The scenes that the weights to start from have seen, as far as they say."""
    return () if settings.init == "random" else trained_scenes(settings.init)


def _terms(settings: TrainingSettings, scenes: Sequence[Scene]) -> tuple[Terms, ...]:
    """The terms of rooms and scenes, and of what the weights to start from were trained on."""
    drawn = [FURNISHED if settings.assets else ROOMS_TERMS] if any(one.is_rooms for one in settings.sources) else []
    before = () if settings.init == "random" else data_terms(settings.init)
    return tuple(dict.fromkeys([*drawn, *(terms_of(scene) for scene in scenes), *before]))


def _check_validation(settings: TrainingSettings, classes: ClassTable, trained: Sequence[str]) -> None:
    """Refuse scenes of validation that cannot be used; as strict as with those of the training.

    Raises:
        InputError: too many of them are bad, their labels are of another table, one has no depth although that is to be
            learned, or they show rooms of the scenes that are trained on.
    """
    source = Source.parsed(settings.validation)
    if not source.is_rooms and settings.validation_scenes:
        opened = _opened(source, scene_paths(source.path), settings.contexts[0], settings)
        check_bad(opened.bad, len(opened.scenes) + len(opened.bad))
        _check_tables(settings, opened.scenes, classes)
        _check_depth(settings, opened.scenes)
        names = [scene.name for scene in opened.scenes]
        check_unseen(source.path, trained, names, "validate on other rooms, or train without these")


def _notes(settings: TrainingSettings, scenes: Sequence[Scene], classes: ClassTable) -> list[str]:
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


def _pixels(
    settings: TrainingSettings, scenes: Sequence[Scene], rooms: Callable[[], RoomSamples], classes: ClassTable
) -> list[Pixels | None]:
    """Pixels of each class in each scene and, last, in some rooms; None where the settings need not know."""
    if not isinstance(settings.class_weights, str) and settings.sampling == "even":
        return [None] * (len(scenes) + 1)
    pixels: list[Pixels | None] = [_counted(_some(scene), classes) if scene.classes else None for scene in scenes]
    if any(source.is_rooms for source in settings.sources):
        drawn = rooms()
        return [*pixels, _counted([drawn[k][0] for k in range(len(drawn))], classes)]
    return [*pixels, None]


def _some(scene: Scene) -> list[Views]:
    """A few frames spread over a scene; those that cannot be read are left to the training to tell of."""
    views = []
    for index in np.unique(np.linspace(0, len(scene) - 1, FRAMES_COUNTED).round().astype(int)):
        with contextlib.suppress(InputError):
            views.append(scene.read([int(index)], "native"))
    return views


def _counted(views: Sequence[Views], classes: ClassTable) -> Pixels:
    """Pixels of each class of the table in some views."""
    total = np.zeros(len(classes))
    for one in views:
        labels = relabelled(one, classes).labels
        if labels is not None:
            total += np.bincount(labels[labels != IGNORE].numpy(), minlength=len(classes))
    return total


def _shares(
    settings: TrainingSettings, opened: Sequence[_Opened], pixels: Sequence[Pixels | None], classes: ClassTable
) -> Pixels:
    """The share of each class in what the run sees: of each source by its weight, every scene of it alike."""
    total = np.zeros(len(classes))
    folders, counts = iter(opened), iter(pixels)
    for source in settings.sources:
        held = pixels[-1:] if source.is_rooms else [next(counts) for _ in next(folders).scenes]
        shares = [one / one.sum() for one in held if one is not None and one.sum() > 0]
        if shares:
            total += float(source.weight) * np.mean(shares, axis=0)
    return total


def _folders(
    settings: TrainingSettings, opened: Sequence[_Opened], pixels: Sequence[Pixels | None], shares: Pixels
) -> tuple[Folder, ...]:
    """The scenes of each folder with their chances: equal, or the mean factor of their pixels when rare classes have larger ones."""
    factors = np.array(inverse_frequency(shares, BALANCE)) if settings.sampling == "balanced" else None
    counts = iter(pixels)
    folders = []
    for folder in opened:
        chances = np.ones(len(folder.scenes))
        for index in range(len(folder.scenes)):
            held = next(counts)
            if factors is not None and held is not None and held.sum() > 0:
                chances[index] = (held * factors).sum() / held.sum()
        paths = tuple(scene.path.absolute() for scene in folder.scenes)
        folders.append(Folder(paths, tuple(float(one) for one in chances / chances.sum())))
    return tuple(folders)


def _remember(
    record: Path,
    scenes: Sequence[Scene],
    pixels: Sequence[Pixels | None],
    before: Sequence[str],
    terms: Sequence[Terms],
) -> None:
    """Write what the data are, which scenes the weights to start from have seen, and the terms of both."""
    counts = [None if one is None else one.tolist() for one in pixels]
    listed = [
        {"name": scene.name, "frames": len(scene), "pixels": held, "drawn": terms_of(scene) in (ROOMS_TERMS, FURNISHED)}
        for scene, held in zip(scenes, counts[:-1], strict=True)
    ]
    write_json(
        record, {"scenes": listed, "rooms": {"pixels": counts[-1]}, "before": list(before), "terms": terms_text(terms)}
    )


def _remembered(record: Path, scenes: Sequence[Scene]) -> list[Pixels | None] | None:
    """The pixels that were counted when the run began, None where it begins.

    Raises:
        InputError: the record is damaged, or of other scenes.
    """
    if not record.is_file():
        return None
    try:
        before = parse_json(record.read_bytes())
        there = [(str(one["name"]), int(one["frames"])) for one in before["scenes"]]
        pixels = [*(one["pixels"] for one in before["scenes"]), before["rooms"]["pixels"]]
        counts = [None if one is None else np.array(one, dtype=np.float64) for one in pixels]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(record, "what the data of the run are", str(error)) from error
    here = [(scene.name, len(scene)) for scene in scenes]
    if there != here:
        other = sorted({name for name, _ in set(there) ^ set(here)})
        raise InputError(
            record, f"the {len(there)} scenes that the run began with", f"{len(here)}, of which {other[0]} differs",
            advice="bring those back, or train in a new folder",
        )  # fmt: skip
    return counts

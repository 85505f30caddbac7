"""Open every scene of a run (headers, not images), so that faults are reported before training starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from semgs.data.scene import Scene
from semgs.data.scene_lists import read_list, scenes_by_name
from semgs.data.scenes import open_scene, scene_paths
from semgs.files.errors import InputError
from semgs.training.data.data_settings import DataSettings, Source

TOLERATED = 0.05
"""Share of all scenes that may be bad."""


def training_paths(settings: DataSettings) -> list[tuple[Source, tuple[Path, ...]]]:
    """The scenes of each folder among the sources: all of them, or those in the list of the settings.

    Raises:
        InputError: a source has no scene, or none of the list; or a scene of the list is in no source.
    """
    sources = [source for source in settings.sources if not source.is_rooms]
    paths_of = [scene_paths(source.path) for source in sources]
    if settings.scenes:
        known: dict[str, Path] = {}
        for source, paths in zip(sources, paths_of, strict=True):
            known = scenes_by_name(Path(source.path), paths) | known
        chosen = set(read_list(settings.scenes).choose(known, ", ".join(settings.data)))
        paths_of = [tuple(path for path in paths if path in chosen) for paths in paths_of]
        for source, paths in zip(sources, paths_of, strict=True):
            if not paths:
                raise InputError(source.path, f"scenes of {settings.scenes}", "none")
    return list(zip(sources, paths_of, strict=True))


def check_bad(bad: Sequence[tuple[str, str]], scenes: int) -> None:
    """Stop if too many scenes are bad.

    Raises:
        InputError: more than 5 % are; the first one is named.
    """
    if len(bad) > TOLERATED * scenes:
        path, why = bad[0]
        raise InputError(
            path, f"at most {TOLERATED:.0%} bad scenes", f"{len(bad)} of {scenes}", advice=f"of this one: {why}"
        )


@dataclass(frozen=True)
class OpenSource:
    """A source with its opened scenes and its bad ones."""

    source: Source
    scenes: tuple[Scene, ...]
    bad: tuple[tuple[str, str], ...]


def open_source(source: Source, paths: Sequence[Path], contexts: int, targets: int) -> OpenSource:
    """The scenes of a source at these paths; bad ones cannot be used, or have too few frames for so many input and target views."""
    scenes, bad = [], []
    needed = contexts + targets
    for path in paths:
        try:
            scene = open_scene(path, needs_cameras=False)
            if len(scene) < needed:
                raise InputError(
                    path,
                    f"at least {needed} usable frames ({contexts} input views and {targets} target views)",
                    f"{len(scene)}",
                    advice="use fewer --contexts or --targets",
                )
        except InputError as error:
            bad.append((str(path), str(error)))
        else:
            scenes.append(scene)
    return OpenSource(source, tuple(scenes), tuple(bad))

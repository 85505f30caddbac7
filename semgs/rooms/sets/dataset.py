"""Data sets of rooms: a folder of scenes that is filled by worker processes and goes on where it was left."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from contextlib import AbstractContextManager, closing
from functools import partial
from pathlib import Path

from semgs.data.classes import SCANNET20
from semgs.data.terms import ATTRIBUTION
from semgs.data.workers import outcomes
from semgs.files.atomic import write_bytes, write_json
from semgs.files.claims import is_begun
from semgs.files.folders import alone, check_writable
from semgs.files.strict_json import read_json
from semgs.rooms.assets.lock import attribution
from semgs.rooms.sets.scenes import ROOM, SHADED, Recipe, write_scene

SETTINGS, INDEX = "settings.json", "index.json"


def write_dataset(
    out: str | Path,
    recipe: Recipe,
    scenes: int,
    *,
    workers: int = 0,
    done: Callable[[int], None] = lambda count: None,
) -> dict:
    """Draw scenes 0 .. scenes - 1 that a folder does not hold yet, then write its index, and whose assets are in them.

    Every scene appears complete or not at all, so the same call goes on where an earlier one was cut short, and a larger
    number of scenes adds to those that are there. The bytes do not depend on `workers`.

    Args:
        out: a new or empty folder, or one that holds scenes of the same recipe.
        recipe: what to draw.
        scenes: how many.
        workers: processes that draw; 0 draws in this one.
        done: told how many scenes are there, at the start and after each.

    Returns:
        What `index.json` holds.

    Raises:
        ValueError: the number of scenes or workers is too small, or the folder holds scenes of another recipe, or more scenes.
        InputError: the folder is not ours, another process is filling it, or a file of the assets cannot be read.
        OSError: the disk is full.
        ImportError: embreex is not installed; names the extra that brings it.
    """
    if scenes < 1 or workers < 0:
        raise ValueError(
            f"scenes is {scenes} and workers {workers}; expected at least one scene and no negative number"
        )
    folder = Path(out)
    claim(folder, recipe, scenes)
    with _alone(folder):
        return _filled(folder, recipe, scenes, workers, done)


def _alone(folder: Path) -> AbstractContextManager[None]:
    """Be the only one that draws rooms into a folder.

    Raises:
        InputError: another process does.
    """
    return alone(folder / SETTINGS, "a folder that nobody draws rooms into", "one that another process is filling")


def _filled(folder: Path, recipe: Recipe, scenes: int, workers: int, done: Callable[[int], None]) -> dict:
    """Draw what is missing, and write the index; what it holds."""
    missing = [index for index in range(scenes) if not (folder / scene_name(index) / ROOM).is_file()]
    count = scenes - len(missing)
    done(count)
    if missing:
        with closing(outcomes(partial(_draw, folder, recipe), missing, workers)) as drawn:
            for failure in drawn:
                if failure is not None:
                    raise failure
                count += 1
                done(count)
    index = _index(folder, recipe, scenes)
    if recipe.library is not None:
        write_bytes(folder / ATTRIBUTION, attribution(_files(folder, scenes), recipe.library.lock).encode())
    write_json(folder / INDEX, index)
    return index


def scene_name(index: int) -> str:
    """The folder of a scene."""
    return f"scene_{index:05d}"


def claim(folder: Path, recipe: Recipe, scenes: int) -> None:
    """Make the folder a data set of this recipe, and clear away scenes of it that were cut short.

    Raises:
        ValueError: it holds scenes of another recipe, which is told, or more of them.
        InputError: it holds something else, nothing can be written there, or another process is filling it.
    """
    if not is_begun(folder / SETTINGS, recipe.as_json(), "a data set of rooms"):
        folder.mkdir(parents=True, exist_ok=True)
        write_json(folder / SETTINGS, recipe.as_json())
        return
    more = [path.name for path in folder.glob("scene_*") if int(_number(path.name)) >= scenes]
    if more:
        raise ValueError(
            f"{folder} holds {max(more)}, so more than the {scenes} scenes asked for; ask for as many or name another folder"
        )
    with _alone(folder):
        for path in folder.glob(".scene_*.part"):
            shutil.rmtree(path, ignore_errors=True)
        check_writable(folder)


def _number(name: str) -> str:
    found = re.fullmatch(r"scene_(\d{5,})", name)
    return found[1] if found else "-1"


def _draw(folder: Path, recipe: Recipe, index: int) -> None:
    write_scene(folder / scene_name(index), recipe, index)


def _files(folder: Path, scenes: int) -> set[str]:
    """The files of the assets that are in any scene."""
    rooms = (read_json(folder / scene_name(index) / ROOM) for index in range(scenes))
    return {file for room in rooms for file in room["assets"]}


def _index(folder: Path, recipe: Recipe, scenes: int) -> dict:
    """What is in the data set: its recipe, its scenes, and the pixels of each class in each and in all."""
    listed, total = [], dict.fromkeys((*SCANNET20.names, "ignored"), 0)
    for index in range(scenes):
        room = read_json(folder / scene_name(index) / ROOM)
        listed.append({"folder": scene_name(index), "kind": room["kind"], "render": SHADED, "pixels": room["pixels"]})
        for name, pixels in room["pixels"].items():
            total[name] += pixels
    return {**recipe.as_json(), "label_set": SCANNET20.name, "pixels": total, "scenes": listed}

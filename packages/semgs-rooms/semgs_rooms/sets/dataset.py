"""Data sets of rooms: folders of scenes, written by worker processes and resumable."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from contextlib import AbstractContextManager, closing
from functools import partial
from pathlib import Path

from semgs.data.origin.licences import ATTRIBUTION
from semgs.data.tables.classes import SCANNET20
from semgs.files.atomic import remove_parts, write_bytes, write_json
from semgs.files.claims import is_begun
from semgs.files.folders import check_writable, lock_folder
from semgs.files.strict_json import read_json
from semgs.runtime.workers import outcomes
from semgs_rooms.assets.lock import attribution
from semgs_rooms.sets.room_scenes import ROOM, SHADED, RoomSettings, write_scene

SETTINGS, INDEX = "settings.json", "index.json"


def write_dataset(
    out: str | Path,
    settings: RoomSettings,
    scenes: int,
    *,
    workers: int = 0,
    done: Callable[[int], None] = lambda count: None,
) -> dict:
    """Write those of scenes 0 .. scenes - 1 that are missing in a folder, then its index and the attribution of its assets.

    Each scene appears only once it is complete. To resume, repeat the call; a larger number of scenes adds scenes. The bytes do
    not depend on `workers`. A folder that is complete is only read, so several processes may ask for it at once.

    Args:
        out: a new or empty folder, or one with scenes with the same settings.
        settings: what to generate.
        scenes: number of scenes.
        workers: worker processes; 0 works in this process.
        done: called with the number of finished scenes, at the start and after each.

    Returns:
        The content of `index.json`.

    Raises:
        ValueError: the number of scenes or workers is too small, or the folder has scenes with other settings, or more scenes.
        InputError: the folder is not ours, another process is writing to it, or a file of the assets cannot be read.
        OSError: the disk is full.
        ImportError: embreex is not installed; the message names the extra to install.
    """
    if scenes < 1 or workers < 0:
        raise ValueError(f"scenes is {scenes} and workers {workers}; expected at least 1 and at least 0")
    folder = Path(out)
    if (index := _complete_index(folder, settings, scenes)) is not None:
        done(scenes)
        return index
    claim(folder, settings, scenes)
    with _alone(folder):
        return _filled(folder, settings, scenes, workers, done)


def _complete_index(folder: Path, settings: RoomSettings, scenes: int) -> dict | None:
    """The index of a folder that has these scenes, no more, and the attribution of its assets; None if something is missing."""
    if not (folder / INDEX).is_file() or not is_begun(folder / SETTINGS, settings.as_json(), "a data set of rooms"):
        return None
    if _missing(folder, scenes) or _surplus(folder, scenes):
        return None
    if settings.library is not None and not (folder / ATTRIBUTION).is_file():
        return None
    index = _index(folder, settings, scenes)
    return index if read_json(folder / INDEX) == index else None


def _alone(folder: Path) -> AbstractContextManager[None]:
    """Lock a folder; an InputError if another process is writing rooms into it."""
    return lock_folder(folder, "a folder that no other process is using", "one that another process is filling")


def _filled(folder: Path, settings: RoomSettings, scenes: int, workers: int, done: Callable[[int], None]) -> dict:
    """Write the missing scenes, then the index; returns its content."""
    missing = _missing(folder, scenes)
    count = scenes - len(missing)
    done(count)
    if missing:
        with closing(outcomes(partial(_draw, folder, settings), missing, workers)) as drawn:
            for failure in drawn:
                if failure is not None:
                    raise failure
                count += 1
                done(count)
    index = _index(folder, settings, scenes)
    if settings.library is not None:
        write_bytes(folder / ATTRIBUTION, attribution(_files(folder, scenes), settings.library.lock).encode())
    write_json(folder / INDEX, index)
    return index


def _missing(folder: Path, scenes: int) -> list[int]:
    """The numbers of the scenes that are not complete."""
    return [index for index in range(scenes) if not (folder / scene_name(index) / ROOM).is_file()]


def _surplus(folder: Path, scenes: int) -> list[str]:
    """The scenes that are more than these."""
    found = (re.fullmatch(r"scene_(\d{5,})", path.name) for path in folder.glob("scene_*"))
    return [match[0] for match in found if match and int(match[1]) >= scenes]


def scene_name(index: int) -> str:
    """The folder of a scene."""
    return f"scene_{index:05d}"


def claim(folder: Path, settings: RoomSettings, scenes: int) -> None:
    """Make the folder a data set with these settings, and remove incomplete scenes from it.

    Raises:
        ValueError: it has scenes with other settings (the message lists the differences), or more scenes.
        InputError: it contains something else, cannot be written to, or another process is writing to it.
    """
    if not is_begun(folder / SETTINGS, settings.as_json(), "a data set of rooms"):
        folder.mkdir(parents=True, exist_ok=True)
        write_json(folder / SETTINGS, settings.as_json())
        return
    if more := _surplus(folder, scenes):
        raise ValueError(
            f"{folder} contains {max(more)}, which is more than the {scenes} requested scenes; request more or name another folder"
        )
    with _alone(folder):
        for path in folder.glob(".scene_*.part"):
            shutil.rmtree(path, ignore_errors=True)
        remove_parts(folder, folder / SETTINGS)
        check_writable(folder)


def _draw(folder: Path, settings: RoomSettings, index: int) -> None:
    write_scene(folder / scene_name(index), settings, index)


def _files(folder: Path, scenes: int) -> set[str]:
    """The asset files used in any scene."""
    rooms = (read_json(folder / scene_name(index) / ROOM) for index in range(scenes))
    return {file for room in rooms for file in room["assets"]}


def _index(folder: Path, settings: RoomSettings, scenes: int) -> dict:
    """Contents of the data set: its settings, its scenes, and pixel counts of each class per scene and in total."""
    listed, total = [], dict.fromkeys((*SCANNET20.names, "ignored"), 0)
    for index in range(scenes):
        room = read_json(folder / scene_name(index) / ROOM)
        listed.append({"folder": scene_name(index), "kind": room["kind"], "render": SHADED, "pixels": room["pixels"]})
        for name, pixels in room["pixels"].items():
            total[name] += pixels
    return {**settings.as_json(), "label_set": SCANNET20.name, "pixels": total, "scenes": listed}

"""`semgs prepare`: converts scenes of any known layout to compact zip files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from semgs._version import __version__
from semgs.files.paths import existing_folder
from semgs.files.text import counted
from semgs.run.options.scene_options import SceneOptions
from semgs.run.options.types import Count, Size, WorkersOrCores
from semgs.run.options.words import INLINE, LAST_WORD, Words, optional, positional
from semgs.run.outcome import Outcome, Run
from semgs.run.usage_errors import UsageError, what_the_user_gave
from semgs.runtime.cores import usable_cores
from semgs.runtime.notes import Progress

if TYPE_CHECKING:
    from semgs.data.preparation.archive import Preparation
    from semgs.data.preparation.prepared_set import Reader, SceneSource


@dataclass(frozen=True)
class Prepare(Run):
    """Convert scenes to compact zip files for training.

    SRC is a scene, a folder of scenes, or a folder of such folders (7-Scenes, Replica): ScanNet, ScanNet++, Replica, TUM RGB-D,
    7-Scenes, RGB-D folders, Polycam, Record3D, ROS bags, COLMAP models, transforms.json. OUT will contain
    - NAME.zip: a scene with transforms.json, JPEG images, depth in millimetres and class maps; every semgs command reads it
    - index.json: for each scene its frames, notes, pixels of each class and hash; and which scenes failed, and why
    - SHA256SUMS: the hashes, for sha256sum -c; settings.json: the options

    To resume, or to update scenes that have changed, repeat the command. Disk space is estimated before work starts. The files depend on
    the source and the options, not on --workers.

    Examples
    - semgs prepare scannet/scans --out data/scannet --scenes scannet-1000-without-sray --every 2 --workers 8
    - semgs prepare replica --out data/replica
    - semgs prepare recording --out data/robot --camera /camera/color --world map
    """

    src: Annotated[Path, positional("SRC")]
    """A scene, or a folder of scenes."""
    out: Annotated[Path, Words(metavar="OUT"), LAST_WORD]
    """Output folder: new, empty, or one with the same settings to resume."""
    size: Size = (240, 320)
    """Height x width of the images, in pixels; swapped for portrait images. Other aspect ratios are centre-cropped."""
    every: Count = 1
    """Keep each n-th frame."""
    scenes: Annotated[str, optional("LIST")] = ""
    """Only the scenes of a list: an included one (scannet-sray-test), or a text file with one name per line; see docs/reproduce.md."""
    workers: Annotated[WorkersOrCores, optional()] = None
    """Worker processes; by default one per core, 0 for none."""
    reading: Annotated[SceneOptions, INLINE] = field(default_factory=SceneOptions)

    def run(self, progress: Progress) -> Outcome:
        """Prepare the scenes.

        Raises:
            InputError: SRC contains no scene, OUT contains something else, the list is empty, or no scene could be prepared.
            UsageError: an option is invalid, OUT has other settings, or there is not enough space.
            OSError: the disk is full.
        """
        self.reading.check()
        existing_folder(self.src)
        with progress.stage("Looking for scenes"):
            from semgs.data.preparation import prepared_set
            from semgs.data.preparation.archive import Preparation
            from semgs.data.scene_lists import read_list

            found = prepared_set.find_sources(self.src, read_list(self.scenes) if self.scenes else None)
        reading = prepared_set.Reading(self.reading.as_peers, self.reading.asked)
        workers = usable_cores() if self.workers is None else self.workers
        settings = Preparation(self.size, self.every, version=__version__)
        index, lines = prepared(self.out, found, settings, reading, workers, progress)
        first = self.out / index["scenes"][0]["file"]
        where = f"{self.out / prepared_set.INDEX} describes every scene. To look at one: semgs reconstruct {first} --out DIR"
        return Outcome((*lines, where))


def prepared(
    out: Path, found: Sequence[SceneSource], settings: Preparation, reading: Reader, workers: int, progress: Progress
) -> tuple[dict[str, Any], list[str]]:
    """Prepare scenes. Returns the content of `index.json`, and what was done, in lines.

    Raises:
        InputError: the folder contains something else, or no scene could be prepared.
        UsageError: the folder has other settings, or there is not enough space.
        OSError: the disk is full.
    """
    from semgs.data.preparation.prepared_set import INDEX, PreparedSet, free_space

    made = PreparedSet(out, settings, reading)
    with what_the_user_gave():
        made.check()
    with progress.stage("Estimating the space"):
        needed = made.needed_space(found)
        free = free_space(out)
    if needed > free:
        raise UsageError(
            f"{out} needs about {_size(needed)} for {counted(len(found), 'scene')} and {_size(free)} are free; "
            "free some space, use fewer scenes (--scenes) or frames (--every), or write elsewhere"
        )
    if len(found) == 1:
        frames = len(reading.open(found[0]).frames[:: settings.every])
        with progress.steps("Preparing frames", frames) as done:
            index = made.prepare(found, frame_done=done)
    else:
        with progress.steps("Preparing scenes", len(found)) as done:
            index = made.prepare(found, workers=workers, done=done)
    lines = [
        f"{out}: {counted(len(index['scenes']), 'scene')}, {counted(index['frames'], 'frame')}, {_size(index['bytes'])}",
        *(f"left out: {one['name']}: {one['error']}" for one in index["failed"][:3]),
    ]
    if len(index["failed"]) > 3:
        lines.append(f"left out: {len(index['failed']) - 3} more, see {out / INDEX}")
    return index, lines


def _size(count: int) -> str:
    """A number of bytes in kB, MB, ..."""
    power = max(0, min(4, (len(str(count)) - 1) // 3))
    return f"{count / 1000**power:.3g} {('bytes', 'kB', 'MB', 'GB', 'TB')[power]}"

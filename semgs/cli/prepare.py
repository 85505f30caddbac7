"""`semgs prepare`: converts scenes of any known layout to compact zip files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from semgs.cli.errors import UsageError, what_the_user_gave
from semgs.cli.progress import show_progress, show_stage
from semgs.cli.scene_options import SceneOptions
from semgs.cli.types import Count, Size, WorkersOrCores, cores
from semgs.files.paths import existing_folder


@dataclass(frozen=True)
class Prepare:
    """Convert scenes to compact zip files for training.

    SRC is a scene, a folder of scenes, or a folder of such folders (7-Scenes, Replica): ScanNet, ScanNet++, Replica, TUM RGB-D,
    7-Scenes, RGB-D folders, ROS bags, COLMAP models, transforms.json. OUT will contain
    - NAME.zip: a scene with transforms.json, JPEG images, depth in millimetres and class maps; every semgs command reads it
    - index.json: for each scene its frames, notes, pixels of each class and hash; and which scenes failed, and why
    - SHA256SUMS: the hashes, for sha256sum -c; settings.json: the options

    To resume, or to update scenes that have changed, repeat the command. Disk space is estimated before work starts. The files depend on
    the source and the options, not on --workers.

    Examples
    - semgs prepare scannet/scans data/scannet --scenes scannet-1000-without-sray --every 2 --workers 8
    - semgs prepare replica data/replica
    - semgs prepare recording data/robot --camera /camera/color --world map
    """

    src: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SRC")]
    """A scene, or a folder of scenes."""
    out: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="OUT")]
    """Output folder: new, empty, or one with the same settings to resume."""
    size: Size = (240, 320)
    """Height x width of the images, in pixels; swapped for portrait images. Other aspect ratios are centre-cropped."""
    every: Count = 1
    """Keep each n-th frame."""
    scenes: Annotated[str, tyro.conf.arg(metavar="LIST", aliases=["--list"], help_behavior_hint="")] = ""
    """Only the scenes of a list: an included one (scannet-sray-test), or a text file with one name per line; see docs/data.md."""
    workers: Annotated[WorkersOrCores, tyro.conf.arg(help_behavior_hint="")] = None
    """Worker processes; by default one per core, 0 for none."""
    reading: Annotated[SceneOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=SceneOptions)

    def run(self) -> None:
        """Prepare the scenes, and print what was done.

        Raises:
            InputError: SRC contains no scene, OUT contains something else, the list is empty, or no scene could be prepared.
            UsageError: an option is invalid, OUT has other settings, or there is not enough space.
            OSError: the disk is full.
        """
        self.reading.check()
        existing_folder(self.src)
        with show_stage("Looking for scenes"):
            from semgs.data.scene_lists import read_list
            from semgs.preparation import prepared_set
            from semgs.preparation.archive import Preparation

            found = prepared_set.sources(self.src, read_list(self.scenes) if self.scenes else None)
        settings, reading = (
            Preparation(self.size, self.every),
            prepared_set.Reading(self.reading.as_peers, self.reading.asked),
        )
        with what_the_user_gave():
            prepared_set.check(self.out, settings, reading)
        with show_stage("Estimating the space"):
            needed, free = (
                prepared_set.needed_space(self.out, found, settings, reading),
                prepared_set.free_space(self.out),
            )
        if needed > free:
            raise UsageError(
                f"{self.out} needs about {_size(needed)} for {len(found)} scenes and {_size(free)} are free; "
                "free some space, use fewer scenes (--scenes) or frames (--every), or write elsewhere"
            )
        if len(found) == 1:
            frames = len(reading.open(found[0]).frames[:: self.every])
            with show_progress("Preparing frames", frames) as done:
                index = prepared_set.prepare_set(self.out, found, settings, reading, frame_done=done)
        else:
            workers = cores() if self.workers is None else self.workers
            with show_progress("Preparing scenes", len(found)) as done:
                index = prepared_set.prepare_set(self.out, found, settings, reading, workers=workers, done=done)
        print(f"{self.out}: {len(index['scenes'])} scenes, {index['frames']} frames, {_size(index['bytes'])}")
        for one in index["failed"][:3]:
            print(f"left out: {one['name']}: {one['error']}")
        if len(index["failed"]) > 3:
            print(f"left out: {len(index['failed']) - 3} more, see {self.out / prepared_set.INDEX}")
        first = self.out / index["scenes"][0]["file"]
        print(
            f"{self.out / prepared_set.INDEX} describes every scene. To look at one: semgs reconstruct {first} --out DIR"
        )


def _size(count: int) -> str:
    """A number of bytes in kB, MB, ..."""
    power = max(0, min(4, (len(str(count)) - 1) // 3))
    return f"{count / 1000**power:.3g} {('bytes', 'kB', 'MB', 'GB', 'TB')[power]}"

"""`semgs rooms`: generates a labelled data set of synthetic rooms from a seed, or a contact sheet of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from semgs.cli.progress import show_progress
from semgs.files.folders import check_new_file
from semgs.files.text import counted
from semgs.run.options.types import Count, Size, WorkersOrCores, shown_size
from semgs.run.options.words import LAST_WORD, REPEATABLE, Words, optional
from semgs.run.usage_errors import UsageError, what_the_user_gave
from semgs.runtime.cores import usable_cores
from semgs_rooms.plans.style import Style

if TYPE_CHECKING:
    from semgs_rooms.assets.asset_library import Library
    from semgs_rooms.sets.dataset import RoomSettings


@dataclass(frozen=True)
class Rooms:
    """Generate synthetic rooms with exact labels of ScanNet's 20 classes, exact depth and poses.

    OUT will contain scenes, each a walk through its own furnished room:
    - scene_00000/transforms.json: cameras, in nerfstudio's layout, metric; semgs reconstruct takes the folder
    - scene_00000/images/: JPEG images
    - scene_00000/depth/: z-depth in millimetres, 16-bit PNG
    - scene_00000/labels/: class number per pixel, 8-bit PNG, 255 = ignore
    - scene_00000/room.json: the kind of room and how many pixels each class has
    - index.json: the same counts for all scenes; settings.json: the options

    On one machine and with one version of semgs, scene k of a seed is always the same. To resume, repeat the command; a larger
    --scenes adds scenes. Without --assets, the images are CC0. With them, ATTRIBUTION.md lists the works that appear in the images
    and their licences.

    Examples
    - semgs rooms --out data/rooms --scenes 100
    - semgs rooms --out data/more --scenes 1000 --seed 7 --size 480x640 --frames 20 --workers 8
    - semgs rooms --out data/furnished --scenes 1000 --assets assets
    - semgs rooms --sheet rooms.png --seed 3
    - python -m semgs_rooms.furniture --out furniture --pieces 100 makes furniture for --assets, in a clone of the repository
    """

    only_with: ClassVar = {"--out": ("--scenes", "--size", "--frames", "--workers")}

    out: Annotated[Path | None, optional("OUT"), LAST_WORD] = None
    """Output folder: new, empty, or one with the same settings to resume."""
    scenes: Count = 10
    """Number of rooms."""
    seed: int = 0
    """Random seed. Different seeds give entirely different rooms."""
    size: Size = (240, 320)
    """Height x width of the images, in pixels."""
    frames: int = 12
    """Images of each room, along one walk."""
    style: Style = "home"
    """home: rooms furnished as people live. closeup: homes seen from close by, in dark and strong colours. other: a second, different world,
    reserved for testing."""
    aside: bool = False
    """Instead of walks, draw two input views of each room and views 20 and 40 cm and 15 and 30 degrees aside of them, for semgs evaluate --protocol aside."""
    assets: Annotated[tuple[Path, ...], REPEATABLE, Words(metavar="DIR")] = ()
    """Folder of meshes and images, verified against its lock. Half of the homes use its meshes, most use its images. Repeatable.
    Without it, built-in furniture only."""
    workers: Annotated[WorkersOrCores, optional()] = None
    """Worker processes; by default one per core, 0 for none."""
    sheet: Annotated[Path | None, optional("FILE.png")] = None
    """Write a contact sheet of 48 random frames and their labels. Needs no --out."""

    def run(self) -> None:
        """Generate the data set, the sheet, or both, and print what was done.

        Raises:
            InputError: OUT contains something else, or the assets are missing or altered.
            UsageError: an option is invalid, or an extra that rooms need is not installed.
            OSError: the disk is full.
        """
        self._check()
        from semgs_rooms.sets.dataset import RoomSettings

        library = self._library()
        with what_the_user_gave():
            settings = RoomSettings(self.seed, self.size, self.frames, self.style, library, self.aside)
        try:
            if self.out is not None:
                self._write(self.out, settings)
            if self.sheet is not None:
                self._draw_sheet(self.sheet, library)
        except ImportError as error:
            raise UsageError(str(error)) from error

    def _check(self) -> None:
        """Check what can be checked without importing torch."""
        if self.out is None and self.sheet is None:
            raise UsageError(
                "expected a folder to write, as in semgs rooms --out OUT, or --sheet FILE.png; see semgs rooms --help"
            )
        if self.sheet is not None and self.sheet.suffix.lower() != ".png":
            raise UsageError(f"--sheet is {self.sheet}; expected a name that ends in .png")
        if self.sheet is not None:
            check_new_file(self.sheet)

    def _library(self) -> Library | None:
        if not self.assets:
            return None
        from semgs_rooms.assets.asset_library import open_library

        with what_the_user_gave():
            return open_library(self.assets, self.style)

    def _write(self, out: Path, settings: RoomSettings) -> None:
        from semgs_rooms.sets.dataset import ATTRIBUTION, INDEX, claim, write_dataset

        with what_the_user_gave():
            claim(out, settings, self.scenes)
        workers = usable_cores() if self.workers is None else self.workers
        with show_progress("Generating rooms", self.scenes) as done:
            index = write_dataset(out, settings, self.scenes, workers=workers, done=done)
        labelled = sum(pixels for name, pixels in index["pixels"].items() if name != "ignored")
        frames = self.scenes * self.frames
        print(
            f"{out}: {counted(self.scenes, 'scene')} of {counted(self.frames, 'frame')} ({counted(frames, 'image')} of {shown_size(self.size)}), style {self.style}, seed {self.seed}"
        )
        shares = sorted(
            ((pixels / labelled, name) for name, pixels in index["pixels"].items() if name != "ignored"), reverse=True
        )
        print("classes, % of labelled pixels: " + ", ".join(f"{name} {100 * share:.1f}" for share, name in shares))
        if self.assets:
            print(f"{out / ATTRIBUTION} lists the works that appear in the images; keep it with them")
        print(
            f"{out / INDEX} has these counts for every scene. To look at one: semgs reconstruct {out / index['scenes'][0]['folder']} --out DIR"
        )

    def _draw_sheet(self, path: Path, library: Library | None) -> None:
        from semgs.files.images.pictures import write_png
        from semgs_rooms.sets.room_stream import SHEET_FRAMES, contact_sheet

        with show_progress("Rendering frames", SHEET_FRAMES) as done:
            picture = contact_sheet(self.seed, self.style, library, done=done)
        write_png(path, picture)
        print(f"{path}: {SHEET_FRAMES} frames of style {self.style}, seed {self.seed}, each next to its labels")

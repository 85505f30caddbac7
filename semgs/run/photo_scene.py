"""Photos given to a command that takes scenes: their cameras are estimated into a folder beside its output, which gets it in the end."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.data.scenes import open_with_details
from semgs.files.errors import readable
from semgs.files.folders import staged
from semgs.run.options.scene_options import PosingOptions
from semgs.run.usage_errors import UsageError, what_the_user_gave
from semgs.runtime.notes import Progress
from semgs.sfm.photos import has_only_photos
from semgs.sfm.scene_folder import IMAGES, write_photo_scene

CAMERAS = "cameras"
"""The folder in the output with the photos and their cameras."""


@dataclass(frozen=True)
class PhotoScene:
    """Photos whose cameras were estimated.

    Attributes:
        photos: what the user named.
        folder: with the images and cameras, for now.
        out: where the output folder will be.
        kept: whether images and cameras will stay there.
        notes: about the photos and their cameras.
    """

    photos: Path
    folder: Path
    out: Path
    kept: bool
    notes: tuple[str, ...]

    @property
    def scene_path(self) -> Path:
        """Where the images and cameras will stay; else the photos that the user named."""
        return self.out / CAMERAS if self.kept else self.photos

    def scene(self, as_peers: Collection[str], asked: SceneDetails) -> Scene:
        """The photos as a scene with the name of their folder, at the path where it will stay."""
        found = open_with_details(self.folder, as_peers, asked)
        photos = self.photos.absolute()
        name = photos.stem if photos.is_file() else photos.parent.name if photos.name == IMAGES else photos.name
        return replace(found, path=self.scene_path, name=name, notes=(*self.notes, *found.notes))

    def move_to(self, out: Path) -> None:
        """Move images and cameras into the output folder, once nothing reads them any more."""
        self.folder.rename(out / CAMERAS)


@contextmanager
def photo_scene(
    path: Path, out: Path, posing: PosingOptions, progress: Progress, kept: bool = True, in_units: str = ""
) -> Iterator[PhotoScene | None]:
    """Estimate the cameras of a folder of photos or a clip; None if the path is something else.

    Args:
        path: what the user named as scene.
        out: the output folder of the command.
        posing: options for it.
        progress: shows what is about to start.
        kept: whether images and cameras will stay in the output folder.
        in_units: an option that was given in the unit of the cameras; refused if they will have none.

    Raises:
        InputError: the photos cannot be used, or their cameras cannot be estimated.
        UsageError: an option is invalid, or the path has cameras and needs none.
    """
    with readable(path):
        only_photos = has_only_photos(path)
    if not only_photos:
        if posing.given:
            raise UsageError(
                f"--focal, --scale-from and --clip-frames are for photos without poses; {path} is not such a folder"
            )
        yield None
        return
    if in_units and not posing.scale_from:
        raise UsageError(f"{in_units} is for cameras whose unit is known; add --scale-from, or leave it out")
    known = posing.known()
    target = out.resolve()
    target.parent.mkdir(parents=True, exist_ok=True)
    with staged(target) as folder:
        folder.mkdir()
        with what_the_user_gave():
            notes = write_photo_scene(path, folder, known, progress.announce).notes
        yield PhotoScene(path, folder, out, kept, notes)

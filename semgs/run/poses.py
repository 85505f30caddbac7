"""`semgs poses`: estimates the cameras of photos or of a clip, and writes them as a scene."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from semgs.files.folders import check_folder, own_folder
from semgs.files.paths import existing_folder
from semgs.run.options.scene_options import PosingOptions
from semgs.run.options.words import INLINE, LAST_WORD, Words, optional, positional
from semgs.run.outcome import Outcome, Run
from semgs.run.usage_errors import what_the_user_gave
from semgs.runtime.notes import Progress

if TYPE_CHECKING:
    from semgs.sfm.solving import Solution


@dataclass(frozen=True)
class Poses(Run):
    """Estimate the cameras of photos, or of a clip, and write them as a scene.

    PHOTOS is a folder of JPEG, PNG or HEIC images, or a video. Photos have to overlap, and the camera has to move sideways between them.
    Cameras are estimated by COLMAP's structure from motion (extra sfm), or taken from a file that a network predicted (--predictions). OUT gets upright copies of the photos in images/, and the cameras;
    every semgs command reads it as a scene, for example semgs doctor OUT. Bad input ends with a one-line error and exit code 2.

    Examples
    - semgs poses photos --out scans/kitchen
    - semgs poses clip.mp4 --out scans/kitchen --clip-frames 40
    - semgs poses photos --out scans/kitchen --scale-from IMG_1.jpg IMG_4.jpg 1.25
    - semgs poses photos --out scans/kitchen --as colmap
    - semgs poses photos --out scans/kitchen --predictions predictions.npz
    """

    excludes: ClassVar = {"--predictions": ("--as colmap", "--focal", "--clip-frames")}

    photos: Annotated[Path, positional("PHOTOS")]
    """A folder of photos, or a video."""
    out: Annotated[Path, Words(metavar="OUT"), LAST_WORD]
    """Output folder: new, empty, or, with --overwrite, one from an earlier run."""
    form: Annotated[Literal["transforms", "colmap"], Words(name="as")] = "transforms"
    """transforms.json with sparse_pc.ply, as nerfstudio has them, or a COLMAP model in sparse/0. A COLMAP model does not say that its unit is metres."""
    predictions: Annotated[Path | None, optional("FILE")] = None
    """Take the cameras from this file of Depth Anything 3, VGGT, MapAnything or DUSt3R instead of COLMAP. PHOTOS are those that it was made from."""
    overwrite: bool = False
    """Replace an OUT from an earlier run, once the new one is complete."""
    posing: Annotated[PosingOptions, INLINE] = field(default_factory=PosingOptions)

    def run(self, progress: Progress) -> Outcome:
        """Estimate the cameras, and write the folder.

        Raises:
            InputError: the photos or the output folder cannot be used, or the cameras cannot be estimated.
            UsageError: an option is invalid, or needs COLMAP.
        """
        existing_folder(self.photos, "a folder of photos, or a video")
        check_folder(self.out, "poses", self.overwrite, (self.photos, self.predictions))
        if self.predictions is None:
            solution = self._estimated(progress)
        else:
            solution = self._predicted(self.predictions, progress)
        written = f"{self.out}: a scene of {len(solution.photos)} frames, {len(solution.points):,} points, unit: {solution.unit}"
        return Outcome((*solution.notes, written), solution.notes)

    def _estimated(self, progress: Progress) -> Solution:
        """Write the scene with cameras by COLMAP."""
        with progress.stage("Starting"):
            from semgs.sfm.photos import check_folder_of_photos
            from semgs.sfm.scene_folder import write_photo_scene

        check_folder_of_photos(self.photos)
        known = self.posing.known()
        with own_folder(self.out, "poses", self.overwrite) as folder, what_the_user_gave():
            return write_photo_scene(self.photos, folder, known, progress.announce, colmap=self.form == "colmap")

    def _predicted(self, predictions: Path, progress: Progress) -> Solution:
        """Write the scene with the cameras of a file."""
        known = self.posing.known()
        with progress.stage("Starting"):
            from semgs.sfm.scene_folder import write_predicted_scene

        with own_folder(self.out, "poses", self.overwrite) as folder, what_the_user_gave():
            return write_predicted_scene(self.photos, predictions, folder, known.distance)

"""`semgs doctor`: tests the cameras of a scene against its images and depth maps."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from semgs.files.folders import check_new_file
from semgs.files.paths import existing_folder
from semgs.files.text import aligned
from semgs.run.options.scene_options import SceneOptions
from semgs.run.options.words import INLINE, optional, positional
from semgs.run.outcome import Outcome, Run
from semgs.run.usage_errors import UsageError
from semgs.runtime.notes import Progress

if TYPE_CHECKING:
    from semgs.data.scene import Scene
    from semgs.doctor.diagnosis import Diagnosis

SUSPICIOUS = 3
"""The exit code if the cameras do not fit."""


@dataclass(frozen=True)
class Doctor(Run):
    """Check that the cameras of a scene fit its images and depth maps, and name the mistake if they do not.

    SCENE is as for semgs reconstruct. Points that are seen in two images are matched without any pose. If the cameras miss them, usual
    mistakes are undone one at a time: inverted poses, OpenGL for OpenCV axes, transposed rotations, the order of quaternions, a mirrored
    world, millimetres, the unit of depth, the focal length of another image size, swapped fx fy or cx cy, a wrong principal point, and images
    in another order. The one that explains the data is named, with the error before and after. Some mistakes do not show in some scenes, for
    example fx and fy swapped if they are nearly equal; these are listed as not excluded.

    Exit code 0 if the cameras fit, are slightly wrong, or it cannot tell; 3 if they do not fit; 2 if the scene is unusable: fewer than two
    frames with an image and a pose, or files that cannot be read.

    Examples
    - semgs doctor scans/office
    - semgs doctor scans/office --page doctor.html
    - semgs doctor scans/office --fix scans/office/transforms_fixed.json
    """

    scene: Annotated[Path, positional("SCENE")]
    """The scene: a folder, or a single file."""
    fix: Annotated[Path | None, optional("OUT.json")] = None
    """Write the corrected cameras to this transforms.json, which every semgs command reads as a scene. It lists the images and depth maps where
    they are, without labels."""
    page: Annotated[Path | None, optional("OUT.html")] = None
    """Write a page with the verdict, matches and epipolar lines on the images, and the cameras from above and from the side."""
    overwrite: bool = False
    """Replace the files of --fix and --page if they exist."""
    reading: Annotated[SceneOptions, INLINE] = field(default_factory=SceneOptions)

    def run(self, progress: Progress) -> Outcome:
        """Test the scene, and write the files.

        Raises:
            InputError: the scene cannot be read, or a file cannot be written.
            UsageError: an option is invalid.
        """
        self.reading.check()
        existing_folder(self.scene)
        self._check_outputs()
        with progress.stage("Starting"):
            from semgs.data.scenes import open_with_details
            from semgs.doctor.diagnosis import diagnose
            from semgs.doctor.facts import facts, judge_unit
            from semgs.doctor.fix import check_fixable
            from semgs.doctor.quick import notes_on_sides

        scene = open_with_details(self.scene, self.reading.as_peers, self.reading.asked, needs_labels=False)
        if self.fix is not None:
            check_fixable(scene)
        with progress.stage(f"Matching images of {len(scene)} frames"):
            found = diagnose(scene)
            unit = judge_unit(scene, found)
            understood = facts(scene, unit)
            scene = replace(scene, notes=(*scene.notes, *notes_on_sides(scene.frames)))
        notes = [found.sentence]
        if unit.doubtful:
            notes.append(f"The unit is {unit.text}.")
        if found.verdict != "cannot tell" and found.undecided:
            names = "; ".join(one.name for one in found.undecided)
            notes.append(f"Not excluded, because they would not show here: {names}.")
        about = (*aligned(understood), *(f"note: {note}" for note in scene.notes))
        written = self._write(scene, found, understood)
        code = SUSPICIOUS if found.verdict == "suspicious" else 0
        return Outcome((*about, "", *notes, *written), tuple(notes), code=code)

    def _check_outputs(self) -> None:
        """Check the names of the files to write."""
        for option, path, ending in (("--fix", self.fix, ".json"), ("--page", self.page, ".html")):
            if path is None:
                continue
            if path.suffix.lower() != ending:
                raise UsageError(f"{option} is {path}; expected a file name that ends with {ending}")
            check_new_file(path, self.overwrite, (self.scene,))

    def _write(self, scene: Scene, found: Diagnosis, understood: tuple[tuple[str, str], ...]) -> list[str]:
        """Write the files that were requested. Returns a line about each."""
        lines = []
        if self.page is not None:
            from semgs.doctor.doctor_page import doctor_page
            from semgs.files.atomic import write_text

            write_text(self.page, doctor_page(scene, found, understood))
            lines.append(f"{self.page}: the page")
        if self.fix is None:
            return lines
        if found.finding is None:
            return [*lines, f"{self.fix} was not written: there is nothing to correct, or no correction is known."]
        from semgs.doctor.fix import note_on_depth, write_fixed

        write_fixed(self.fix, scene, found.finding.rig)
        lines.append(f"{self.fix}: the corrected cameras")
        if note := note_on_depth(scene, found.finding.rig):
            lines.append(f"note: {note}")
        return lines

"""`semgs render`: images and videos of a reconstructed scene along a camera path."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from semgs.files.errors import InputError
from semgs.files.folders import FILE_ENDINGS, check_folder, check_new_file, own_folder
from semgs.files.paths import found_at, typed_path
from semgs.files.text import counted, did_you_mean
from semgs.run.opened_scene import open_given
from semgs.run.options.types import Activated, Count, Probability, Size
from semgs.run.options.words import Words, optional, positional
from semgs.run.outcome import Outcome, Run
from semgs.run.usage_errors import UsageError, what_the_user_gave
from semgs.runtime.notes import Progress
from semgs.splats.endings import is_splat

if TYPE_CHECKING:
    from semgs.export.stills import Stills
    from semgs.geometry.cameras import Cameras
    from semgs.scene.opened import OpenedScene
    from semgs.scene.scene_file import SavedScene

VIDEO = ".mp4"
CAMERAS = "transforms.json"

OWN_PATHS = ("orbit", "inputs")
"""The values of --path that are no file."""

MAY_BE_UNKNOWN = ("classes", "overlay")
"""The values of --show that --min-confidence is for."""

SWING, CIRCLE = 24.0, 360.0


@dataclass(frozen=True)
class Render(Run):
    """Render images or a video of a reconstructed scene along a camera path.

    SCENE is an output folder of semgs reconstruct, its scene.safetensors, or a splat of another program (PLY, SPZ, glTF). If OUT ends with .mp4, it is a video, with the images side by side.
    Otherwise it is a folder with
    - 0000_colour.png, 0000_classes.png ...: an image for each camera and each --show
    - transforms.json: the cameras, which --path reads again

    Examples
    - semgs render out/office --out office.mp4
    - semgs render out/office --out office.mp4 --path inputs --show colour overlay depth --size 480x640
    - semgs render out/office --out stills --frames 8 --show colour rgba
    - semgs render out/office --out path.mp4 --path camera_path.json
    - semgs render office.spz --out office.mp4 --cameras scans/office --path inputs
    """

    only_with: ClassVar = {"--path orbit": ("--degrees",), "--path orbit inputs": ("--frames",)}

    scene: Annotated[Path, positional("SCENE")]
    """Folder from semgs reconstruct, a scene file, or a splat."""
    out: Annotated[Path, Words(metavar="OUT")]
    """Output: a video (.mp4) or a folder, new or, with --overwrite, one from an earlier run."""
    path: Annotated[str, Words(metavar="orbit|inputs|FILE")] = "orbit"
    """orbit swings around what the first input view looks at, or circles a splat without --cameras; inputs goes from the first input view to the last and back; FILE is a camera path of
    nerfstudio or a transforms.json, in the coordinates of the scene's poses."""
    show: Annotated[
        tuple[Literal["colour", "classes", "overlay", "depth", "confidence", "alpha", "rgba"], ...],
        Words(shown="colour classes; without classes, colour depth"),
    ] = ()
    """What to show. overlay is colour tinted by class, confidence the probability of the likeliest class, alpha the opacity, and rgba colour with
    transparency, for images only."""
    frames: Annotated[Count | None, Words(metavar="INT", shown="120; a FILE has its own")] = None
    """Number of images along the path."""
    degrees: Annotated[
        float | None,
        Words(metavar="FLOAT", shown="24; 360 for a splat without --cameras"),
    ] = None
    """Angle of the orbit: half of it to each side, or 360 for a full circle. The further from the input views, the more holes there are."""
    size: Annotated[Size | None, optional("HxW")] = None
    """Height x width of the images, in pixels; by default that of the reconstruction. The vertical field of view stays; both sides show more or less."""
    fps: Count = 30
    """Images per second of a video."""
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] = "auto"
    """The direction that is up in the scene's coordinates, for the orbit."""
    cameras: Annotated[Path | None, optional("SCENE")] = None
    """For a splat: the scene with its cameras, in its coordinates. Without it, cameras are put around the splat, or inside if it is a room."""
    activated: Activated = "auto"
    """A splat as PLY or glTF: whether scales are lengths and opacities 0 to 1, not logarithms and logits; auto is what they look like."""
    min_confidence: Probability = 0.0
    """Pixels whose likeliest class is less likely than this are unknown: grey in the class map."""
    overwrite: bool = False
    """Replace OUT from an earlier run, once the new one is complete."""

    def run(self, progress: Progress) -> Outcome:
        """Render.

        Raises:
            InputError: the scene or the camera file cannot be used, or OUT cannot be written.
            UsageError: an option is invalid.
            ImportError: OUT is a video, and PyAV is not installed.
        """
        ending = self.out.suffix.lower()
        video = ending == VIDEO
        if not video and ending in FILE_ENDINGS:
            raise UsageError(f"--out is {self.out}; expected a video ({VIDEO}), or a folder, whose name has no ending")
        if self.degrees is not None and not 0 < self.degrees <= 360:
            raise UsageError(f"--degrees is {self.degrees:g}; expected more than 0, at most 360")
        if video and "rgba" in self.show:
            raise UsageError("--show rgba is for images; a video has no transparency")
        self._check_path()
        if self.fps != Render.fps and not video:
            raise UsageError(f"--fps is for a video; {self.out} does not end with {VIDEO}")
        if video:
            check_new_file(self.out, self.overwrite)
        else:
            check_folder(self.out, "render", self.overwrite, (self.scene, self.cameras, *self._camera_file()))
        with progress.stage("Reading the scene"):
            from semgs.export.video import check_video_library

            if video:
                check_video_library()
            opened = open_given(self.scene, self.cameras, self.up, self.activated)
            stills = self._stills(opened.scene)
            cameras, note = self._path_cameras(opened)
            if video:
                self._check_sides(cameras, len(stills.shows))
        count = cameras.batch[0]
        if video:
            self._write_video(stills, cameras, progress)
            written = f"{counted(count, 'image')}, {count / self.fps:.1f} s at {self.fps} images per second"
        else:
            self._write_folder(stills, cameras, progress)
            written = f"{counted(count, 'image')} each of {', '.join(stills.shows)}"
        before, after = ([f"note: {one}"] if one else [] for one in (opened.note, note))
        return Outcome((*before, f"{self.out}: {written}", *after), tuple(filter(None, (opened.note, note))))

    def _check_path(self) -> None:
        """Check what --path names, and that --up matters for it."""
        if self.path not in OWN_PATHS and (found := found_at(typed_path(self.path))) != "a file":
            raise UsageError(
                f"--path is {self.path}{did_you_mean(self.path, OWN_PATHS)}; expected {', '.join(OWN_PATHS)} or a file of cameras, found {found}"
            )
        # Around a splat, the input views themselves are put by up.
        put_by_up = self.path == "inputs" and self.cameras is None and is_splat(self.scene)
        if self.up != "auto" and self.path != "orbit" and not put_by_up:
            raise UsageError(f"--up is for orbit; --path is {self.path}")

    def _camera_file(self) -> tuple[str, ...]:
        """The file of --path, if it is one."""
        return () if self.path in OWN_PATHS else (self.path,)

    def _stills(self, scene: SavedScene) -> Stills:
        """What renders the images."""
        from semgs.export.stills import OF_CLASSES, Stills

        shows = self.show or (("colour", "depth") if scene.classes is None else ("colour", "classes"))
        missing = [show for show in shows if show in OF_CLASSES]
        if scene.classes is None and missing:
            raise InputError(
                self.scene, f"a scene with classes for --show {missing[0]}", "one with colour and depth only"
            )
        if self.min_confidence and not {*shows} & {*MAY_BE_UNKNOWN}:
            raise UsageError(
                f"--min-confidence is for --show {' and '.join(MAY_BE_UNKNOWN)}; --show is {' '.join(shows)}"
            )
        with what_the_user_gave():
            return Stills(scene, shows, self.min_confidence)

    def _path_cameras(self, opened: OpenedScene) -> tuple[Cameras, str]:
        """The cameras of the path, and a note; "" for none."""
        from semgs.export.camera_files import read_camera_file
        from semgs.geometry.camera_paths import interpolate_cameras, orbit, resize_cameras
        from semgs.scene.upright import up_of

        note, scene = "", opened.scene
        if self.path == "orbit":
            up = up_of(scene, opened.up)
            if not up.certain:
                note = up.warning
            camera, pivot = scene.cameras[0], opened.pivot
            degrees = self.degrees or (SWING if pivot is None else CIRCLE)
            if pivot is None:
                seen = scene.depths[0][scene.depths[0] > 0]
                pivot = camera.centres + float(seen.median() if len(seen) else 1.0) * camera.world_from_camera[:3, 2]
            cameras = orbit(camera, pivot, up.direction, degrees, self.frames or 120)
        elif self.path == "inputs":
            if len(scene.frames) < 2:
                raise InputError(self.scene, "two input views or more for --path inputs", "one")
            cameras = interpolate_cameras(scene.cameras, self.frames or 120)
        else:
            cameras = read_camera_file(typed_path(self.path)).relative_to(scene.origin)
        return (cameras if self.size is None else resize_cameras(cameras, self.size)), note

    def _check_sides(self, cameras: Cameras, shows: int) -> None:
        """Check that images fit side by side into a video."""
        from semgs.export.stills import GAP_PX
        from semgs.export.video import NARROWEST, WIDEST

        height, width = cameras.size
        if min(height, width) < NARROWEST:
            raise UsageError(f"the images have {height}x{width} pixels; a video needs at least {NARROWEST}x{NARROWEST}")
        width = shows * (width + GAP_PX) - GAP_PX
        if width > WIDEST:
            raise UsageError(
                f"the images are {width} pixels wide side by side; a video has at most {WIDEST}: use --size or fewer --show"
            )

    def _write_video(self, stills: Stills, cameras: Cameras, progress: Progress) -> None:
        """Write the video."""
        from semgs.export.stills import side_by_side
        from semgs.export.video import write_video

        with progress.steps("Rendering", cameras.batch[0]) as done:

            def frames():
                for index, images in enumerate(stills.images(cameras)):
                    yield side_by_side(images)
                    done(index + 1)

            write_video(self.out, frames(), self.fps)

    def _write_folder(self, stills: Stills, cameras: Cameras, progress: Progress) -> None:
        """Write the folder."""
        from semgs.export.camera_files import write_camera_file
        from semgs.files.images.pictures import write_png

        with (
            own_folder(self.out, "render", self.overwrite) as folder,
            progress.steps("Rendering", cameras.batch[0]) as done,
        ):
            for index, images in enumerate(stills.images(cameras)):
                for show, image in zip(stills.shows, images, strict=True):
                    write_png(folder / f"{index:04d}_{show}.png", image)
                done(index + 1)
            in_source = cameras.relative_to([-side for side in stills.scene.origin])
            write_camera_file(folder / CAMERAS, in_source)

"""`semgs reconstruct`: turns posed photos into a folder with the scene, its renders and a report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar

from semgs.files.folders import check_apart, check_folder, check_new_file, own_folder
from semgs.files.paths import check_utf8, existing_folder, files_among
from semgs.model.networks import NetworkName
from semgs.run.device import chosen_device, chosen_precision
from semgs.run.options.depth_options import DepthOptions
from semgs.run.options.scene_options import PosingOptions, SceneOptions
from semgs.run.options.segmenter_options import FeatureOptions, SegmenterOptions
from semgs.run.options.types import (
    AutoSize,
    Device,
    Exposure,
    Looks,
    NearFar,
    Passes,
    PrecisionOrAuto,
    Probability,
    Views,
    WeightsOrRandom,
)
from semgs.run.options.words import INLINE, Words, optional, positional
from semgs.run.outcome import Outcome, Run
from semgs.run.output.rerun_library import rerun_library
from semgs.run.usage_errors import UsageError, what_fits, what_the_user_gave
from semgs.runtime.notes import Kind, Note, Progress
from semgs.runtime.stopwatch import Stages
from semgs.viewer.server import check_viewer_library

if TYPE_CHECKING:
    from semgs.data.choosing.choice import Choice
    from semgs.data.scene import Scene
    from semgs.depth_maps.depth_source import DepthMaps
    from semgs.depth_maps.sensor_depth import DepthSource
    from semgs.model.semgs import SemGS
    from semgs.run.output.report import Provenance
    from semgs.run.photo_scene import PhotoScene
    from semgs.run.steps.result import Reconstruction


MOST_VIEWS = 12
"""At most so many input views are used by default."""

RANDOM_WEIGHTS = Kind("The weights are random: the network is untrained, so its output is noise.")

CHOOSING = Kind("Choosing among {count} frames", "Choosing among {count} photos")


@dataclass(frozen=True)
class Reconstruct(Run):
    """Turn photos of a room into a labelled 3D scene of Gaussians: one forward pass, then a few seconds of refinement.

    SCENE is a folder with a transforms.json (nerfstudio's or instant-ngp's), a COLMAP model, a Polycam or Record3D capture, a ROS bag, a
    scene of ScanNet, ScanNet++, Replica, TUM RGB-D or 7-Scenes, RGB-D frames with poses in text, or an archive from semgs prepare. The
    layout is detected automatically. If it is a folder of photos without poses, or a video, the cameras are estimated first (extra sfm) and
    kept in cameras/, which is a scene too. Name frames by file name, or by position among the usable frames in file order, from 0.

    The output folder contains
    - report.html: start here: photos, renders, class maps, depth, scores, and which frames were used and why
    - report.json: all numbers of the report
    - gaussians.ply: plain 3DGS, for every Gaussian splat viewer; semantics.ply: the same coloured by class. Both are turned upright and
    centred; export.json has the matrix back, and semgs export writes other formats and frames
    - scene.html, with --html: the scene in 3D, one page for your browser that needs no network
    - scene.safetensors: everything, for semgs.load_scene in Python; with --features also features.safetensors, for semgs query
    - renders/: for every view image, classes (coloured), labels (class number per pixel, 255 = unseen, 254 = unknown), confidence
    (percent), depth (16-bit millimetres, or float TIFF where the scene's unit is unknown), depth_spread (its uncertainty, millimetres per
    metre), alpha, and the photo beside them

    The folder appears only once it is complete. Bad input ends with a one-line error and exit code 2.

    Examples
    - semgs reconstruct scans/office --out out/office
    - semgs reconstruct scans/office --out out/office --views 3 --overwrite
    - semgs reconstruct scans/office --out out/office --context 3 7 --size 480x640
    - semgs reconstruct recording --out out/robot --camera /camera/color --world map
    - semgs reconstruct scans/office --out out/office --weights re10k.ckpt
    - semgs reconstruct scans/office --out out/office --segmenter segformer.onnx
    - semgs reconstruct scans/office --out out/office --features clip
    - semgs reconstruct recording --out out/robot --depth sensor
    - semgs reconstruct room --out out/room --depth hf:depth-anything/Depth-Anything-V2-Small-hf
    - semgs reconstruct scans/office --out out/office --refine 0
    - semgs reconstruct scans/office --out out/office --keep-poses
    - semgs reconstruct photos --out out/kitchen --scale-from IMG_1.jpg IMG_4.jpg 1.25
    - semgs reconstruct clip.mp4 --out out/kitchen
    - semgs reconstruct recording --out out/flat --all
    - semgs reconstruct recording --out out/flat --all --rerun flat.rrd
    """

    excludes: ClassVar = {"--all": ("--context", "--views"), "--refine-poses": ("--keep-poses",)}

    scene: Annotated[Path, positional("SCENE")]
    """The scene: a folder, or a single file."""
    out: Annotated[Path, Words(metavar="DIR")]
    """Output folder: new, empty, or, with --overwrite, one from an earlier run."""
    views: Annotated[Views | None, optional()] = None
    """Use only so many input views, 2 or more, which are chosen by overlap and baseline. By default, up to 12 are used: every frame that adds
    something. Of four or more frames, every eighth is held out for comparison. More than 4 input views are encoded in windows of three, and
    merged; see docs/recordings.md."""
    all: bool = False
    """Use every frame that adds something, also if there are more than 12."""
    context: Annotated[tuple[int | str, ...], optional("FRAME [FRAME ...]")] = ()
    """Use these frames as input views, by position or name, instead of choosing them automatically."""
    size: AutoSize = None
    """Resize the images to height x width, such as 240x320; other aspect ratios are centre-cropped. By default, images are reduced
    to at most 76,800 pixels, with the same aspect ratio and sides that are multiples of 16."""
    depth_range: NearFar = None
    """Depth bounds for the network, in the scene's unit. By default they come from the scene; most metric scenes get 0.5 10. For a camera that is
    nearer to things, state them, such as 0.25 5."""
    weights: Annotated[WeightsOrRandom, Words(shown="small")] = None
    """"small" for the included weights, a weights file, hf://OWNER/NAME[@REVISION] to download from the Hugging Face hub, or "random".
    A file says which network it is for; MVSplat's checkpoints give colour and depth only."""
    model: Annotated[NetworkName | None, optional()] = None
    """Network for --weights random, or base to fill it from MVSplat's checkpoint. Otherwise the weights decide. small runs on a laptop,
    base has the paper's sizes, mvsplat has colour and depth only."""
    exposure: Exposure = "auto"
    """Bring the input photos to a common exposure, with a gain and an offset for each, from the surfaces that they share: auto if they
    clearly differ, fitted always, as-taken never. Held-out photos are compared at the exposure of the room. See docs/questions.md."""
    refine_poses: bool = False
    """Correct the cameras of the input and held-out frames, by up to a few degrees, so that they fit matches between the images. By default,
    this is done unless a quick test finds that they fit, or a usual mistake. Cameras that fit already stay as they are; the report says what
    moved. See docs/poses.md."""
    keep_poses: bool = False
    """Use the cameras as they are, even if they miss matches between the images."""
    refine: Annotated[Passes, optional()] = -1
    """Refine the Gaussians on the input photos, which makes images sharp: PASSES steps for each photo, by default 15, or 7 for more than 12. The first
    held-out frame decides when to stop, and is held out no longer. 0 is the paper's single forward pass. See docs/refine.md."""
    looks: Annotated[Looks | None, optional()] = None
    """How often the network looks at each photo to classify it: the second time at its mirror image, 1.5 times as large. By default 2, which finds
    better classes; 1 with --refine 0, with a segmenter instead, or if classes depend on the cameras. See docs/method.md."""
    min_confidence: Probability = 0.0
    """Pixels whose likeliest class is less likely than this are unknown in class maps: light grey, 254 in label files. Unseen pixels are
    hatched and 255. Scores do not change."""
    device: Device = "auto"
    """Where to compute; auto uses a CUDA GPU if there is one."""
    precision: PrecisionOrAuto = "auto"
    """Precision of the network's layers. auto is bf16 on processors that compute in it (avx512_bf16 or amx_bf16), and float32 elsewhere. See
    docs/benchmarks.md."""
    html: bool = False
    """Also write scene.html, which shows the scene in 3D; semgs view --html has options for it. Needs the extra viewer."""
    rerun: Annotated[Path | None, optional("FILE.rrd")] = None
    """Also write a recording for Rerun: photos, cameras, class maps, Gaussians, boxes of things and free floor, on a timeline of frames. Needs
    the extra rerun."""
    drop_photos: bool = False
    """Do not keep photos without poses, with their estimated cameras, in DIR/cameras."""
    overwrite: bool = False
    """Replace a DIR from an earlier run, once the new result is complete, and the FILE of --rerun."""
    placing: Annotated[DepthOptions, INLINE] = field(default_factory=DepthOptions)
    segmenting: Annotated[SegmenterOptions, INLINE] = field(default_factory=SegmenterOptions)
    featuring: Annotated[FeatureOptions, INLINE] = field(default_factory=FeatureOptions)
    posing: Annotated[PosingOptions, INLINE] = field(default_factory=PosingOptions)
    reading: Annotated[SceneOptions, INLINE] = field(default_factory=SceneOptions)

    def run(self, progress: Progress) -> Outcome:
        """Reconstruct, and write the folder.

        Raises:
            InputError: the scene, the weights or the output folder cannot be used.
            UsageError: an option is invalid, or there is too little memory.
        """
        self._check()
        with progress.stage("Starting"):
            # Importing torch takes seconds; typing errors are reported before.
            from semgs.run.photo_scene import photo_scene

        device = chosen_device(self.device)
        in_units = "" if self.depth_range is None else "--depth-range"
        with photo_scene(self.scene, self.out, self.posing, progress, not self.drop_photos, in_units) as photos:
            return self._reconstruct(device, photos, progress)

    def _reconstruct(self, device: str, photos: PhotoScene | None, progress: Progress) -> Outcome:
        """Reconstruct the scene, or that of photos whose cameras were estimated."""
        from semgs.data.bounds.depth_range import DepthRange
        from semgs.data.scenes import open_with_details
        from semgs.run.output.files import summary, write_results
        from semgs.run.steps.pipeline import reconstruct

        asked = self.reading.as_peers, self.reading.asked
        if photos is None:
            scene = open_with_details(self.scene, *asked, needs_labels=False)
            check_apart(self.out, scene.places)
        else:
            scene = photos.scene(*asked)
        if self.depth_range is not None:
            scene = replace(scene, stated_range=DepthRange(*self.depth_range, scene.unit, "you say so"))
        stages = Stages(progress)
        depth = self.placing.source(scene, stages)
        scene, choice, notes = self._choose_frames(scene, depth, stages)
        with stages("load", "Loading the network"):
            network, origin = self._load_network(device)
        with own_folder(self.out, "reconstruct", self.overwrite) as folder:
            labelling = self.segmenting.load(scene, folder, self.out, stages)
            with what_fits(), what_the_user_gave():
                result = reconstruct(
                    scene,
                    replace(choice, size=self.size),
                    network,
                    depth=depth,
                    exposure=self.exposure,
                    labelling=labelling,
                    featuring=self.featuring.featuring(scene),
                    min_confidence=self.min_confidence,
                    passes=self._passes(choice),
                    stages=stages,
                )
                result = replace(result, notes=(*notes, *self._notes(), *result.notes))
            write_results(folder, result, origin, stages, self.html)
            if photos is not None and photos.kept:
                photos.move_to(folder)
        lacking = [] if self.rerun is None else self._write_rerun_file(self.rerun, result, stages)
        lines = [summary(result, stages.seconds, self.out, self.html, lacking)]
        if self.rerun is not None:
            lines.append(f"For Rerun: rerun {self.rerun}")
        if photos is not None and photos.kept:
            lines.append(f"The photos with their estimated cameras are a scene in {photos.scene_path}.")
        return Outcome(tuple(lines), result.notes)

    def _passes(self, choice: Choice) -> int:
        """How often to pass over the photos; 0 leaves the Gaussians as the network placed them."""
        from semgs.scene.photo_refinement import PASSES, WALK_PASSES

        if self.refine < 0:
            return PASSES if len(choice.context) <= MOST_VIEWS else WALK_PASSES
        return self.refine

    def _write_rerun_file(self, path: Path, result: Reconstruction, stages: Stages) -> list[str]:
        """Write a recording for Rerun. Returns notes about what it lacks."""
        from semgs.run.output.rerun_file import save_rerun

        with stages("rerun", f"Writing {path}"):
            return save_rerun(path, result)

    def _choose_frames(
        self, scene: Scene, depth: DepthSource | DepthMaps, stages: Stages
    ) -> tuple[Scene, Choice, Sequence[str]]:
        """The scene, with its cameras refined if that helps, the chosen frames, and notes about their cameras."""
        with stages("choose", CHOOSING(count=len(scene))):
            choice = self._choose(scene, depth)
        scene, notes = self._fit_cameras(scene, (*choice.context, *choice.targets), stages)
        return scene, choice, notes

    def _fit_cameras(self, scene: Scene, chosen: tuple[int, ...], stages: Stages) -> tuple[Scene, Sequence[str]]:
        """The scene with the cameras of chosen frames refined, if they miss matches or it is requested, and notes about them."""
        from semgs.doctor.quick import frames_to_test, quick_test

        inverse = self.placing.depth_meaning == "inverse"
        warnings: list[Note] = []
        if not self.refine_poses:
            with stages("check", "Checking the cameras"):
                tested = quick_test(scene, frames_to_test(chosen, len(scene)), inverse=inverse)
            warnings = tested.warnings
            if self.keep_poses or tested.fits:
                return scene, warnings
        with stages("refine", f"Refining {len(chosen)} cameras"):
            from semgs.sfm.camera_refinement import refine_cameras

            refinement = refine_cameras(scene, chosen)
        if not self.refine_poses and not refinement.accepted:
            return scene, warnings
        scene = refinement.applied(scene)
        with stages("check", "Checking the cameras"):
            tested = quick_test(scene, chosen, refined=True, inverse=inverse)
        return scene, [*refinement.notes(), *tested.warnings]

    def _check(self) -> None:
        """Check what can be checked without importing torch."""
        existing_folder(self.scene)
        check_folder(
            self.out,
            "reconstruct",
            self.overwrite,
            (
                self.scene,
                *files_among(self.weights),
                *self.placing.inputs,
                *self.segmenting.inputs,
                self.featuring.features,
                self.reading.images,
            ),
        )
        self.reading.check()
        self.placing.check()
        self.segmenting.check(self.looks)
        self.featuring.check()
        if self.html:
            check_viewer_library()
        if self.rerun is not None:
            self._check_rerun_file(self.rerun)
        if len(self.context) == 1:
            raise UsageError("--context has one frame; expected two or more that overlap")
        if self.context and self.views not in (None, len(self.context)):
            raise UsageError(f"--views is {self.views} and --context names {len(self.context)} frames; leave one out")

    def _check_rerun_file(self, path: Path) -> None:
        """Check that a recording for Rerun can be written."""
        if path.suffix != ".rrd":
            raise UsageError(f"--rerun is {path}; expected a file that ends in .rrd")
        check_utf8(path, "Rerun")
        rerun_library()
        # A file in the output folder is written once that is complete.
        if path.absolute().parent != self.out.absolute():
            check_new_file(path, self.overwrite)

    def _notes(self) -> list[Note]:
        """Notes for the report that follow from the options."""
        notes = []
        if self.weights == "random":
            notes.append(RANDOM_WEIGHTS())
        return notes

    def _choose(self, scene: Scene, depth: DepthSource | DepthMaps) -> Choice:
        """Input frames and held-out frames."""
        from semgs.data.choosing.choice import choose, choose_named
        from semgs.data.choosing.coverage import choose_covering
        from semgs.run.steps.view_encoder import why_not

        if self.context:
            with what_the_user_gave():
                return choose_named(scene, self.context)
        if self.views is None:
            most = None if self.all else MOST_VIEWS
            return choose_covering(
                scene, most, lambda position, bounds: why_not(scene, position, self.size, depth, bounds)
            )
        if self.views > len(scene):
            raise UsageError(f"--views is {self.views}; expected 2 to {len(scene)}, the usable frames of {scene.path}")
        return choose(scene, self.views)

    def _load_network(self, device: str) -> tuple[SemGS, Provenance]:
        """The network on its device, and its origin for the report."""
        from semgs._version import __version__
        from semgs.run.output.report import Provenance

        model = self.load_network(device)
        parameters = sum(parameter.numel() for parameter in model.parameters())
        return model, Provenance(f"semgs {__version__}", model.origin, parameters, device, model.precision, model.looks)

    def load_network(self, device: str) -> SemGS:
        """The network on a device.

        Raises:
            InputError: its weights cannot be used.
            UsageError: there is no such network, or it has no included weights.
        """
        from semgs.model.weights.load import load
        from semgs.runtime.kept import kept

        with what_the_user_gave():
            network = kept(load, *self._network_and_weights()).eval().to(device)
            network.looks = self.looks or (1 if self.refine == 0 or self.segmenting.replaces else network.most_looks)
        network.precision = chosen_precision(self.precision, device)
        return network

    def _network_and_weights(self) -> tuple[str, str | None]:
        """The network, and its weights unless they are the included ones, as `load` takes them."""
        if self.weights is None:
            return self.model or "small", None
        if self.weights == "random":
            return self.model or "small", "random"
        return (self.weights, None) if self.model in (None, self.weights) else (self.model or "small", self.weights)

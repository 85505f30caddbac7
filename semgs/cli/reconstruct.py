"""`semgs reconstruct`: turns posed photos into a folder with the scene, its renders and a report."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from semgs.cli.device import chosen_device
from semgs.cli.errors import UsageError, what_fits, what_the_user_gave
from semgs.cli.feature_options import FeatureOptions
from semgs.cli.progress import say_compiling, show_stage
from semgs.cli.recording import check_recording_options, reconstructed
from semgs.cli.scene_options import SceneOptions
from semgs.cli.segmenter_options import SegmenterOptions
from semgs.cli.types import AutoSize, Device, Probability, Views, WeightsOrRandom
from semgs.files.folders import check_folder, own_folder
from semgs.files.paths import existing_folder
from semgs.reconstruction.stages import Stages
from semgs.viewer.server import check_viewer_library

if TYPE_CHECKING:
    from semgs.data.choice import Choice
    from semgs.data.scene import Scene
    from semgs.model.semgs import SemGS
    from semgs.reconstruction.report import Origin
    from semgs.segmenters.labelling import Labelling


SEGMENTER = "segmenter"
"""Folder in the output for the maps of a segmentation network."""

MOST_VIEWS = 4
"""The models were trained with at most this many input views."""


@dataclass(frozen=True)
class Reconstruct:
    """Turn posed photos of a room into a labelled 3D scene of Gaussians, in one forward pass.

    SCENE is a folder with a transforms.json (nerfstudio's or instant-ngp's), a COLMAP model, a Polycam or Record3D capture, a ROS bag, a
    scene of ScanNet, ScanNet++, Replica, TUM RGB-D or 7-Scenes, RGB-D frames with poses in text, or an archive from semgs prepare. The
    layout is detected automatically. Name frames by file name, or by position among the usable frames in file order, from 0.

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
    - semgs reconstruct recording --out out/flat --all
    """

    scene: Annotated[Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")]
    """The scene: a folder, or a single file."""
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")]
    """Output folder: new, empty, or, with --overwrite, one from an earlier run."""
    views: Views = 2
    """Number of input views, 2 or more. They are chosen by overlap and baseline; other frames that they cover are held out for
    comparison. Fewer are used if no other frame shares 30 % of what it sees. Trained with 2 to 4; more is allowed but may blur."""
    all: bool = False
    """Use the whole recording: keyframes are chosen along the walk, encoded in windows of --views frames, and merged into one scene;
    see docs/recordings.md."""
    context: Annotated[tuple[int | str, ...], tyro.conf.arg(metavar="FRAME [FRAME ...]", help_behavior_hint="")] = ()
    """Use these frames as input views, by position or name, instead of choosing them automatically."""
    size: AutoSize = None
    """Resize the images to height x width, such as 240x320; other aspect ratios are centre-cropped. By default, images are reduced
    to at most 76,800 pixels, with the same aspect ratio and sides that are multiples of 16."""
    weights: Annotated[WeightsOrRandom, tyro.conf.arg(help_behavior_hint="(default: small)")] = None
    """"small" for the included weights, a weights file, hf://OWNER/NAME[@REVISION] to download from the Hugging Face hub, or "random".
    A file says which network it is for; MVSplat's checkpoints give colour and depth only."""
    model: Annotated[Literal["small", "base", "base_text", "mvsplat"] | None, tyro.conf.arg(help_behavior_hint="")] = (
        None
    )
    """Network for --weights random, or base to fill it from MVSplat's checkpoint. Otherwise the weights decide. small runs on a laptop,
    base has the paper's sizes, mvsplat has colour and depth only."""
    depth: Literal["network", "sensor", "both"] = "network"
    """Where the Gaussians' depth comes from: the network, the frames' depth maps, or both, weighted by their uncertainty. At least half of
    the pixels of each input frame must be measured; the rest takes the network's depth, fitted to the measured one."""
    min_confidence: Probability = 0.0
    """Pixels whose likeliest class is less likely than this are unknown in class maps: light grey, 254 in label files. Unseen pixels are
    hatched and 255. Scores do not change."""
    device: Device = "auto"
    """Where to compute; auto uses a CUDA GPU if there is one."""
    html: bool = False
    """Also write scene.html, which shows the scene in 3D; semgs view --html has options for it. Needs viser."""
    overwrite: bool = False
    """Replace a DIR from an earlier run, once the new result is complete."""
    segmenting: Annotated[SegmenterOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=SegmenterOptions)
    featuring: Annotated[FeatureOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=FeatureOptions)
    reading: Annotated[SceneOptions, tyro.conf.OmitArgPrefixes] = field(default_factory=SceneOptions)

    def run(self) -> None:
        """Reconstruct, write the folder, and print a summary.

        Raises:
            InputError: the scene, the weights or the output folder cannot be used.
            UsageError: an option is invalid, or there is too little memory.
        """
        self._check()
        with show_stage("Starting"):
            # Importing torch takes seconds; typing errors are reported before.
            from semgs.data.scenes import open_asked

        device = chosen_device(self.device)
        scene = open_asked(self.scene, self.reading.as_peers, self.reading.asked, needs_labels=False)
        stages = Stages(show_stage, say_compiling)
        if self.all:
            self._run_recording(scene, device, stages)
            return
        with stages("choose", f"Choosing among {len(scene)} frames"):
            choice = self._choice(scene)
        with stages("check", "Checking the cameras"):
            from semgs.doctor.quick import warnings_of

            warnings = warnings_of(scene, (*choice.context, *choice.targets))
        with stages("load", "Loading the network"):
            model, origin = self._model(device)

        from semgs.cli.reconstruction_files import summary, write_results
        from semgs.reconstruction.reconstruct import reconstruct

        with own_folder(self.out, self.overwrite) as folder:
            labelling = self._labelling(scene, folder, stages)
            with what_fits(), what_the_user_gave():
                result = reconstruct(
                    scene,
                    choice,
                    model,
                    self.size,
                    depth=self.depth,
                    labelling=labelling,
                    featuring=self.featuring.featuring(scene),
                    stages=stages,
                    min_confidence=self.min_confidence,
                    notes=[*warnings, *self._notes()],
                )
            result = write_results(folder, result, origin, stages, self.html)
        print(summary(result, stages.seconds, self.out, self.html))

    def _run_recording(self, scene: Scene, device: str, stages: Stages) -> None:
        """Reconstruct from all frames, write the folder, and print a summary."""
        with stages("load", "Loading the network"):
            model, origin = self._model(device)

        from semgs.cli.reconstruction_files import summary, write_results

        with own_folder(self.out, self.overwrite) as folder:
            result = reconstructed(
                scene,
                model,
                self.size,
                depth=self.depth,
                labelling=self._labelling(scene, folder, stages),
                views=self.views,
                min_confidence=self.min_confidence,
                stages=stages,
                notes=self._notes(),
            )
            result = write_results(folder, result, origin, stages, self.html)
        print(summary(result, stages.seconds, self.out, self.html))

    def _check(self) -> None:
        """Check what can be checked without importing torch."""
        existing_folder(self.scene)
        check_folder(self.out, self.overwrite)
        self.reading.check()
        self.segmenting.check()
        self.featuring.check()
        if self.html:
            check_viewer_library()
        if self.all:
            check_recording_options(self.views, self.context, self.featuring.features is not None)
        if len(self.context) == 1:
            raise UsageError("--context has one frame; expected two or more that overlap")

    def _notes(self) -> list[str]:
        """Notes for the report that follow from the options."""
        notes = []
        if self.weights == "random":
            notes.append("The weights are random: the network is untrained, so its output is noise.")
        if max(self.views, len(self.context)) > MOST_VIEWS:
            notes.append(f"The model was trained with 2 to {MOST_VIEWS} views; more may blur what several views see.")
        return notes

    def _choice(self, scene: Scene) -> Choice:
        """Input frames and held-out frames."""
        from semgs.data.choice import choose, given

        if self.context:
            with what_the_user_gave():
                return given(scene, self.context)
        if self.views > len(scene):
            raise UsageError(f"--views is {self.views}; expected 2 to {len(scene)}, the usable frames of {scene.path}")
        return choose(scene, self.views)

    def _model(self, device: str) -> tuple[SemGS, Origin]:
        """The network on its device, and its origin for the report."""
        from semgs._version import __version__
        from semgs.reconstruction.report import Origin
        from semgs.weights.load import load

        with what_the_user_gave():
            model = load(*self._named())
        parameters = sum(parameter.numel() for parameter in model.parameters())
        return model.eval().to(device), Origin(f"semgs {__version__}", model.origin, parameters, device)

    def _labelling(self, scene: Scene, folder: Path, stages: Stages) -> Labelling | None:
        """What gives the Gaussians their classes; None for the network's own."""
        if self.segmenting.segmenter is None:
            return None
        with stages("load", f"Loading {self.segmenting.segmenter}"):
            found = self.segmenting.labelling(folder / SEGMENTER, self.out / SEGMENTER)
            return found and found(scene)

    def _named(self) -> tuple[str, str | None]:
        """The network, and its weights unless they are the included ones, as `load` takes them."""
        if self.weights in (None, "shipped"):
            return self.model or "small", None
        if self.weights == "random":
            return self.model or "small", "random"
        assert self.weights is not None
        return (self.weights, None) if self.model in (None, self.weights) else (self.model or "small", self.weights)

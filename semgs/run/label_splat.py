"""`semgs label-splat`: gives the Gaussians of a splat of another program classes."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from semgs._version import __version__
from semgs.files.errors import InputError
from semgs.files.folders import check_apart, check_folder, own_folder
from semgs.files.paths import existing_folder, files_among
from semgs.run.device import chosen_device, chosen_precision
from semgs.run.options.scene_options import SceneOptions
from semgs.run.options.segmenter_options import SegmenterOptions
from semgs.run.options.types import (
    ACTIVATED,
    Activated,
    AutoSize,
    Count,
    Device,
    Looks,
    PrecisionOrAuto,
    Probability,
    WeightsOrRandom,
    at_least,
)
from semgs.run.options.words import INLINE, Words, one_word, optional, positional
from semgs.run.outcome import Outcome, Run
from semgs.run.usage_errors import UsageError, what_the_user_gave
from semgs.runtime.notes import Progress
from semgs.runtime.stopwatch import Stages
from semgs.viewer.server import check_viewer_library

if TYPE_CHECKING:
    from semgs.data.scene import Scene
    from semgs.run.output.report import Provenance
    from semgs.segmenters.labelling import Labelling


@dataclass(frozen=True)
class LabelSplat(Run):
    """Give a splat of another program classes, from its photos.

    SPLAT is a 3DGS PLY, a compressed PLY of SuperSplat, an SPZ or a glTF with KHR_gaussian_splatting. SCENE has the photos and their cameras, in the
    coordinates of the splat: the COLMAP model, the transforms.json, or any other layout that semgs reconstruct takes. Each photo is classified, and each
    Gaussian collects the classes of the pixels that it contributes to, by its blending weights. Nothing is optimised: positions, shapes and colours
    stay as they are. Gaussians that are in no photo stay unseen.

    OUT is as from semgs reconstruct: report.html, gaussians.ply, semantics.ply, scene.safetensors and renders/. semgs export, render and view take it.

    Examples
    - semgs label-splat office.ply --cameras scans/office --out out/office
    - semgs label-splat office.spz --cameras scans/office --out out/office --every 3
    - semgs label-splat office.ply --cameras scans/office --out out/office --segmenter hf:CIDAS/clipseg-rd64-refined --words mug laptop
    """

    excludes: ClassVar = {"--segmenter": ("--weights",)}

    splat: Annotated[Path, positional("SPLAT")]
    """The splat."""
    cameras: Annotated[Path, Words(metavar="SCENE")]
    """The photos and their cameras."""
    out: Annotated[Path, Words(metavar="OUT")]
    """Output folder: new, empty, or, with --overwrite, one from an earlier run."""
    every: Count = 1
    """Classify each n-th photo."""
    hold_out: Annotated[int, one_word("INT", at_least(0))] = 8
    """Hold out one of this many photos, to compare renderings with; 0 holds out none."""
    size: AutoSize = None
    """Height x width at which photos are classified and rendered; by default at most 76,800 pixels, as for semgs reconstruct."""
    weights: Annotated[WeightsOrRandom, Words(shown="small")] = None
    """The weights that classify photos, as for semgs reconstruct; --segmenter is used instead of them."""
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] = "auto"
    """The direction that is up in the scene's coordinates."""
    activated: Activated = "auto"
    """PLY or glTF: whether scales are lengths and opacities 0 to 1, not logarithms and logits; auto is what they look like."""
    looks: Annotated[Looks | None, optional()] = None
    """How often the network looks at each photo to classify it, as for semgs reconstruct."""
    min_confidence: Probability = 0.0
    """Pixels whose likeliest class is less likely than this are unknown in class maps: light grey, 254 in label files."""
    device: Device = "auto"
    """Where to compute; auto uses a CUDA GPU if there is one."""
    precision: PrecisionOrAuto = "auto"
    """Precision of the network's layers, as for semgs reconstruct."""
    html: bool = False
    """Also write scene.html, which shows the scene in 3D. Needs the extra viewer."""
    overwrite: bool = False
    """Replace OUT from an earlier run, once the new result is complete."""
    segmenting: Annotated[SegmenterOptions, INLINE] = field(default_factory=SegmenterOptions)
    reading: Annotated[SceneOptions, INLINE] = field(default_factory=SceneOptions)

    def run(self, progress: Progress) -> Outcome:
        """Label the splat, and write the folder.

        Raises:
            InputError: the splat, the photos, the weights or the output folder cannot be used.
            UsageError: an option is invalid.
            ImportError: a library that an option needs is not installed.
        """
        self._check()
        with progress.stage("Starting"):
            from semgs.data.scenes import open_with_details
            from semgs.run.output.files import summary, write_results
            from semgs.run.steps.result import GivenSplat
            from semgs.run.steps.splat_labelling import hold_out, label_splat
            from semgs.splats.load import load_splat
            from semgs.splats.scene_opening import fit_to_scene

        device = chosen_device(self.device)
        stages = Stages(progress)
        with stages("read", f"Reading {self.splat.name}"):
            splat = load_splat(self.splat, ACTIVATED[self.activated])
            scene = open_with_details(self.cameras, self.reading.as_peers, self.reading.asked, needs_labels=False)
            check_apart(self.out, scene.places)
            moved = fit_to_scene(self.splat, splat.gaussians, scene)
        voting, held = hold_out(len(range(0, len(scene), self.every)), self.hold_out)
        with own_folder(self.out, "label-splat", self.overwrite) as folder:
            labelling, origin = self._labelling(scene, folder, device, stages)
            try:
                result = label_splat(
                    scene,
                    moved.gaussians,
                    labelling,
                    GivenSplat(
                        self.splat.name, splat.format, len(voting), tuple(filter(None, (*splat.notes, moved.note)))
                    ),
                    [self.every * place for place in voting],
                    [self.every * place for place in held],
                    self.size,
                    up=self.up,
                    min_confidence=self.min_confidence,
                    stages=stages,
                )
            except InputError:
                raise
            except ValueError as error:
                raise InputError(self.splat, f"a splat in the coordinates of {self.cameras}", str(error)) from error
            write_results(folder, result, origin, stages, self.html)
        return Outcome((summary(result, stages.seconds, self.out, self.html),), result.notes)

    def _check(self) -> None:
        """Check what can be checked without importing torch."""
        existing_folder(self.splat, "a splat")
        existing_folder(self.cameras)
        check_folder(
            self.out,
            "label-splat",
            self.overwrite,
            (
                self.splat,
                self.cameras,
                *files_among(self.weights),
                *self.segmenting.inputs,
                self.reading.images,
            ),
        )
        self.reading.check()
        self.segmenting.check(self.looks)
        if self.segmenting.with_own_classes:
            raise UsageError(
                "--with-own-classes is for semgs reconstruct; here --segmenter is used instead of the weights"
            )
        if self.hold_out == 1:
            raise UsageError("--hold-out 1 holds out every photo; expected 0 for none, or 2 or more")
        if self.html:
            check_viewer_library()

    def _labelling(self, scene: Scene, folder: Path, device: str, stages: Stages) -> tuple[Labelling, Provenance]:
        """What says the classes of photos, and its origin for the report."""
        from semgs.model.weights.load import load
        from semgs.run.output.report import Provenance
        from semgs.run.steps.splat_labelling import NetworkClasses
        from semgs.runtime.kept import kept
        from semgs.segmenters.labelling import Labelling

        software = f"semgs {__version__}"
        if (labelling := self.segmenting.load(scene, folder, self.out, stages)) is not None:
            return labelling, Provenance(software, "", 0, device)
        with stages("load", "Loading the network"), what_the_user_gave():
            name = self.weights or "small"
            model = kept(load, "small", "random") if name == "random" else kept(load, name)
            model.precision = chosen_precision(self.precision, device)
            model.looks = self.looks or model.most_looks
            source = NetworkClasses(model.eval().to(device))
        parameters = sum(parameter.numel() for parameter in model.parameters())
        return Labelling(source), Provenance(software, model.origin, parameters, device, model.precision, model.looks)

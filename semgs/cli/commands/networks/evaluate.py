"""`semgs evaluate`: scores weights or predictions on scenes, and writes a folder with scores, maps and a report."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from semgs.cli.progress import show_progress, show_stage
from semgs.files.errors import InputError
from semgs.files.folders import check_apart, check_folder
from semgs.files.paths import existing_folder, files_among, found_at
from semgs.run.device import chosen_device, chosen_precision
from semgs.run.options.depth_options import OWN, SENSOR, DepthMeaning
from semgs.run.options.scene_options import SceneOptions
from semgs.run.options.segmenter_options import SegmenterOptions
from semgs.run.options.types import (
    AutoSize,
    Count,
    Device,
    Exposure,
    Looks,
    NearFar,
    Passes,
    PrecisionOrAuto,
    Protocol,
    SeveralCounts,
    SeveralViews,
    Weights,
    Workers,
)
from semgs.run.options.words import INLINE, Words, optional, positional
from semgs.run.usage_errors import UsageError, what_fits, what_the_user_gave

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from semgs.data.scene import Scene
    from semgs.data.tables.class_groups import ClassGroups
    from semgs.data.tables.classes import ClassTable
    from semgs.depth_maps.depth_source import DepthMaps
    from semgs.evaluation.frames.frame_plan import FramePlan
    from semgs.evaluation.run import Candidate
    from semgs.evaluation.tables.evaluation_report import EvaluatedMethod
    from semgs.runtime.precision import Precision
    from semgs.segmenters.class_source import ClassSource
    from semgs.segmenters.labelling import Labelling


TWO_LOOKS = "The network looked at each view twice to classify it (--looks 2)."


@dataclass(frozen=True)
class Evaluate:
    """Score weights, or saved predictions, on a fixed list of frames, next to simple baselines.

    The protocol sets the target views and their input views:
    - neighbours: every inner frame is a target; its inputs are the nearest frames, alternately before and after
    - peers: the test frames and inputs of S-Ray; with --gsnerf-distance, the inputs that GSNeRF's code chooses
    - pairs: as neighbours, and each target a second time from further frames, to see which classes and depths change
    - aside: in scenes of semgs rooms --aside, views 20 and 40 cm and 15 and 30 degrees off the input views, with metrics of edges
    - lsm [FILE]: the test of LSM, Uni3R and C3G on ScanNet, from two views; see docs/reproduce.md
    - pinned FILE: the frames in frames.json or report.json of an earlier evaluation, or in an index of pixelSplat's form

    The output folder contains
    - report.html: start here: tables, confusion matrices, scores per class, best and worst frames
    - report.json: all numbers, with 95 % intervals; semgs compare makes tables from several
    - frames.json: the frames by name, for --protocol pinned; index.json: by position, as pixelSplat and its descendants list them
    - predictions/: the rendered maps, in the format of --predictions; truth/: the true labels at the same size

    Every table has simple baselines: the nearest input view copied with its true labels (an oracle), the input views warped with
    true depth, and the most frequent class.
    docs/evaluate.md defines every number. The folder appears only once it is complete.

    With --single, each labelled image is classified by itself, without cameras and rendering, so --data may also be labelled images
    (images/, labels/ and classes.json; see docs/train.md). The folder then contains report.json and predictions/.

    Examples
    - semgs evaluate small --data scenes --out eval/small
    - semgs evaluate runs/mine/weights.safetensors --data scenes --views 2 --out eval/mine
    - semgs evaluate small --data scannet --scenes scannet-sray-test --protocol peers --views 2 3 4 --out eval/peers
    - semgs evaluate small --segmenter segformer.onnx --data scenes --out eval/segformer
    - semgs evaluate --predictions theirs --data scenes --protocol pinned eval/small/frames.json --out eval/theirs
    - semgs evaluate small --single --data photos --out eval/photos
    """

    only_with: ClassVar = {"--single": ("--sides", "--flip"), "--protocol peers": ("--gsnerf-distance",)}
    excludes: ClassVar = {
        "--single": (
            "--predictions", "--protocol", "--views", "--depth-range", "--nearest", "--refine", "--exposure", "--workers", "--depth", "--merge",
            "--panoptic", "--free-space",
        ),
        "--predictions": (
            "--nearest", "--refine", "--exposure", "--depth-range", "--precision", "--allow-seen", "--free-space", "--protocol pairs",
            "--segmenter", "--depth", "--looks 2",
        ),
        "--workers": ("--segmenter", "--depth"),
        "--sides": ("--size",),
    }  # fmt: skip

    data: Annotated[Path, Words(metavar="DIR")]
    """A scene or a folder of scenes."""
    out: Annotated[Path, Words(metavar="DIR")]
    """Output folder: new, empty, or, with --overwrite, one from an earlier run."""
    weights: Annotated[Weights, positional("[WEIGHTS]")] = ""
    """"small" for the included weights, a weights file, or hf://OWNER/NAME on the hub."""
    scenes: Annotated[str, optional("LIST")] = ""
    """Only the scenes of a list: an included one (scannet-sray-test), or a text file with one name per line; see docs/reproduce.md."""
    predictions: Annotated[Path | None, optional("DIR")] = None
    """Score another method's label maps instead of WEIGHTS: DIR/N2/SCENE/STEM.png, class number per pixel, 255 = no prediction."""
    protocol: Protocol = ("neighbours",)
    """neighbours, peers, pairs, aside, lsm [FILE], or pinned FILE."""
    views: Annotated[SeveralViews, optional()] = ()
    """Numbers of input views. By default 2, 3 and 4, or those in the pinned file or the predictions."""
    size: AutoSize = None
    """Height x width for the comparison. By default 240x320, 320x240 for portrait scenes, or that of the pinned file."""
    depth_range: NearFar = None
    """Depth bounds for the network, in the scenes' unit. By default they come from the scene; 0.5 10 if it is metric. Other papers use
    0.1 10 for ScanNet and 0.1 6 for Replica."""
    gsnerf_distance: bool = False
    """With --protocol peers: rank input frames as GSNeRF's code does, by world-to-camera translations."""
    nearest: Annotated[Count | None, optional("INT")] = None
    """Render each target view with the Gaussians of only this many input views, those nearest to it. By default, with all."""
    refine: Annotated[Passes, optional()] = 0
    """Refine the Gaussians on the input views before rendering, with PASSES steps for each, by default 15. Tables then also have the scores
    before. See docs/refine.md."""
    exposure: Exposure = "as-taken"
    """Bring the input views to a common exposure, as for semgs reconstruct. Target views stay as taken; by default all views do, as in the paper."""
    looks: Looks = 1
    """How often the network looks at each view to classify it, as for semgs reconstruct; 1 is the paper's single pass."""
    merge: Annotated[str, optional("alike|coarse13|FILE")] = ""
    """Add metrics of groups of classes: alike (table, desk and counter; chair and sofa; curtains), coarse13 (13 groups of ScanNet's 20), or a JSON file; see
    docs/evaluate.md."""
    panoptic: Annotated[Literal["", "coco", "eps3d"], optional("coco|eps3d")] = ""
    """Also find things, as semgs export --as objects does, and score them against the true ones: panoptic quality by the rule of COCO or by that of EPS3D, and
    boxes. Needs scenes in metres with maps of instances."""
    free_space: bool = False
    """Also map free space, as semgs export --as occupancy does, and score it against the map by measured depth. Needs scenes in metres with depth."""
    single: bool = False
    """Score the classes of each image by itself."""
    sides: Annotated[SeveralCounts, optional()] = ()
    """With --single: score the images at these short sides in px, a row of the table each."""
    flip: bool = False
    """With --single: also score the mean of each image and its mirror image."""
    allow_seen: bool = False
    """Also score rooms that the weights were trained in, and say so; by default they are refused."""
    name: Annotated[str, optional()] = ""
    """Name in the tables; by default that of the network or of the predictions folder."""
    workers: Workers = 0
    """Worker processes, one thread each; 0 for none, using all threads."""
    device: Device = "auto"
    """Where to compute; auto uses a CUDA GPU if there is one."""
    precision: PrecisionOrAuto = "float32"
    """Precision of the network's layers; auto is as for semgs reconstruct, and then scores depend a little on the machine."""
    overwrite: bool = False
    """Replace an output folder from an earlier run, once the new result is complete."""
    depth: Annotated[str | None, optional("SOURCE")] = None
    """Add depth maps from elsewhere, aligned to the network's depth: a folder of depth maps, an exported network, a model folder of transformers, or
    hf:OWNER/NAME. With sensor, Gaussians are at the measured depth of the input views. Both as for semgs reconstruct."""
    depth_meaning: DepthMeaning = None
    """What the numbers of these maps are, as for semgs reconstruct."""
    segmenting: Annotated[SegmenterOptions, INLINE] = field(default_factory=SegmenterOptions)
    reading: Annotated[SceneOptions, INLINE] = field(default_factory=SceneOptions)

    def run(self) -> None:
        """Evaluate, write the folder, and print the table.

        Raises:
            InputError: data, weights, predictions or the output folder cannot be used.
            UsageError: an option is invalid.
        """
        self._check()
        if self.single:
            self._run_single()
            return
        with show_stage("Starting"):
            # Importing torch takes seconds; typing errors are reported before.
            from semgs.evaluation.run import Job, open_labelled_scenes, run_evaluation

            data = open_labelled_scenes(self.data, self.reading.as_peers, self.reading.asked, self.scenes)
        check_apart(self.out, (place for scene in data.scenes for place in scene.places))
        plan = self._plan(data.scenes)
        self._check_measured(plan)
        self._check_things(plan)
        with show_stage("Loading"):
            labelling = self.segmenting.labelling()
            device = chosen_device(self.device)
            precision = chosen_precision(self.precision, device)
            depth = self._depth_maps()
            candidate = self._candidate(plan, data.classes, device, labelling, depth, precision)
            remarks = (*self._remarks(plan, labelling, depth), *self._computed(precision))
            job = Job(data, plan, candidate, remarks, self.workers, self._groups(data.classes), self.panoptic or None)
        with what_fits(), show_progress(f"Evaluating {candidate.subject.name}", len(plan.tasks)) as done:
            summary = run_evaluation(self.out, job, overwrite=self.overwrite, done=done)
        print(summary)

    def _run_single(self) -> None:
        """Score single images, write the folder, and print the tables."""
        with show_stage("Starting"):
            from semgs.evaluation.run import open_labelled_scenes, open_network
            from semgs.evaluation.single_images import Trial, evaluate_single_images

            data = open_labelled_scenes(
                self.data, self.reading.as_peers, self.reading.asked, self.scenes, needs_cameras=False
            )
            if data.classes is None:
                raise InputError(self.data, "labelled images", "none with labels")
        check_apart(self.out, (place for scene in data.scenes for place in scene.places))
        with show_stage("Loading"), what_the_user_gave():
            remarks = self._seen(data.scenes)
            device = chosen_device(self.device)
            precision = chosen_precision(self.precision, device)
            network, subject = open_network(self.weights, data.classes, self.name, precision, self.looks)
            if network.classes is None:
                raise InputError(self.weights, "weights with classes", "weights for colour and depth only")
            network.to(device)
            remarks += self._computed(precision)
            labelling = self.segmenting.labelling()
            if labelling is not None:
                for scene in data.scenes:
                    self._check_table(labelling(scene).source.classes, network.classes)
                subject = self._segmenter(labelling(data.scenes[0]).source)
        trials = [
            Trial(side, flip) for side in self.sides or (None,) for flip in ((False, True) if self.flip else (False,))
        ]
        images = len(trials) * sum(frame.labels is not None for scene in data.scenes for frame in scene.frames)
        with show_progress(f"Evaluating {subject.name}", images) as done:
            tables = evaluate_single_images(
                self.out,
                network,
                subject,
                data.scenes,
                self.size,
                overwrite=self.overwrite,
                done=done,
                trials=trials,
                labelling=labelling,
            )
        print("\n\n".join((tables, *remarks)))

    def _check(self) -> None:
        """Check what can be checked without importing torch."""
        if bool(self.weights) == (self.predictions is not None):
            raise UsageError("expected either WEIGHTS or --predictions DIR; see semgs evaluate --help")
        existing_folder(self.data)
        if self.predictions is not None and not self.predictions.is_dir():
            raise InputError(self.predictions, "a folder of predictions", found_at(self.predictions))
        check_folder(
            self.out,
            "evaluate",
            self.overwrite,
            (
                self.data,
                *files_among(self.weights, self.scenes),
                self.predictions,
                *self.protocol[1:],
                self.depth,
                *self.segmenting.inputs,
                self.reading.images,
            ),
        )
        self.reading.check()
        self.segmenting.check(self.looks)
        if self.depth_meaning is not None and self.depth in (None, SENSOR):
            raise UsageError("--depth-meaning is for --depth SOURCE")

    def _plan(self, scenes: tuple[Scene, ...]) -> FramePlan:
        """The targets and their input views."""
        from semgs.evaluation.frames.saved import find_view_counts
        from semgs.evaluation.run import plan_targets

        held = find_view_counts(self.predictions) if self.predictions is not None else ()
        plan = plan_targets(self.protocol, scenes, self.views or held, self.size, self.gsnerf_distance)
        return replace(plan, depth_range=self.depth_range)

    def _candidate(
        self,
        plan: FramePlan,
        classes: ClassTable | None,
        device: str,
        labelling: Callable[[Scene], Labelling] | None,
        depth: Callable[[Scene], DepthMaps] | None,
        precision: Precision,
    ) -> Candidate:
        """The method to evaluate, and its description for the report."""
        from semgs.evaluation.frames.network_method import Handling
        from semgs.evaluation.run import load_candidate, open_predictions

        if self.predictions is not None:
            return open_predictions(self.predictions, plan, device, self.name)
        with what_the_user_gave():
            if labelling is not None:
                for scene in plan.scenes:
                    theirs = labelling(scene).source.classes
                    if classes is None or theirs.within(classes) is None:
                        self._check_table(theirs, classes)
            handling = Handling(
                labelling=labelling,
                passes=self._passes(),
                depth=depth,
                sensor=self.depth == SENSOR,
                exposure=self.exposure,
                things=bool(self.panoptic),
                free_space=self.free_space,
            )
            name = self._name(labelling is not None)
            return load_candidate(self.weights, classes, device, name, precision, self.looks, self.nearest, handling)

    def _groups(self, classes: ClassTable | None) -> ClassGroups | None:
        """The groups of classes; None without the option.

        Raises:
            InputError: they cannot be used, or no scene has labels.
        """
        if not self.merge:
            return None
        from semgs.data.tables.class_groups import class_groups

        if classes is None:
            raise InputError(self.data, "labelled scenes for --merge", "none with labels")
        return class_groups(self.merge, classes.names)

    def _check_measured(self, plan: FramePlan) -> None:
        """Refuse input views without depth if the Gaussians are to be at it.

        Raises:
            InputError: a frame has none.
        """
        for task in plan.tasks if self.depth == SENSOR else ():
            for frame in (task.scene.frames[place] for place in task.sample.contexts):
                if frame.depth is None:
                    wanted = "measured depth of each input view for --depth sensor"
                    raise InputError(task.scene.path, wanted, "none", frame.name)

    def _check_things(self, plan: FramePlan) -> None:
        """Refuse scenes whose things cannot be scored.

        Raises:
            InputError: no target has a map of instances, no scene has depth, or a scene is not in metres.
        """
        needs = "--panoptic" if self.panoptic else "--free-space"
        if not (self.panoptic or self.free_space):
            return
        if self.free_space and all(frame.depth is None for scene in plan.scenes for frame in scene.frames):
            raise InputError(self.data, "scenes with depth for --free-space", "none")
        if self.panoptic and all(task.scene.frames[task.sample.target].instances is None for task in plan.tasks):
            raise InputError(self.data, "scenes with maps of instances for --panoptic", "none")
        for scene in plan.scenes if self.weights else ():
            if scene.unit != "metric":
                raise InputError(
                    scene.path,
                    f"lengths in metres for {needs}",
                    "an unknown unit",
                    advice="if they are metres, use --unit metric",
                )
        if self.weights and self.panoptic:
            from semgs.robotics.object_libraries import check_object_libraries

            check_object_libraries()

    def _depth_maps(self) -> Callable[[Scene], DepthMaps] | None:
        """The source of depth maps; None without one."""
        if self.depth in (None, SENSOR):
            return None
        from semgs.depth_maps.opening import open_depth_maps

        assert self.depth is not None
        return open_depth_maps(self.depth, self.depth_meaning)

    def _passes(self) -> int:
        """How often to pass over the input views; 0 for never."""
        from semgs.scene.photo_refinement import PASSES

        return PASSES if self.refine < 0 else self.refine

    def _name(self, segmented: bool) -> str:
        """The name in tables; "" for that of the network."""
        depth = [] if self.depth is None else ["sensor depth" if self.depth == SENSOR else "depth maps"]
        choices = ["segmenter"] * segmented + depth + ["refined"] * bool(self.refine)
        choices += [] if self.exposure == "as-taken" else [f"exposure {self.exposure}"]
        choices += [] if self.nearest is None else [f"nearest {self.nearest}"]
        return self.name or (" + ".join([Path(self.weights).stem, *choices]) if choices else "")

    def _segmenter(self, source: ClassSource) -> EvaluatedMethod:
        """A segmenter that classifies images by itself."""
        from semgs.evaluation.tables.evaluation_report import EvaluatedMethod

        made_by = source.made_by
        name = self.name or Path(self.segmenting.segmenter or "").stem
        return EvaluatedMethod(name, "segmenter", source.title, None if made_by is None else made_by.digest)

    def _check_table(self, theirs: ClassTable, classes: ClassTable | None) -> None:
        """Check that a segmenter answers in the classes of the labels."""
        if classes is not None and theirs != classes:
            assert self.segmenting.segmenter is not None
            raise InputError(
                self.segmenting.segmenter, f"answers in the classes of the labels, {classes.name}", theirs.name
            )

    def _remarks(
        self,
        plan: FramePlan,
        labelling: Callable[[Scene], Labelling] | None,
        depth: Callable[[Scene], DepthMaps] | None,
    ) -> tuple[str, ...]:
        """Remarks for the report: who gives classes and depth, and whether the weights were trained on rooms that are scored here.

        Such rooms are refused without --allow-seen.
        """
        said: tuple[str, ...] = ()
        if labelling is not None:
            first = labelling(plan.scenes[0])
            said = (f"The classes are from {first.description}.", *first.notes)
        if depth is not None:
            said += (f"The depth is from the network and {depth(plan.scenes[0]).title}.",)
        if self.depth == SENSOR:
            said += ("The depth of the input views is measured.",)
        if self.depth == OWN:
            said += ("The same maps are the truth of the depth error.",)
        if self.exposure != "as-taken":
            where = "that clearly differ in exposure " if self.exposure == "auto" else ""
            said += (f"Input views {where}came to a common exposure; target views are as taken.",)
        return (*said, *self._seen(plan.scenes)) if self.weights else said

    def _computed(self, precision: Precision) -> tuple[str, ...]:
        """Remarks if the layers did not compute in float32, or the network looked twice at each view."""
        computed = (f"The layers computed in {precision}.",) if self.weights and precision != "float32" else ()
        return computed if self.looks == 1 else (*computed, TWO_LOOKS)

    def _seen(self, scenes: Sequence[Scene]) -> tuple[str, ...]:
        """A remark if the weights were trained on rooms that are scored here; such rooms are refused without --allow-seen."""
        from semgs.data.scene_lists import check_unseen, seen_before
        from semgs.model.weights.load import trained_scenes

        trained, tested = trained_scenes(self.weights), [scene.name for scene in scenes]
        if not self.allow_seen:
            check_unseen(self.weights, trained, tested, "evaluate on other rooms (--scenes), or use --allow-seen")
            return ()
        seen = sorted(seen_before(trained, tested))
        return (f"The weights were trained on rooms that are scored here: {', '.join(seen)}.",) if seen else ()

"""Runs an evaluation: from scenes, a protocol and a method to a folder with scores, maps and a report."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from semgs.data.scene import Scene
from semgs.data.scene_details import SceneDetails
from semgs.data.scene_lists import read_list
from semgs.data.scenes import open_scenes
from semgs.data.tables.class_groups import ClassGroups
from semgs.data.tables.classes import ClassTable
from semgs.evaluation.frames.frame_plan import FramePlan, frame_list, index_of, make_plan, read_plan
from semgs.evaluation.frames.network_method import AS_THEY_ARE, Handling, NetworkMethod
from semgs.evaluation.frames.predictions import Method
from semgs.evaluation.frames.protocols import LSM_SIZE, LSM_VIEWS, aside, lsm, neighbours, pairs, peers, read_lsm_list
from semgs.evaluation.frames.saved import TIMING, SavedPredictions
from semgs.evaluation.page.evaluation_page import evaluation_page
from semgs.evaluation.scoring.method_scores import PREDICTIONS, score_method
from semgs.evaluation.scoring.panoptic import Rule
from semgs.evaluation.tables.comparison_tables import kinds_grid, overview_grid, things_grid
from semgs.evaluation.tables.environment import hardware, versions
from semgs.evaluation.tables.evaluation_report import EvaluatedMethod, Evaluation, evaluation_numbers, timing
from semgs.evaluation.tables.saved_report import SavedReport, saved_report
from semgs.evaluation.tables.table_grid import printed
from semgs.evaluation.tables.table_notes import notes
from semgs.files.atomic import write_json, write_text
from semgs.files.contents import sha256
from semgs.files.errors import InputError
from semgs.files.folders import own_folder
from semgs.model.semgs import SemGS
from semgs.model.weights.load import find, load, table_of
from semgs.runtime.precision import Precision
from semgs.scene.overlap import NearestViews

VIEWS = (2, 3, 4)
"""The default numbers of contexts: the paper's."""

ASIDE_VIEWS = PAIRS_VIEWS = (2,)
"""Those of scenes drawn for targets aside, and of pairs."""


@dataclass(frozen=True, eq=False)
class LabelledScenes:
    """Scenes to evaluate on.

    Attributes:
        path: where they were found.
        scenes: all scenes found there.
        classes: the class table of their labels; None if no scene has labels.
    """

    path: Path
    scenes: tuple[Scene, ...]
    classes: ClassTable | None


@dataclass(frozen=True, eq=False)
class Candidate:
    """A method to evaluate.

    Attributes:
        method: makes the predictions.
        subject: its description in the report.
        device: where it computes.
    """

    method: Method
    subject: EvaluatedMethod
    device: str = "cpu"


@dataclass(frozen=True, eq=False)
class Job:
    """An evaluation to run.

    Attributes:
        data: the scenes.
        plan: the targets.
        candidate: the method.
        remarks: further notes for the report, a sentence each.
        workers: parallel processes, each with one thread; 0 uses this process with all its threads.
        groups: of classes, of which metrics are added; None for none.
        panoptic: the rule of panoptic quality; None for none.
    """

    data: LabelledScenes
    plan: FramePlan
    candidate: Candidate
    remarks: tuple[str, ...] = ()
    workers: int = 0
    groups: ClassGroups | None = None
    panoptic: Rule | None = None


def open_labelled_scenes(
    path: Path,
    as_peers: Collection[str] = (),
    asked: SceneDetails | None = None,
    wanted: str = "",
    *,
    needs_labels: bool = False,
    needs_cameras: bool = True,
) -> LabelledScenes:
    """Open the scenes at a path, or those of a list.

    Args:
        path: a scene or a folder of scenes.
        as_peers, asked: as for `semgs.data.scenes.open_scenes`.
        wanted: a list of scenes, as for `semgs.data.scene_lists.read_list`; "" for all.
        needs_labels: refuse scenes of which none has labels.
        needs_cameras: as for `semgs.data.scenes.open_scenes`.

    Raises:
        InputError: there are none, one of the list is missing, none has labels, or their labels have different class tables.
    """
    scenes = open_scenes(path, as_peers, asked, read_list(wanted) if wanted else None, needs_cameras)
    labelled = [scene for scene in scenes if scene.classes is not None]
    if needs_labels and not labelled:
        raise InputError(path, "labelled scenes", "none with labels")
    for scene in labelled[1:]:
        if scene.classes != labelled[0].classes:
            tables = [one.classes.name for one in (labelled[0], scene) if one.classes is not None]
            raise InputError(
                scene.path,
                f"labels of table {tables[0]}, as in {labelled[0].name}",
                tables[1],
                advice="evaluate scenes with different tables separately",
            )
    return LabelledScenes(path, scenes, labelled[0].classes if labelled else None)


def plan_targets(
    protocol: tuple[str, ...],
    scenes: tuple[Scene, ...],
    views: tuple[int, ...] = (),
    size: tuple[int, int] | None = None,
    gsnerf_distance: bool = False,
) -> FramePlan:
    """The plan of a protocol.

    Args:
        protocol: ("neighbours",), ("pairs",), ("peers",), ("aside",), ("lsm",), ("lsm", FILE), or ("pinned", FILE).
        scenes: to evaluate on.
        views: numbers of contexts; empty for the default, or those of the pinned file.
        size: (height, width) of all scenes [px]; None for the default, or that of the pinned file.
        gsnerf_distance: for peers, rank contexts by GSNeRF's distance.

    Raises:
        InputError: a scene has too few frames, or the pinned file cannot be used.
    """
    if protocol[0] == "pinned":
        return read_plan(protocol[1], scenes, views, size)
    if protocol[0] == "lsm":
        listed = read_lsm_list(protocol[1], [scene.name for scene in scenes]) if protocol[1:] else None
        named = scenes if listed is None else [scene for scene in scenes if scene.name in listed]
        return make_plan("lsm", partial(lsm, listed=listed), named, views or (LSM_VIEWS,), size or LSM_SIZE, "crop")
    if protocol[0] == "pairs":
        return make_plan("pairs", pairs, scenes, views or PAIRS_VIEWS, size)
    if protocol[0] == "neighbours":
        return make_plan("neighbours", neighbours, scenes, views or VIEWS, size)
    if protocol[0] == "aside":
        return make_plan("aside", aside, scenes, views or ASIDE_VIEWS, size)
    if gsnerf_distance:
        as_gsnerf = partial(peers, distance="gsnerf")
        return make_plan("peers, GSNeRF's distance", as_gsnerf, scenes, views or VIEWS, size)
    return make_plan("peers", peers, scenes, views or VIEWS, size)


def load_candidate(
    weights: str | Path,
    classes: ClassTable | None,
    device: str,
    name: str = "",
    precision: Precision = "float32",
    looks: int = 1,
    nearest: int | None = None,
    handling: Handling = AS_THEY_ARE,
) -> Candidate:
    """Weights to evaluate.

    Args:
        weights: a file, or the name of included weights.
        classes: the class table of the truth; None for that of the weights.
        device: to encode on.
        name: in tables; by default that of the network.
        precision: of the network's layers.
        looks: how often it looks at each view for its classes (`SemGS.looks`).
        nearest: render each target with the Gaussians of only so many input views, the nearest; None for all.
        handling: what else is done with the Gaussians. With a `labelling`, the network needs no classes.

    Raises:
        ValueError: there are no included weights of that name, or `nearest` is not positive.
        InputError: the file cannot be used, or has another class table.
    """
    own = None if handling.labelling else classes
    model, subject = open_network(weights, own, name, precision, looks, coarser=True)
    chosen = None if nearest is None else NearestViews(nearest, model.placer.shrink_seen)
    method = NetworkMethod(model, device, subject.name, replace(handling, nearest=chosen, classes=classes))
    return Candidate(method, subject, device)


def open_network(
    weights: str | Path,
    classes: ClassTable | None,
    name: str = "",
    precision: Precision = "float32",
    looks: int = 1,
    *,
    coarser: bool = False,
) -> tuple[SemGS, EvaluatedMethod]:
    """A network in evaluation mode, and its description; other arguments and errors as for `load_candidate`.

    Args:
        coarser: also accept a table that the network's classes are within (`ClassTable.within`); the network then keeps its own.
    """
    network, path = find(weights)
    own = table_of(path)
    groups = coarser and own is not None and classes not in (None, own) and own.within(classes) is not None
    model = load(network, path, classes=own if groups else classes or own)
    model.precision, model.looks = precision, looks
    parameters = sum(parameter.numel() for parameter in model.parameters())
    origin = model.origin
    if groups and own is not None and classes is not None:
        origin += f"; its classes, {own.name}, count as those of {classes.name}"
    return model.eval(), EvaluatedMethod(name or model.name, "weights", origin, sha256(path), parameters)


def open_predictions(folder: Path, plan: FramePlan, device: str, name: str = "") -> Candidate:
    """Saved predictions to evaluate.

    Args:
        folder: of the predictions.
        plan: the targets; the predictions must be complete for them.
        device: named in the report.
        name: in tables; by default that of the folder.

    Raises:
        InputError: they are incomplete, or have another size.
    """
    saved = SavedPredictions(folder, name or folder.absolute().name)
    saved.check(plan)
    return Candidate(saved, EvaluatedMethod(saved.name, "predictions", str(folder)), device)


def run_evaluation(
    out: Path, job: Job, *, overwrite: bool = False, done: Callable[[int], object] = lambda count: None
) -> str:
    """Run an evaluation and write its folder, which appears only once it is complete.

    Args:
        out: the output folder.
        job: the evaluation.
        overwrite: replace the folder if an earlier evaluation wrote it.
        done: called after each target with the number of finished targets.

    Returns:
        The summary to print.

    Raises:
        InputError: a frame, a prediction or the folder cannot be used.
        NotEnoughMemoryError: the network needs more memory than there is.
        OSError: the disk is full.
    """
    subject = job.candidate.subject
    with own_folder(out, "evaluate", overwrite) as folder:
        rows = score_method(
            job.plan,
            job.candidate.method,
            folder,
            save=subject.kind == "weights",
            workers=job.workers,
            done=done,
            panoptic=job.panoptic,
        )
        if job.groups is not None:
            rows = [row.by_groups(job.groups) for row in rows]
        evaluation = Evaluation(
            subject=subject,
            data=str(job.data.path),
            plan=job.plan,
            rows=tuple(rows),
            classes=job.data.classes,
            versions=versions(),
            hardware=hardware(job.candidate.device),
            notes=(*job.remarks, *notes(job.plan, job.data.scenes, rows, job.workers)),
            groups=job.groups,
        )
        return _summary(write_evaluation(folder, evaluation), evaluation, out)


def write_evaluation(folder: Path, evaluation: Evaluation) -> SavedReport:
    """Write the report and the list of frames into a folder that already contains the maps.

    Returns:
        The report as `read_report` would read it.

    Raises:
        OSError: a file cannot be written.
    """
    numbers = evaluation_numbers(evaluation)
    write_json(folder / "frames.json", frame_list(evaluation.plan))
    write_json(folder / "index.json", index_of(evaluation.plan))
    write_json(folder / "report.json", numbers)
    if evaluation.subject.kind == "weights":
        for rows in evaluation.rows:
            times = timing(rows.method)
            kept = {name: times[name] for name in ("seconds_encode", "seconds_render")}
            write_json(folder / PREDICTIONS / f"N{rows.views}" / TIMING, kept)
    report = saved_report(folder / "report.json", numbers)
    write_text(folder / "report.html", evaluation_page(evaluation, report))
    return report


def _summary(report: SavedReport, evaluation: Evaluation, out: Path) -> str:
    """The printed summary: the table, the notes and the path of the report."""
    return "\n".join(
        [
            printed(overview_grid(report), "text"),
            "",
            *(
                line
                for grid in (kinds_grid(report), things_grid(report))
                if grid is not None
                for line in (printed(grid, "text"), "")
            ),
            *(f"note  {sentence}" for sentence in evaluation.notes),
            *([""] if evaluation.notes else []),
            f"Open {out / 'report.html'} in a browser.",
        ]
    )

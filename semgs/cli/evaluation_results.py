"""The results of `semgs evaluate`: the files in its folder, and the table that the user reads at the end."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from semgs.cli.errors import what_fits
from semgs.cli.progress import show_progress, show_stage
from semgs.data.classes import ClassTable
from semgs.data.scene import Scene
from semgs.data.scene_lists import check_unseen, seen_before
from semgs.evaluation.frames.network import NetworkMethod
from semgs.evaluation.frames.plan import Plan, frame_list
from semgs.evaluation.frames.predictions import Method
from semgs.evaluation.frames.saved import TIMING
from semgs.evaluation.page.report_page import report_page
from semgs.evaluation.scoring.evaluate import PREDICTIONS, evaluate
from semgs.evaluation.tables.compare import BRIEF, overview_grid
from semgs.evaluation.tables.environment import hardware, versions
from semgs.evaluation.tables.grid import printed
from semgs.evaluation.tables.notes import notes
from semgs.evaluation.tables.report import Evaluation, SavedReport, Subject, report_numbers, saved_report, timing
from semgs.files.atomic import write_json, write_text
from semgs.files.folders import own_folder
from semgs.files.hashes import sha256
from semgs.weights.load import find, load, table_of, trained_scenes


def evaluate_into(
    out: Path,
    plan: Plan,
    method: Method,
    subject: Subject,
    data: Path,
    scenes: Sequence[Scene],
    classes: ClassTable | None,
    *,
    device: str,
    predictions: Path | None = None,
    workers: int = 0,
    overwrite: bool = False,
    remarks: Sequence[str] = (),
) -> str:
    """Score a method on every target of a plan and write the folder of an evaluation, which appears whole or not at all.

    Args:
        out: the folder.
        plan: what to compare.
        method: what to evaluate.
        subject: what the report says of it.
        data: where the scenes were found.
        scenes: all that were found there.
        classes: the table of their labels, None where none has any.
        device: that the method computes on.
        predictions: where its maps are, if they are somebody else's; None writes them.
        workers: processes side by side, each on one thread; 0 uses this one with all its threads.
        overwrite: replace the folder if an earlier evaluation wrote it.
        remarks: what else the report should say, a sentence each.

    Returns:
        What the user reads at the end.

    Raises:
        InputError: a frame, a prediction or the folder cannot be used.
        UsageError: the network needs more memory than there is.
        OSError: the disk is full.
    """
    with own_folder(out, overwrite) as folder:
        with what_fits(), show_progress(f"Evaluating {subject.name}", len(plan.tasks)) as done:
            rows = evaluate(plan, method, folder, save=predictions is None, workers=workers, done=done)
        evaluation = Evaluation(
            subject=subject,
            data=str(data),
            plan=plan,
            rows=tuple(rows),
            classes=classes,
            versions=versions(),
            hardware=hardware(device),
            notes=(*remarks, *notes(plan, scenes, rows, workers)),
        )
        with show_stage("Writing the report"):
            report = write_results(folder, evaluation, predictions)
            return summary(report, evaluation, out)


def network_method(
    weights: str | Path, classes: ClassTable | None, device: str, name: str = ""
) -> tuple[NetworkMethod, Subject]:
    """Weights as a method to evaluate, and what the report says of them.

    Args:
        weights: a file, or the name of those inside the package.
        classes: the table of the truth; None takes that of the weights.
        device: to encode on.
        name: in tables; by default that of the network.

    Raises:
        ValueError: no weights of that name ship.
        InputError: the file cannot be used, or is made for another table.
    """
    network, path = find(weights)
    model = load(network, path, classes=classes or table_of(path))
    parameters = sum(parameter.numel() for parameter in model.parameters())
    subject = Subject(name or model.name, "weights", model.origin, sha256(path), parameters)
    return NetworkMethod(model.eval(), device, subject.name), subject


def remarks_on_seen_rooms(weights: str | Path, plan: Plan, allowed: bool = False) -> list[str]:
    """What to say of rooms that the weights were trained on: nothing, where there are none.

    Args:
        weights: a file, or the name of those inside the package.
        plan: what is evaluated.
        allowed: say it in a sentence instead of refusing.

    Raises:
        InputError: there are some, and they are not allowed; or the header of the weights is broken.
    """
    trained, tested = trained_scenes(weights), [scene.name for scene in plan.scenes]
    if allowed:
        seen = sorted(seen_before(trained, tested))
        return [f"The weights were trained in rooms that are scored here: {', '.join(seen)}."] if seen else []
    check_unseen(weights, trained, tested, "evaluate on other rooms (--scenes), or say --allow-seen")
    return []


def write_results(folder: Path, evaluation: Evaluation, predictions: Path | None) -> SavedReport:
    """Write the report and the list of frames into an existing folder that holds the maps.

    Args:
        folder: of the evaluation.
        evaluation: that is done.
        predictions: where they are, if they are somebody else's.

    Returns:
        What `read_report` finds in the folder.

    Raises:
        OSError: a file cannot be written.
    """
    numbers = report_numbers(evaluation)
    write_json(folder / "frames.json", frame_list(evaluation.plan))
    write_json(folder / "report.json", numbers)
    if predictions is None:
        for rows in evaluation.rows:
            times = timing(rows.method)
            kept = {name: times[name] for name in ("seconds_encode", "seconds_render")}
            write_json(folder / PREDICTIONS / f"N{rows.views}" / TIMING, kept)
    report = saved_report(folder / "report.json", numbers)
    write_text(folder / "report.html", report_page(evaluation, report))
    return report


def summary(report: SavedReport, evaluation: Evaluation, out: Path) -> str:
    """What the user reads at the end: the table, what it must not be read without, and where everything is."""
    return "\n".join(
        [
            printed(overview_grid(report, BRIEF), "text"),
            "",
            *(f"note  {sentence}" for sentence in evaluation.notes),
            *([""] if evaluation.notes else []),
            f"Open {out / 'report.html'} in a browser.",
        ]
    )

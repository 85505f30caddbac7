"""The results of `semgs evaluate`: the files in its folder, and the table that the user reads at the end."""

from __future__ import annotations

from pathlib import Path

from semgs.evaluation.compare import BRIEF, overview_grid
from semgs.evaluation.evaluate import PREDICTIONS
from semgs.evaluation.plan import frame_list
from semgs.evaluation.report import Evaluation, read_report, report_numbers, timing
from semgs.evaluation.report_page import report_page
from semgs.evaluation.saved import TIMING, SavedPredictions
from semgs.evaluation.tables import printed
from semgs.files.atomic import write_json, write_text


def write_results(folder: Path, evaluation: Evaluation, predictions: Path | None) -> None:
    """Write the report and the list of frames into an existing folder that holds the maps.

    Args:
        folder: of the evaluation.
        evaluation: that is done.
        predictions: where they are, if they are somebody else's.

    Raises:
        OSError: a file cannot be written.
    """
    write_json(folder / "frames.json", frame_list(evaluation.plan))
    write_json(folder / "report.json", report_numbers(evaluation))
    if predictions is None:
        for rows in evaluation.rows:
            times = timing(rows.method)
            kept = {name: times[name] for name in ("seconds_encode", "seconds_render")}
            write_json(folder / PREDICTIONS / f"N{rows.views}" / TIMING, kept)
    saved = SavedPredictions(predictions or folder / PREDICTIONS, evaluation.subject.name)
    write_text(folder / "report.html", report_page(evaluation, read_report(folder), saved))


def summary(folder: Path, evaluation: Evaluation, out: Path) -> str:
    """What the user reads at the end: the table, what it must not be read without, and where everything is."""
    return "\n".join(
        [
            printed(overview_grid(read_report(folder), BRIEF), "text"),
            "",
            *(f"note  {sentence}" for sentence in evaluation.notes),
            *([""] if evaluation.notes else []),
            f"Open {out / 'report.html'} in a browser.",
        ]
    )

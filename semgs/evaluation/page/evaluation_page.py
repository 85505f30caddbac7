"""The HTML report of an evaluation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from semgs.data.tables.classes import ClassTable
from semgs.data.views import INDOOR_DEPTH_RANGE
from semgs.evaluation.frames.frame_plan import Task
from semgs.evaluation.frames.predictions import Prediction
from semgs.evaluation.frames.reading import read_frame
from semgs.evaluation.scoring.baselines import NAMES
from semgs.evaluation.scoring.frame_scores import FrameScores
from semgs.evaluation.scoring.method_scores import SHOWN, MethodScores
from semgs.evaluation.scoring.summary import METRICS, find_extremes, sum_confusions, summarise
from semgs.evaluation.tables.card import risk_curve
from semgs.evaluation.tables.comparison_tables import MARKED, ROWS, kinds_grid, overview_grid, things_grid
from semgs.evaluation.tables.evaluation_report import Evaluation
from semgs.evaluation.tables.saved_report import SavedReport, SavedResult, data_name
from semgs.figures import html_page as page
from semgs.figures.class_images import legend_of
from semgs.figures.plotting import can_plot, risk_coverage_picture
from semgs.figures.view_images import (
    WORST_ERROR,
    class_map,
    depth_error_bar,
    depth_error_picture,
    depth_map,
    photo,
    please_note,
    true_class_map,
)
from semgs.files.images.colours import depth_limits
from semgs.files.text import listed, percent
from semgs.objectives.measures import TITLES, shown_number

PER_SCENE = ("miou", "miou_per_image", "accuracy", "class_accuracy", "psnr", "ssim", "depth_abs_rel", "depth_delta_125")


RESULTS = (
    "mIoU and class accuracy come from one confusion matrix over all targets; “/image” scores are means over images, then over scenes. "
    "The oracle copies the nearest input view, with its image and true labels, as if the camera had not moved. "
    + MARKED
)
"""How to read the tables."""

FILES = (
    page.Link("report.json", "all numbers of this page, for semgs compare"),
    page.Link("frames.json", "the frames; use --protocol pinned frames.json to evaluate another method on them"),
)
"""Files of every evaluation."""

MAPS = (
    page.Link("predictions/", "class maps, by number of views and scene"),
    page.Link("truth/", "the true class maps"),
)
"""Further files of an evaluation of weights."""


def evaluation_page(evaluation: Evaluation, report: SavedReport) -> str:
    """The report as one self-contained HTML page.

    Args:
        evaluation: the finished evaluation.
        report: its numbers.

    Raises:
        InputError: a frame cannot be read again.
    """
    scenes = evaluation.plan.scenes
    targets = len(next(iter(report.results.values())).frames)
    sections = [
        *please_note(evaluation.notes),
        page.Section("Results", RESULTS, (_overview(report),)),
        *(
            page.Section(
                grid.title,
                " ".join(grid.notes),
                (page.Table(grid.head, tuple(tuple(cell.text for cell in row) for row in grid.rows)),),
            )
            for grid in (kinds_grid(report), things_grid(report))
            if grid is not None
        ),
    ]
    for rows in evaluation.rows:
        sections += _sections_of(rows, report.results[rows.views], evaluation)
    sections += [
        page.Section("Files", "", (page.Links(FILES + (MAPS if evaluation.subject.kind == "weights" else ())),)),
        page.Section("Details", "", (_facts(evaluation, report),), folded=True),
    ]
    return page.html_page(
        title=f"{evaluation.subject.name} on {data_name(evaluation.data, [scene.name for scene in scenes])}",
        lead=f"{targets} targets of {len(scenes)} scene{'s' * (len(scenes) > 1)}, protocol {evaluation.plan.title}, "
        f"from {' and '.join(map(str, report.results))} input views.",
        headlines=_headlines(report),
        sections=sections,
        foot=f"Made by semgs {evaluation.versions['semgs']}.",
    )


def _headlines(report: SavedReport) -> list[page.Headline]:
    """The most important numbers."""
    found = []
    for metric in ("miou", "psnr"):
        for views, result in report.results.items():
            value, copy = result.numbers[metric], result.baselines.get("copy", {}).get(metric)
            if value is not None:
                beside = "" if copy is None else f" (oracle: {shown_number(metric, copy)})"
                unit = " dB" if metric == "psnr" else ""
                found.append(
                    page.Headline(shown_number(metric, value) + unit, f"{TITLES[metric]} from {views} views{beside}")
                )
    return found


def _overview(report: SavedReport) -> page.Table:
    """The table that the terminal also prints."""
    grid = overview_grid(report)
    rows = [
        tuple(cell.text.replace("  ", "– ") + (grid.mark if cell.marked else "") for cell in row) for row in grid.rows
    ]
    return page.Table(grid.head, tuple(rows))


def _facts(evaluation: Evaluation, report: SavedReport) -> page.Facts:
    """The method, the data, the baselines and the machine."""
    subject, hardware = evaluation.subject, evaluation.hardware
    sizes = sorted({f"{height}x{width}" for height, width in report.sizes.values()})
    rows = [
        ("Method" if subject.kind == "weights" else "Predictions", f"{subject.name}: {subject.source}"),
        *([("SHA-256 of the weights", subject.sha256)] if subject.sha256 else []),
        ("Data", f"{evaluation.data}: {listed([scene.name for scene in evaluation.plan.scenes], 12)}"),
        ("Protocol", evaluation.plan.title),
        ("Size", f"{listed(sizes, 12)} (height x width)"),
        *(
            [("Class table", f"{evaluation.classes.name}, {len(evaluation.classes)} classes")]
            if evaluation.classes
            else []
        ),
        (
            "Baselines",
            "; ".join(text for name, text in NAMES.items() if any(name in one.baselines for one in evaluation.rows)),
        ),
    ]
    for views, result in report.results.items():
        numbers = result.numbers
        if numbers["seconds_encode"] is not None and numbers["seconds_render"] is not None:
            rows.append(
                (
                    f"Time, {views} views",
                    f"{numbers['seconds_encode']:.3f} s to encode, {numbers['seconds_render']:.3f} s to render a target (medians): "
                    f"{numbers['fps_encoding_each']:.2f} FPS if each target is encoded anew, "
                    f"{numbers['fps_encoding_shared']:.2f} FPS if all targets are rendered from one encoding",
                )
            )
    rows += [
        ("Hardware", ", ".join(f"{name}: {value}" for name, value in hardware.items())),
        ("Versions", ", ".join(f"{name} {value}" for name, value in evaluation.versions.items())),
    ]
    return page.Facts(tuple(rows))


def _sections_of(rows: MethodScores, result: SavedResult, evaluation: Evaluation) -> list[page.Section]:
    """The sections for one number of views."""
    views, numbers, classes = rows.views, result.numbers, evaluation.classes
    blocks: list[page.Block] = [_metrics(result, evaluation.subject.name)]
    if len(numbers["per_scene"]) > 1:
        blocks.append(_scene_table(numbers))
    sections = [
        page.Section(
            f"From {views} views", f"Intervals: 95 %, bootstrap over {numbers['intervals_over']}.", tuple(blocks)
        )
    ]
    if classes is not None and numbers["miou"] is not None:
        sections.append(
            page.Section(
                f"Classes from {views} views",
                "Bars: IoU of each class that occurs in the ground truth; the tick is the IoU of the oracle. "
                "Matrix: for the pixels of each true class (row), the percentage predicted as each class (column).",
                (_bars(result, classes), _matrix(result, classes)),
            )
        )
    if numbers["risk_coverage"]:
        curve = risk_curve(evaluation.subject.name, numbers)
        plot: tuple[page.Plot, ...] = ()
        if can_plot():
            picture = page.Picture(risk_coverage_picture([curve]), "wrong classes among the most confident pixels")
            plot = (page.Plot(picture),)
        sections.append(
            page.Section(
                f"Confidence from {views} views",
                "If only the most confident pixels keep their class, fewer are wrong: --min-confidence sets the threshold. AURC: mean of this curve. ECE: "
                "mean |confidence − accuracy| in 15 bins with the same number of pixels. Labelled and seen pixels; bands are 95 % intervals.",
                (*plot, _risk_table(numbers)),
                folded=True,
            )
        )
    galleries = _galleries(rows, result, evaluation)
    if galleries:
        sections.append(
            page.Section(f"Best and worst frames from {views} views", "", galleries, folded=len(evaluation.rows) > 1)
        )
    return sections


def _metrics(result: SavedResult, name: str) -> page.Table:
    """Every metric with its interval, next to the baselines."""
    numbers = result.numbers
    rows = []
    for metric in METRICS:
        columns = [numbers.get(metric), *[row.get(metric) for row in result.baselines.values()]]
        if all(value is None for value in columns) or (metric == "not_given" and not numbers[metric]):
            continue
        ends = numbers["intervals"].get(metric)
        known = ends is not None and None not in ends
        interval = f"{shown_number(metric, ends[0])} to {shown_number(metric, ends[1])}" if known else "–"
        mark = "†" if metric in numbers["below_copy"] else ""
        texts = [shown_number(metric, value) for value in columns]
        rows.append((TITLES[metric], texts[0] + mark, interval, *texts[1:]))
    return page.Table(("metric", name, "95 % interval", *[ROWS[row] for row in result.baselines]), tuple(rows))


def _risk_table(numbers: Mapping[str, Any]) -> page.Table:
    """Some points of the risk-coverage curve, with the threshold that gives each."""
    rows = [
        (percent(point["coverage"]), f"{point['confidence']:.2f}", percent(point["risk"]))
        for point in numbers["risk_coverage"]
        if round(20 * point["coverage"]) % 2 == 0
    ]
    return page.Table(("pixels that keep their class", "--min-confidence", "of these wrong"), tuple(rows))


def _scene_table(numbers: Mapping[str, Any]) -> page.Table:
    """The metrics of each scene."""
    shown = [metric for metric in PER_SCENE if any(scene[metric] is not None for scene in numbers["per_scene"])]
    rows = [
        (scene["scene"], str(scene["samples"]), *[shown_number(metric, scene[metric]) for metric in shown])
        for scene in numbers["per_scene"]
    ]
    return page.Table(("scene", "targets", *[TITLES[metric] for metric in shown]), tuple(rows))


def _bars(result: SavedResult, classes: ClassTable) -> page.Bars:
    """The IoU of each class in the ground truth, the best first."""
    copy = result.baselines.get("copy", {}).get("per_class_iou", {})
    present = [(entry["iou"], label) for label, entry in enumerate(result.numbers["per_class"]) if entry["pixels"]]
    total = sum(entry["pixels"] for entry in result.numbers["per_class"])
    bars: dict[bool, list[page.Bar]] = {False: [], True: []}
    for iou, label in sorted(present, key=lambda pair: -pair[0]):
        name, share = classes.names[label], result.numbers["per_class"][label]["pixels"] / total
        text = f"{shown_number('miou', iou)}, {percent(share)} of the pixels"
        bars[share < page.RARE].append(page.Bar(name, classes.colours[label], iou, text, copy.get(name)))
    return page.Bars(tuple(bars[False]), tuple(bars[True]))


def _matrix(result: SavedResult, classes: ClassTable) -> page.Matrix:
    """The confusion matrix; each row sums to 1. Classes that are neither true nor predicted are left out."""
    confusion, truth = sum_confusions(result.frames)
    rows = np.flatnonzero(truth)
    columns = np.flatnonzero((truth > 0) | (confusion.sum(0) > 0))
    shares = confusion / np.maximum(confusion.sum(1, keepdims=True), 1)
    return page.Matrix(
        rows=tuple(classes.names[label] for label in rows),
        columns=tuple(classes.names[label] for label in columns),
        shares=tuple(tuple(shares[row, columns].tolist()) for row in rows),
        corner="true \\ predicted",
    )


def _galleries(rows: MethodScores, result: SavedResult, evaluation: Evaluation) -> tuple[page.Block, ...]:
    """The best and the worst frames with their images."""
    tasks = evaluation.plan.of(rows.views)
    galleries: list[page.Gallery] = []
    for which, places in zip(("Best", "Worst"), find_extremes(result.frames, SHOWN), strict=True):
        for rank, place in enumerate(places, 1):
            task, frame = tasks[place], result.frames[place]
            said = rows.shown[frame.scene, frame.target]
            heading = f"{which} {rank}: {task.scene.name}, {task.target}"
            galleries.append(_gallery(heading, task, frame, said, evaluation.classes))
    keys: list[page.Block] = []
    if galleries and evaluation.classes is not None and any(frame.confusion is not None for frame in result.frames):
        keys.append(_legend(result, evaluation.classes))
    if galleries and any(frame.depth is not None for frame in result.frames):
        bar = page.Picture(depth_error_bar(), "colours of the depth error")
        ticks = ("0 %", f"{50 * WORST_ERROR:g} %", f"{100 * WORST_ERROR:g} % or more")
        keys.append(page.Scale(bar, ticks, "depth error, |z − truth| / truth; grey without truth"))
    return (*keys, *galleries)


def _legend(result: SavedResult, classes: ClassTable) -> page.Legend:
    """The colours of the true or predicted classes, with their share of the true pixels."""
    confusion, truth = sum_confusions(result.frames)
    return page.Legend(legend_of(truth, np.flatnonzero((truth > 0) | (confusion.sum(0) > 0)), classes))


def _gallery(
    heading: str, task: Task, frame: FrameScores, predicted: Prediction, classes: ClassTable | None
) -> page.Gallery:
    """The images of one target."""
    truth = read_frame(task, task.sample.target, INDOOR_DEPTH_RANGE)
    shown = [photo(truth.images[0], "photo (truth)")]
    if predicted.image is not None:
        shown.append(photo(predicted.image, "render"))
    if predicted.labels is not None and classes is not None and truth.labels is not None:
        shown.append(class_map(predicted.labels.numpy(), classes))
        shown.append(true_class_map(truth.labels[0], classes))
    if predicted.depths is not None:
        depths = predicted.depths.numpy()
        known = depths if truth.depths is None else truth.depths[0].numpy()
        shown.append(depth_map(predicted.depths, depth_limits([known])))
        if truth.depths is not None:
            shown.append(page.Picture(depth_error_picture(depths, known), "depth error", lossy=True))
    values = summarise([frame])
    scores = [
        f"{TITLES[metric]} {shown_number(metric, values[metric])}"
        for metric in ("miou_per_image", "accuracy_per_image", "psnr", "depth_abs_rel")
        if metric in values
    ]
    return page.Gallery(heading, ", ".join([*scores, "from " + " ".join(task.contexts)]), tuple(shown))

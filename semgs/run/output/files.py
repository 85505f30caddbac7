"""The output of `semgs reconstruct`: the files in its folder, and the summary that it prints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from semgs.export.export_record import ExportedFile, write_record
from semgs.export.ply import save_ply, save_semantic_ply
from semgs.figures.number_texts import duration, length, percent
from semgs.figures.view_images import as_bytes
from semgs.files.atomic import write_json, write_text
from semgs.run.output.renders import write_renders
from semgs.run.output.report import SCENE_PAGE, Provenance, outputs, report_numbers
from semgs.run.output.report_page import report_page
from semgs.run.output.score_table import score_lines
from semgs.run.steps.result import Reconstruction, RenderedViews
from semgs.runtime.notes import Kind
from semgs.runtime.stopwatch import Stages
from semgs.scene.scene_file import FILE_NAME, save_scene
from semgs.scene.upright import upright
from semgs.segmenters.features.scene_features import FILE_NAME as FEATURES
from semgs.segmenters.features.scene_features import save_features
from semgs.viewer.viewer_page import scene_page

WRITING = Kind("Writing the scene and its renders", "Writing files")


def write_results(folder: Path, result: Reconstruction, origin: Provenance, stages: Stages, page: bool = False) -> None:
    """Write all files of a reconstruction into an existing folder.

    The report is written last, because it contains the time of every other stage.

    Args:
        folder: an existing folder.
        result, origin, stages: the reconstruction, how it was made, and its time.
        page: also write a page that shows the scene in 3D.

    Raises:
        ImportError: a page is requested, and viser is not installed.
        OSError: a file cannot be written.
    """
    with stages("write", WRITING()):
        save_scene(folder / FILE_NAME, result.saved)
        framed = upright(result.saved, "-y", result.up)
        save_ply(folder / "gaussians.ply", framed.scene.gaussians)
        names = ["gaussians.ply"]
        if result.classes is not None:
            save_semantic_ply(folder / "semantics.ply", framed.scene.gaussians, result.classes)
            names.append("semantics.ply")
        write_record(folder, [ExportedFile(name, framed, len(result.saved.gaussians)) for name in names], result.up)
        if result.features is not None:
            save_features(folder / FEATURES, result.features)
        (folder / "renders").mkdir()
        write_renders(folder / "renders", result)
    if page:
        with stages("page", "Writing the page in 3D"):
            photos = [as_bytes(image) for image in result.context.views.images]
            shown = scene_page(result.saved, photos, up=result.up, min_confidence=result.min_confidence)
            write_text(folder / SCENE_PAGE, shown.html)
    write_json(folder / "report.json", report_numbers(result, origin, stages.seconds))
    write_text(folder / "report.html", report_page(result, origin, stages.seconds, page))


def summary(
    result: Reconstruction, seconds: dict[str, float], out: Path, page: bool = False, notes: Sequence[str] = ()
) -> str:
    """The printed summary: the frames, the scores and the files.

    Args:
        result, seconds, out: the reconstruction, the time of its stages, and its folder.
        page: whether there is a page that shows the scene in 3D.
        notes: further notes, a sentence each.
    """
    metric, bounds = result.metric, result.depth_range
    height, width = result.size
    rows = [
        ("scene", f"{result.scene.name}: {result.scene.layout}, {len(result.scene)} usable frames"),
        ("input", ", ".join(result.context.titles)),
        ("held out", _held_out(result.target)),
        ("why", result.choice.reason),
        ("size", f"{height}x{width} (height x width), on disk {'x'.join(map(str, result.native_size))}"),
        ("depth", f"{length(bounds.near, metric)} to {length(bounds.far, metric)}: {bounds.reason}"),
        *((result.depth_source, line) for line in result.depth_fits),
        *((("classes", result.segmenter),) if result.segmenter else ()),
        *((("features", result.features.description),) if result.features else ()),
        ("result", f"{len(result.encoding.gaussians):,} Gaussians"),
        *(("scores", line) for line in score_lines(result)),
        ("time", ", ".join(f"{name} {duration(value)}" for name, value in seconds.items())),
        *(("note", sentence) for sentence in (*result.notes, *notes)),
    ]
    written = [(str(out / output.name), output.text) for output in outputs(result, page)]
    width = max(len(path) for path, _ in written)
    return "\n".join(
        [
            *(f"{name:<9} {text}" for name, text in rows),
            "",
            *(f"{path:<{width}}  {text}" for path, text in written),
            "",
            f"Open {out / 'report.html'} in a browser.",
        ]
    )


def _held_out(target: RenderedViews | None) -> str:
    """The held-out frames, with the share of each that is seen."""
    if target is None:
        return "none"
    return ", ".join(
        f"{frame} {percent(score.coverage)} seen" for frame, score in zip(target.titles, target.scores, strict=True)
    )

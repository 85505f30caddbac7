"""The output of `semgs reconstruct`: the files in its folder, and the summary that it prints.

Its folder of renders has images, class maps, depth and alpha of every view, in common file formats.
For a view at position 7 of the scene (`context_007_*` or `target_007_*`):

    input / truth       the photo, as read: of a context view / of a held-out view (RGB)
    image               the Gaussians seen from its camera, black behind them (RGB)
    before              the same before refining the Gaussians, if they were refined (RGB)
    classes             the class map in the colours of the class table, hatched where unseen (RGB)
    labels              the class map as numbers (8 bits): position in the class table, 255 where alpha < 0.5 (unseen), 254 where the
                        confidence is less than the least one (unknown)
    confidence          calibrated probability of that class in percent, rounded down (8 bits); 0 where unseen
    depth               z-depth along the optical axis. Metric scenes: 16-bit PNG in millimetres, 0 for no
                        depth or for 65.5 m and more. Other scenes: 32-bit float TIFF in the scene's own unit
    depth_spread        standard deviation of log depth times 1000 (16 bits): millimetres per metre of depth; 65535 where unseen
    alpha               opacity of the Gaussians (8 bits, 255 is opaque)
    truth_labels, truth_depth     the same of the truth, if a held-out view has labels in the same class table, or depth
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32
from torch import Tensor

from semgs.data.tables.classes import ClassTable
from semgs.export.export_record import ExportedFile, write_record
from semgs.export.ply import save_ply, save_semantic_ply
from semgs.figures.class_images import class_picture
from semgs.figures.view_images import as_bytes, millimetres
from semgs.files.atomic import write_json, write_text
from semgs.files.images.pictures import write_png, write_tiff
from semgs.files.text import duration, length, percent
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


def write_renders(folder: Path, result: Reconstruction) -> None:
    """Write the images of all context and target views into an existing folder.

    Raises:
        OSError: a file cannot be written.
    """
    for part in result.rendered_views:
        _write(folder, part, result.classes, result.metric)
    for before in () if result.refinement is None else result.refinement.before:
        positions = next(part.positions for part in result.rendered_views if part.role == before.role)
        for position, image in zip(positions, before.images, strict=True):
            write_png(folder / f"{before.role}_{position:03d}_before.png", as_bytes(image))


def whole_percent(shares: Float32[np.ndarray, "h w"]) -> np.ndarray:
    """Shares of 0..1 as whole percent, rounded down so that a threshold of whole percent separates the same pixels [h w]."""
    return np.floor(100 * shares.astype(np.float64) + 1e-5).astype(np.uint8)


def per_thousand(spreads: Float[Tensor, "h w"]) -> np.ndarray:
    """Numbers times 1000 as uint16 [h w]; 65535 for NaN, and for what does not fit."""
    return np.rint(1000 * spreads.double().nan_to_num(nan=np.inf).clamp(max=65.535).numpy()).astype(np.uint16)


def _write(folder: Path, part: RenderedViews, classes: ClassTable | None, metric: bool) -> None:
    """Write the files of all views of one role."""
    views = part.views
    held_out = part.role == "target"
    for index, position in enumerate(part.positions):
        stem = f"{part.role}_{position:03d}"
        write_png(folder / f"{stem}_{'truth' if held_out else 'input'}.png", as_bytes(views.images[index]))
        write_png(folder / f"{stem}_image.png", as_bytes(part.images[index]))
        alpha = np.rint(255 * part.alphas[index].clamp(0, 1).numpy()).astype(np.uint8)
        write_png(folder / f"{stem}_alpha.png", alpha)
        _write_depth(folder / f"{stem}_depth", part.depths[index], metric)
        write_png(folder / f"{stem}_depth_spread.png", per_thousand(part.depth_spread[index]))
        if part.labels is not None and part.confidences is not None and classes is not None:
            write_png(folder / f"{stem}_labels.png", part.labels[index])
            write_png(folder / f"{stem}_confidence.png", whole_percent(part.confidences[index]))
            write_png(folder / f"{stem}_classes.png", class_picture(part.labels[index], classes))
        if held_out and views.labels is not None and classes in (None, views.classes):
            write_png(folder / f"{stem}_truth_labels.png", views.labels[index].numpy())
        if held_out and views.depths is not None:
            _write_depth(folder / f"{stem}_truth_depth", views.depths[index], metric)


def _write_depth(stem: Path, depths: Tensor, metric: bool) -> None:
    """A depth map: millimetres if lengths are metres, else floating-point numbers in the scene's unit."""
    if metric:
        write_png(stem.with_suffix(".png"), millimetres(depths))
        return
    write_tiff(stem.with_suffix(".tiff"), depths.numpy())

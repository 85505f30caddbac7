"""The HTML report of a reconstruction."""

from __future__ import annotations

import numpy as np

from semgs.figures import html_page as page
from semgs.figures.class_images import legend, overlay
from semgs.figures.view_images import (
    as_bytes,
    class_map,
    depth_bar,
    depth_map,
    depth_ticks,
    heat_map,
    photo,
    please_note,
    true_class_map,
)
from semgs.files.images.colours import depth_limits
from semgs.files.text import counted, decibels, duration, length, percent
from semgs.objectives.measures import EXPLANATIONS, MOSTLY_SEEN, TITLES, shown_number
from semgs.objectives.metrics import mean_scores
from semgs.rendering.rendering import UNKNOWN, UNSEEN
from semgs.run.output.report import SCENE_PAGE, Provenance, outputs
from semgs.run.output.score_table import refinement_table, score_table, scores_lead
from semgs.run.steps.notes import note_on_refinement
from semgs.run.steps.result import PhotoRefinement, Reconstruction, RenderedViews

_TICKS = 5

MOST_SPREAD = 0.3
"""The uncertainty of depth at the end of its colour scale."""

CURVE = (90, 120, 180)
"""Colour of the bars of a refinement, sRGB."""

HELD_OUT = "The model did not get these frames: they test the reconstruction. What no input view sees stays empty."

TIME = "Of this run. The first pass of a process takes longer than the next ones, and kernels are compiled once per installation."

ENCODE = "One pass of the network, without reading photos and weights. The first pass of a process, as here, takes longer than the next ones."

UNCOMPARED = "With four photos or more, one decides when refining stops and another one tests the result. The scores of the input views say how well the photos were fitted."

HELD_OUT_OF_LABELS = "These photos said no classes. Whether the splat was trained on them, its file does not say."


def report_page(result: Reconstruction, origin: Provenance, seconds: dict[str, float], page_in_3d: bool = False) -> str:
    """The report as one self-contained HTML page; `page_in_3d` says whether to link the page that shows the scene in 3D."""
    scene = result.scene
    limits = depth_limits(_depth_maps(result))
    held_out = len(result.target.positions) if result.target else 0
    inputs = _galleries(result, result.context, limits)
    targets = _galleries(result, result.target, limits) if result.target else ()
    sections = [
        *please_note(result.notes),
        page.Section("Input views", _own_lead(result), (*_keys(result, limits), *inputs)),
        *(
            [
                page.Section(
                    "Held-out views",
                    HELD_OUT if result.splat is None else HELD_OUT_OF_LABELS,
                    targets,
                )
            ]
            if result.target
            else []
        ),
        page.Section("Scores", scores_lead(result), (score_table(result),)),
        *([] if result.refinement is None else [_refinement(result.refinement, result)]),
        page.Section(
            "Files",
            "",
            (page.Links(tuple(link for link in outputs(result, page_in_3d) if link.name != "report.html")),),
        ),
        page.Section("Details", "", (_facts(result, origin),), folded=True),
        page.Section("Time", TIME, (_timings(seconds),), folded=True),
    ]
    return page.html_page(
        title=scene.name,
        lead=f"{_what_was_done(result)}"
        + (f" and compared with {held_out} that {'was' if held_out == 1 else 'were'} held out." if held_out else "."),
        headlines=_headlines(result, seconds),
        sections=sections,
        foot=f"Made by {origin.software}. The numbers of this page are in report.json.",
        first=_first_row(result, (targets or inputs)[0]),
        link=page.Link(SCENE_PAGE, "Look around in 3D") if page_in_3d else None,
    )


def _first_row(result: Reconstruction, row: page.Gallery) -> page.Gallery:
    """One view for somebody who opens the report: the row of a held-out one, if there is one."""
    what = "a photo that the network did not get" if result.target else "an input photo"
    if result.splat is not None:
        what = "a photo of the splat's scene"
    return page.Gallery("At a glance", f"{what}, and the scene from the same camera", row.pictures)


def _what_was_done(result: Reconstruction) -> str:
    """What the photos were used for."""
    if result.splat is None:
        used, count = len(result.context.positions), len(result.scene)
        return f"Reconstructed from {used}{f' of {count}' * (count > used)} photos"
    return f"{result.splat.name}, labelled from {counted(result.splat.photos, 'photo')}"


def _depth_maps(result: Reconstruction) -> list[np.ndarray]:
    """All depth maps of the page; they share one scale."""
    maps = [part.depths for part in result.rendered_views]
    maps += [part.views.depths for part in result.rendered_views if part.views.depths is not None]
    return [depths.numpy() for depths in maps]


def _headlines(result: Reconstruction, seconds: dict[str, float]) -> list[page.Headline]:
    """The most important numbers."""
    found = []
    if result.target is not None:
        held_out = mean_scores(result.target.scores)
        found.append(page.Headline(decibels(held_out.psnr), "PSNR of held-out views", EXPLANATIONS["psnr"]))
        if (once := _one_pass(result)) is not None:
            found.append(page.Headline(decibels(once), "the same after the forward pass alone", EXPLANATIONS["psnr"]))
        if held_out.coverage < MOSTLY_SEEN:
            seen = f"over the {percent(held_out.coverage)} seen"
            found.append(page.Headline(decibels(held_out.psnr_seen), seen, EXPLANATIONS["psnr_seen"]))
        for name in ("miou_per_image", "depth_abs_rel"):
            if (value := held_out.by_measure.get(name)) is not None:
                title = f"{TITLES[name]} of held-out views"
                found.append(page.Headline(shown_number(name, value, 2), title, EXPLANATIONS[name]))
    else:
        found.append(page.Headline("–", "no photo was left to compare with", UNCOMPARED))
    count = f"{len(result.encoding.gaussians):,}"
    found.append(page.Headline(count, "Gaussians", "Soft coloured ellipsoids; the scene is made of them."))
    if result.classes is not None:
        count = str(len(legend(result.label_maps, result.classes)))
        found.append(page.Headline(count, "classes present", "Of the class table; the legend below names them."))
    if "encode" in seconds:
        found.append(page.Headline(duration(seconds["encode"]), "from photos to Gaussians, first pass", ENCODE))
    if "sharpen" in seconds:
        found.append(
            page.Headline(
                duration(seconds["sharpen"]), "to refine them", "Optimising the Gaussians on the input photos."
            )
        )
    return found


def _one_pass(result: Reconstruction) -> float | None:
    """PSNR of the held-out views before refining [dB]; None if nothing was refined."""
    before = () if result.refinement is None else result.refinement.before
    return next((mean_scores(views.scores).psnr for views in before if views.role == "target"), None)


def _own_lead(result: Reconstruction) -> str:
    """The text above the input views."""
    lead = "The input photos, and the scene from the same cameras."
    if result.splat is not None:
        lead = f"{len(result.context.positions)} of the photos that said classes, and the splat from the same cameras."
    if result.classes is not None:
        lead += " Hatched: unseen (alpha below 0.5)."
        if result.min_confidence > 0:
            lead += f" Light grey: unknown (seen, but no class has a confidence of {percent(result.min_confidence)})."
    if result.segmenter is not None:
        lead += f" Classes: {result.segmenter}."
    return lead


def _keys(result: Reconstruction, limits: tuple[float, float]) -> tuple[page.Legend | page.Scale, ...]:
    """The legend of classes and the scale of depth."""
    scale = page.Scale(
        page.Picture(depth_bar(), "colours of depth, near to far"),
        tuple(length(tick, result.metric) for tick in depth_ticks(limits, _TICKS)),
        "depth along the optical axis" + ("" if result.metric else ", in the scene's own unit"),
    )
    if result.classes is None:
        return (scale,)
    pixels = np.concatenate([labels.ravel() for labels in result.label_maps])
    unseen, unknown = (float(np.mean(pixels == value)) for value in (UNSEEN, UNKNOWN))
    return page.Legend(legend(result.label_maps, result.classes), unseen, unknown), scale


def _galleries(result: Reconstruction, part: RenderedViews, limits: tuple[float, float]) -> tuple[page.Gallery, ...]:
    """Photo, render, classes and depth of each view, with the truth folded below."""
    labels, classes, truth = part.labels, result.classes, part.views
    earlier = () if result.refinement is None else result.refinement.before
    before = next((views for views in earlier if views.role == part.role), None)
    rows = []
    for index, (position, name, score) in enumerate(zip(part.positions, part.names, part.scores, strict=True)):
        pictures = [photo(truth.images[index], "photo (input)" if part.role == "context" else "photo (held out)")]
        if before is not None:
            pictures.append(photo(before.images[index], "render, one pass"))
        pictures.append(photo(part.images[index], "render" if before is None else "render, refined"))
        more = []
        if labels is not None and classes is not None:
            pictures.append(class_map(labels[index], classes))
            if truth.labels is not None and truth.classes == classes:
                more.append(true_class_map(truth.labels[index], classes))
        pictures.append(depth_map(part.depths[index], limits))
        if truth.depths is not None:
            more.append(depth_map(truth.depths[index], limits, "measured depth"))
        if labels is not None and classes is not None and part.confidences is not None:
            tinted = overlay(as_bytes(truth.images[index]), labels[index], classes)
            more.append(page.Picture(tinted, "classes over the photo", lossy=True))
            confidence = part.confidences[index]
            more.append(heat_map(np.where(confidence > 0, confidence, np.nan), 1.0, "confidence"))
        more.append(heat_map(part.depth_spread[index].numpy(), MOST_SPREAD, "uncertainty of depth"))
        detail = f"frame {position}, PSNR {decibels(score.psnr)}, {percent(score.coverage)} seen"
        if labels is not None and result.min_confidence > 0:
            detail += f", {percent(float(np.mean(labels[index] == UNKNOWN)))} unknown"
        rows.append(page.Gallery(name, detail, tuple(pictures), tuple(more)))
    return tuple(rows)


def _refinement(refinement: PhotoRefinement, result: Reconstruction) -> page.Section:
    """What refining changed: mean scores before and after, and the curve of the view that decided."""
    lead = f"The Gaussians were optimised on the input photos. {note_on_refinement(refinement)}"
    if refinement.curve:
        lead += f" The bars are the PSNR of {refinement.check}, before the first pass and after each, from 0 dB."
    blocks: list[page.Block] = [refinement_table(result)]
    if refinement.curve:
        high = max(refinement.curve)
        bars = tuple(
            page.Bar(f"pass {number}", CURVE, max(value / max(high, 1e-9), 0), decibels(value))
            for number, value in enumerate(refinement.curve)
        )
        blocks.append(page.Bars(bars))
    return page.Section("Refinement", lead, tuple(blocks))


def _facts(result: Reconstruction, origin: Provenance) -> page.Facts:
    """The scene, the choices, and the model."""
    scene = result.scene
    native, used = (f"{height}x{width}" for height, width in (result.native_size, result.size))
    absent = f", {len(scene.absent)} more are listed but missing" if scene.absent else ""
    rows = [
        ("Scene", str(scene.path)),
        ("Layout", scene.layout),
        ("Frames", f"{len(scene)} usable{absent}"),
        ("Unit", "metres" if result.metric else "unknown: lengths are in the scene's own unit"),
        ("Image size", f"{used} (height x width)" + ("" if native == used else f", read from {native}")),
        ("Input frames", ", ".join(result.context.titles)),
        ("Held-out frames", ", ".join(result.target.titles) if result.target else "none"),
        ("Why these", result.choice.reason),
        (
            "Depth range",
            f"{length(result.depth_range.near, result.metric)} to {length(result.depth_range.far, result.metric)}: "
            f"{result.depth_range.reason}",
        ),
        *_makers(result, origin),
    ]
    if result.placement is not None:
        rows.append(("Depth from", result.placement.description))
        fitted = "the maps" if result.depth_source == "maps" else "the model's depth"
        rows += [(f"Fit of {fitted}", line) for line in result.depth_fits]
    if result.segmenter is not None:
        rows.append(("Classes from", result.segmenter))
    if result.classes is not None:
        rows.append(("Class table", f"{result.classes.name}, {len(result.classes)} classes"))
        rows.append(("Confidence", _calibration(result)))
    if result.features is not None:
        rows.append(("Features", result.features.description))
    return page.Facts(tuple(rows))


def _makers(result: Reconstruction, origin: Provenance) -> list[tuple[str, str]]:
    """Where Gaussians and classes come from."""
    rows = [] if result.splat is None else [("Splat", f"{result.splat.name} ({result.splat.format})")]
    if origin.weights:
        model = result.model if result.splat is None or result.labelling is None else result.labelling.source.title
        precision = "" if origin.precision == "float32" else f", in {origin.precision}"
        looks = "" if origin.looks == 1 else ", two looks at each photo"
        rows.append(("Model", f"{model}, {origin.parameters:,} parameters, on {origin.device}{precision}{looks}"))
        rows.append(("Weights", origin.weights))
    return rows


def _calibration(result: Reconstruction) -> str:
    """Where the confidence comes from."""
    said = "the probability of the likeliest class"
    if (temperatures := result.encoding.temperatures) is not None:
        return f"{said}, calibrated with the temperatures {temperatures.rendered:.3f} (pixels) and {temperatures.gaussians:.3f} (Gaussians)"
    whose = "the weights have no temperatures" if result.segmenter is None else "the classes are not the model's own"
    return f"{said}, not calibrated: {whose}"


def _timings(seconds: dict[str, float]) -> page.Table:
    """The stages and their sum."""
    rows = [(name, duration(value)) for name, value in seconds.items()]
    return page.Table(("stage", "time"), (*rows, ("total", duration(sum(seconds.values())))))

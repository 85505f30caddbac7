"""The page that a user looks at after a reconstruction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from semgs.data.classes import IGNORE
from semgs.figures.classes import label_maps, legend, overlay
from semgs.figures.depth import depth_bar, depth_limits, depth_ticks
from semgs.figures.numbers import decibels, duration, length, percent
from semgs.figures.page import (
    Block,
    Facts,
    Gallery,
    Headline,
    Legend,
    Link,
    Links,
    Picture,
    Scale,
    Section,
    Table,
    html_page,
)
from semgs.figures.views import as_bytes, class_map, depth_map, photo, please_note, true_class_map
from semgs.objectives.measures import MOSTLY_SEEN, TITLES, shown_number
from semgs.reconstruction.reconstruct import Reconstruction, Shown
from semgs.reconstruction.report import Origin, outputs
from semgs.reconstruction.score_table import score_table, scores_lead
from semgs.reconstruction.scores import by_measure, mean_scores

_TICKS = 5

HELD_OUT = "Frames that the model was not given: the test of the reconstruction. What no input view sees stays empty."


def report_page(result: Reconstruction, origin: Origin, seconds: dict[str, float]) -> str:
    """The report as one self-contained HTML page."""
    scene = result.scene
    maps = [] if result.classes is None else [label_maps(shown.rendering) for shown in _all_shown(result)]
    limits = depth_limits(_depth_maps(result))
    held_out = len(result.target.positions) if result.target else 0
    sections = [
        *please_note(result.notes),
        Section("Input views", _own_lead(result), (*_galleries(result, True, limits), *_keys(result, maps, limits))),
        *([Section("Held-out views", HELD_OUT, _galleries(result, False, limits))] if result.target else []),
        Section("Scores", scores_lead(result), (score_table(result),)),
        Section("Files", "", (_files(result),)),
        Section("What was read and chosen", "", (_facts(result, origin),), folded=True),
        Section("Time", "", (_timings(seconds),), folded=True),
    ]
    return html_page(
        title=scene.name,
        lead=f"Reconstructed from {len(result.context.positions)} photos"
        + (f" and compared with {held_out} that {'was' if held_out == 1 else 'were'} held out." if held_out else "."),
        headlines=_headlines(result, maps, seconds),
        sections=sections,
        foot=f"Made by {origin.software}. The numbers of this page are in report.json.",
    )


def _all_shown(result: Reconstruction) -> list[Shown]:
    """The context views and, if there are any, the target views."""
    return [result.context] if result.target is None else [result.context, result.target]


def _depth_maps(result: Reconstruction) -> list[np.ndarray]:
    """All depth maps that the page shows, which share one scale."""
    shown = [part.rendering.depths for part in _all_shown(result)]
    shown += [part.views.depths for part in _all_shown(result) if part.views.depths is not None]
    return [depths.numpy() for depths in shown]


def _headlines(result: Reconstruction, maps: Sequence[np.ndarray], seconds: dict[str, float]) -> list[Headline]:
    """The few numbers that tell how it went."""
    found = []
    if result.target is not None:
        held_out = mean_scores(result.target.scores)
        found.append(Headline(decibels(held_out.psnr), "PSNR of held-out views"))
        if held_out.coverage < MOSTLY_SEEN:
            found.append(Headline(decibels(held_out.psnr_seen), f"over the {percent(held_out.coverage)} seen"))
        for name in ("miou_per_image", "depth_abs_rel"):
            if (value := by_measure(held_out).get(name)) is not None:
                found.append(Headline(shown_number(name, value, 2), f"{TITLES[name]} of held-out views"))
    found.append(Headline(decibels(mean_scores(result.context.scores).psnr), "PSNR of the input views"))
    found.append(Headline(f"{len(result.encoding.gaussians):,}", "Gaussians"))
    if result.classes is not None:
        found.append(Headline(str(len(legend(maps, result.classes))), "classes present"))
    if "encode" in seconds:
        found.append(Headline(duration(seconds["encode"]), "from photos to Gaussians"))
    return found


def _own_lead(result: Reconstruction) -> str:
    """What the pictures of the input views are."""
    return "What went in, and the scene from the same cameras." + (
        "" if result.classes is None else " Hatched: unseen (alpha below 0.5)."
    )


def _keys(
    result: Reconstruction, maps: Sequence[np.ndarray], limits: tuple[float, float]
) -> tuple[Legend | Scale, ...]:
    """The legend of the classes and the scale of the depths."""
    scale = Scale(
        Picture(depth_bar(), "colours of depth, near to far"),
        tuple(length(tick, result.metric) for tick in depth_ticks(limits, _TICKS)),
        "depth along the optical axis" + ("" if result.metric else ", in the scene's own unit"),
    )
    if result.classes is None:
        return (scale,)
    unseen = float(np.mean(np.concatenate([one.ravel() for one in maps]) == IGNORE))
    return Legend(legend(maps, result.classes), unseen), scale


def _galleries(result: Reconstruction, own: bool, limits: tuple[float, float]) -> tuple[Block, ...]:
    """Photo, render, classes and depth of each view, with what they are compared with folded below."""
    shown = result.context if own else result.target
    if shown is None:
        return ()
    labels = None if result.classes is None else label_maps(shown.rendering)
    rows = []
    for index, (position, name) in enumerate(zip(shown.positions, shown.names, strict=True)):
        pictures = [
            photo(shown.views.images[index], "photo (input)" if own else "photo (held out)"),
            photo(shown.rendering.images[index], "render"),
        ]
        more = []
        if labels is not None and result.classes is not None:
            pictures.append(class_map(labels[index], result.classes))
            if shown.views.labels is not None and shown.views.classes == result.classes:
                more.append(true_class_map(shown.views.labels[index], result.classes))
        pictures.append(depth_map(shown.rendering.depths[index], limits))
        if shown.views.depths is not None:
            more.append(depth_map(shown.views.depths[index], limits, "measured depth"))
        if labels is not None and result.classes is not None:
            tinted = overlay(as_bytes(shown.views.images[index]), labels[index], result.classes)
            more.append(Picture(tinted, "classes over the photo", lossy=True))
        one = shown.scores[index]
        detail = f"frame {position}, PSNR {decibels(one.psnr)}, {percent(one.coverage)} seen"
        rows.append(Gallery(name, detail, tuple(pictures), tuple(more)))
    return tuple(rows)


def _facts(result: Reconstruction, origin: Origin) -> Facts:
    """What was understood of the scene and what was decided."""
    scene = result.scene
    native, used = (f"{height}x{width}" for height, width in (result.native_size, result.size))
    absent = f", {len(scene.absent)} more are listed but missing" if scene.absent else ""
    rows = [
        ("Scene", str(scene.path)),
        ("Layout", scene.layout),
        ("Frames", f"{len(scene)} usable{absent}"),
        ("Unit", "metres" if result.metric else "unknown: lengths are in the scene's own unit"),
        ("Picture size", f"{used} (height x width)" + ("" if native == used else f", read from {native}")),
        ("Input frames", _listed(result.context)),
        ("Held-out frames", _listed(result.target) if result.target else "none"),
        ("Why these", result.choice.reason),
        (
            "Depth range",
            f"{length(result.depth_range.near, result.metric)} to {length(result.depth_range.far, result.metric)}: "
            f"{result.depth_range.reason}",
        ),
        ("Model", f"{result.model}, {origin.parameters:,} parameters, on {origin.device}"),
        ("Weights", origin.weights),
    ]
    if result.classes is not None:
        rows.append(("Class table", f"{result.classes.name}, {len(result.classes)} classes"))
    return Facts(tuple(rows))


def _listed(shown: Shown) -> str:
    """Frames as text: position and name."""
    return ", ".join(f"{position} ({name})" for position, name in zip(shown.positions, shown.names, strict=True))


def _timings(seconds: dict[str, float]) -> Table:
    """The stages and their sum."""
    rows = [(name, duration(value)) for name, value in seconds.items()]
    return Table(("stage", "time"), (*rows, ("together", duration(sum(seconds.values())))))


def _files(result: Reconstruction) -> Links:
    """What lies beside the page."""
    return Links(tuple(Link(output.name, output.text) for output in outputs(result) if output.name != "report.html"))

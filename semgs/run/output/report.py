"""report.json of a reconstruction, and the list of its output files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from semgs.depth_maps.alignment import MapFit
from semgs.depth_maps.depth_fit import DepthFit
from semgs.figures.class_images import legend
from semgs.figures.html_page import Link
from semgs.objectives.metrics import ViewScores, mean_scores
from semgs.rendering.rendering import UNKNOWN, UNSEEN
from semgs.run.steps.result import PhotoRefinement, Reconstruction, RenderedViews
from semgs.runtime.precision import Precision
from semgs.segmenters.features.scene_features import SceneFeatures


@dataclass(frozen=True)
class Provenance:
    """How a reconstruction was made.

    Attributes:
        software: name and version.
        weights: where the model's weights come from, in a sentence; "" if no network of ours was used.
        parameters: of the model.
        device: where it ran.
        precision: of its layers.
        looks: at each photo, for classes.
    """

    software: str
    weights: str
    parameters: int
    device: str
    precision: Precision = "float32"
    looks: int = 1


SCENE_PAGE = "scene.html"
"""The page that shows the scene in 3D, in the folder of a reconstruction."""


def outputs(result: Reconstruction, page: bool = False) -> tuple[Link, ...]:
    """The output files of a reconstruction, the most important first.

    Args:
        result: the reconstruction.
        page: whether there is a page that shows the scene in 3D.
    """
    depth = "16-bit depth in millimetres" if result.metric else "depth as 32-bit float TIFF in the scene's unit"
    maps = (
        ""
        if result.classes is None
        else "class maps (coloured, and as numbers with 255 for unseen), confidence in percent, "
    )
    listed = [
        Link("report.html", "start here: the report, one page that needs no network and no other file"),
        Link(SCENE_PAGE, "the scene in 3D, in your browser: one page that needs no network and no other file"),
        Link("report.json", "all numbers of the report"),
        Link(
            "gaussians.ply",
            "the scene in colour, upright and centred, plain 3DGS: opens in every Gaussian splat viewer",
        ),
        Link("semantics.ply", "the same coloured by class, with the shapes of the semantic Gaussians"),
        Link("export.json", "the matrix from the PLY files to the scene's coordinates, and the class table"),
        Link(
            "scene.safetensors",
            "everything, for semgs.load_scene in Python: Gaussians, cameras, depth, confidence, classes",
        ),
        Link("features.safetensors", "the features of the Gaussians, for semgs query"),
        Link("segmenter/", "the segmenter's maps of the input photos, used again by --overwrite"),
        Link("renders/", f"images of every view: photo, render, {maps}{depth} and its uncertainty, alpha"),
    ]
    absent = {
        *(() if page else (SCENE_PAGE,)),
        *(() if result.classes is not None else ("semantics.ply",)),
        *(() if result.features is not None else ("features.safetensors",)),
        *(() if result.labelling is not None and result.labelling.saves_maps else ("segmenter/",)),
    }
    return tuple(link for link in listed if link.name not in absent)


def report_numbers(result: Reconstruction, origin: Provenance, seconds: dict[str, float]) -> dict:
    """All numbers of the report, ready for JSON; unknown values are None.

    Lengths are in metres if `scene.unit` is "metric", else in the scene's own unit. Add `scene.origin` to positions in `scene.safetensors` to get
    the scene's coordinates. `psnr` is in dB, and None for equal images.
    """
    scene = result.scene
    placement, maps = result.placement, result.label_maps
    fits: Sequence[DepthFit | MapFit] = placement.fits if placement else ()
    pixels = np.concatenate([labels.ravel() for labels in maps]) if maps else np.zeros(0, np.uint8)
    temperatures = result.encoding.temperatures
    splat = result.splat
    return {
        "format": "semgs.report.reconstruct",
        "version": 1,
        "software": origin.software,
        "scene": {
            "name": scene.name,
            "path": str(scene.path),
            "layout": scene.layout,
            "unit": scene.unit,
            "origin": scene.origin.tolist(),
            "usable_frames": len(scene),
            "absent_frames": list(scene.absent),
        },
        "model": {
            "name": result.model,
            "weights": origin.weights,
            "parameters": origin.parameters,
            "classes": result.classes and result.classes.name,
            "segmenter": result.segmenter,
            "device": origin.device,
            "precision": origin.precision,
            "looks": origin.looks,
        },
        "size": dict(zip(("height", "width"), result.size, strict=True)),
        "native_size": dict(zip(("height", "width"), result.native_size, strict=True)),
        "choice": {
            "context": list(result.context.positions),
            "targets": list(result.target.positions) if result.target else [],
            "reason": result.choice.reason,
        },
        "depth_range": {
            "near": rounded(result.depth_range.near),
            "far": rounded(result.depth_range.far),
            "reason": result.depth_range.reason,
        },
        "depth": {
            "source": result.depth_source,
            "fits": [
                {"name": name, **{key: rounded(value) for key, value in asdict(fit).items()}}
                for name, fit in zip(result.context.names, fits, strict=bool(fits))
            ],
            "from": placement.description if placement else "the model",
            "shift_px": list(placement.shift) if placement and placement.shift else None,
        },
        "gaussians": len(result.encoding.gaussians),
        "features": result.features and _features(result.features),
        "views": [
            {"role": part.role, "position": position, "name": name, **_rounded(score), **_certainty(part, index)}
            for part in result.rendered_views
            for index, (position, name, score) in enumerate(zip(part.positions, part.names, part.scores, strict=True))
        ],
        "means": {
            "context": _rounded(mean_scores(result.context.scores)),
            "target": _rounded(mean_scores(result.target.scores)) if result.target else None,
        },
        "refinement": result.refinement and _refinement(result.refinement),
        "splat": splat and {name: getattr(splat, name) for name in ("name", "format", "photos")},
        "classes": [
            {"name": entry.name, "share": rounded(entry.share)}
            for entry in (legend(maps, result.classes) if result.classes is not None else ())
        ],
        "unseen": rounded(float((pixels == UNSEEN).mean())) if pixels.size else None,
        "unknown": rounded(float((pixels == UNKNOWN).mean())) if pixels.size else None,
        "min_confidence": result.min_confidence,
        "temperatures": temperatures and asdict(temperatures),
        "seconds": {name: round(value, 3) for name, value in seconds.items()},
        "notes": list(result.notes),
    }


def _certainty(part: RenderedViews, index: int) -> dict[str, float | None]:
    """How sure the classes and the depth of one view are, at its seen pixels."""
    numbers = {"median_depth_spread": rounded(part.depth_spread[index].nanmedian().item()), "mean_confidence": None}
    if part.labels is None or part.confidences is None:
        return numbers | {"unknown": None}
    confidence = part.confidences[index]
    if (confidence > 0).any():
        numbers["mean_confidence"] = rounded(float(confidence[confidence > 0].mean()))
    return numbers | {"unknown": rounded(float((part.labels[index] == UNKNOWN).mean()))}


def _features(features: SceneFeatures) -> dict:
    """The numbers of features and their compression."""
    book = features.compression.book
    return {
        "source": features.source,
        "numbers": features.numbers,
        "compression": "components" if book is None else "book",
        "directions": features.compression.basis.shape[1],
        "entries": None if book is None else len(book),
        "kept": rounded(features.kept),
        "largest_change_of_a_cosine": rounded(features.bound),
    }


def rounded(value: float | None) -> float | None:
    """A number rounded to five significant digits; None for None and for what JSON cannot express."""
    if value is None or not math.isfinite(value):
        return None
    return float(f"{value:.5g}")


def _refinement(refinement: PhotoRefinement) -> dict:
    """What refining changed."""
    return {
        "passes": refinement.passes,
        "kept": refinement.kept,
        "check": refinement.check,
        "curve": [rounded(value) for value in refinement.curve],
        "before": {part.role: _rounded(mean_scores(part.scores)) for part in refinement.before},
    }


def _rounded(score: ViewScores) -> dict[str, float | None]:
    """The scores of a view by name, rounded."""
    depth, seen = score.depth, score.depth_seen
    numbers = {
        "psnr": score.psnr,
        "coverage": score.coverage,
        "psnr_seen": score.psnr_seen,
        "depth_error": None if seen is None else seen.abs_rel,
        "accuracy": score.accuracy,
        "miou": score.miou,
        "accuracy_seen": score.accuracy_seen,
        "miou_seen": score.miou_seen,
        "depth_abs_rel": None if depth is None else depth.abs_rel,
    }
    pixels = {"depth_pixels": depth.pixels if depth else 0, "depth_pixels_seen": seen.pixels if seen else 0}
    return {name: rounded(value) for name, value in numbers.items()} | pixels

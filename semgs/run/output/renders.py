"""The folder of renders: images, class maps, depth and alpha of every view, in common file formats.

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

from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32
from torch import Tensor

from semgs.data.tables.classes import ClassTable
from semgs.figures.class_images import class_picture
from semgs.figures.depth_images import millimetres
from semgs.figures.view_images import as_bytes
from semgs.files.images.pictures import write_png, write_tiff
from semgs.run.steps.result import Reconstruction, RenderedViews


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


def percent(shares: Float32[np.ndarray, "h w"]) -> np.ndarray:
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
            write_png(folder / f"{stem}_confidence.png", percent(part.confidences[index]))
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

"""Reliability plots: accuracy as a function of confidence."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass

from semgs.figures.plotting import SIZE, as_written, new_figure

SIDE = 2.6
"""Side of a plot [inch]."""
COLOURS = ("#c44e52", "#4c72b0")
VISIBLE = 1e-3
"""Bins with a smaller share of the pixels get no point."""


@dataclass(frozen=True)
class ReliabilityPlot:
    """One plot.

    Attributes:
        title: of the plot.
        curves: name and bins of each curve, in the order of the colours. A bin has its share of all pixels, their mean confidence,
            and the share of them that is correct, each 0..1.
    """

    title: str
    curves: tuple[tuple[str, tuple[tuple[float, float, float], ...]], ...]


def reliability_png(plots: Sequence[ReliabilityPlot]) -> bytes:
    """The plots side by side as PNG: accuracy over confidence, and below each the share of pixels. The diagonal is perfect.

    Bins with less than a thousandth of the pixels say little, so they get no point.
    """
    figure = new_figure((SIDE * len(plots), 1.3 * SIDE), layout="constrained")
    axes = figure.subplots(2, len(plots), squeeze=False, sharex=True, height_ratios=(3, 1))
    for (above, below), plot in zip(axes.T, plots, strict=True):
        above.plot((0, 1), (0, 1), color="0.7", linewidth=0.8)
        for (name, bins), colour in zip(plot.curves, COLOURS, strict=False):
            points = [(confidence, accuracy) for share, confidence, accuracy in bins if share >= VISIBLE]
            above.plot(
                *zip(*points, strict=True),
                color=colour,
                marker="o",
                markersize=2.5,
                linewidth=1,
                label=as_written(name),
            )
            edges = [index / len(bins) for index in range(len(bins) + 1)]
            below.stairs([share for share, _, _ in bins], edges, color=colour)
        above.set(xlim=(0, 1), ylim=(0, 1), aspect="equal")
        above.set_title(as_written(plot.title), fontsize=SIZE + 1)
        above.set_ylabel("share correct", fontsize=SIZE)
        below.set_ylabel("share of pixels", fontsize=SIZE)
        below.set_xlabel("confidence", fontsize=SIZE)
        above.legend(fontsize=SIZE, frameon=False, loc="upper left")
        for one in (above, below):
            one.tick_params(labelsize=SIZE)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=160, metadata={"Software": None})
    return buffer.getvalue()

"""matplotlib, which is optional: everything that plots takes its figure from here.

With it, reliability plots (accuracy as a function of confidence) and risk-coverage curves.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import UInt8

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

SIZE = 7.0
"""Font size of plots [points]."""

SIDE = 2.6
"""Side of a plot [inch]."""
RELIABILITY_COLOURS = ("#c44e52", "#4c72b0")
VISIBLE = 1e-3
"""Bins with a smaller share of the pixels get no point."""

RISK_COLOURS = ("#4c72b0", "#c44e52", "#55a868", "#8172b3")


def new_figure(size: tuple[float, float], **options: Any) -> Figure:
    """An empty figure of (width, height) inches that renders without a display.

    Raises:
        ImportError: matplotlib is not installed.
    """
    check_plotting()
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=size, **options)
    FigureCanvasAgg(figure)
    return figure


def as_written(text: str) -> str:
    """A name for a figure, in which matplotlib would take what is between two dollars for a formula."""
    return text.replace("$", r"\$")


def label_axes(axes: Axes, x: str, y: str) -> None:
    """Names the axes of a plot, and draws a light grid behind it."""
    axes.set_xlabel(x, fontsize=SIZE)
    axes.set_ylabel(y, fontsize=SIZE)
    axes.tick_params(labelsize=SIZE)
    axes.grid(color="0.9", linewidth=0.6)


def make_rectangle(*arguments: Any, **options: Any) -> Rectangle:
    """A rectangle, as matplotlib takes its arguments."""
    from matplotlib.patches import Rectangle

    return Rectangle(*arguments, **options)


def render_figure(figure: Figure) -> UInt8[np.ndarray, "h w 3"]:
    """The figure as an image."""
    canvas: Any = figure.canvas
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def can_plot() -> bool:
    """Whether matplotlib is installed."""
    return find_spec("matplotlib") is not None


def check_plotting() -> None:
    """Check that matplotlib is installed, before work whose result will be plotted.

    Raises:
        ImportError: it is not; says how to install it.
    """
    if not can_plot():
        raise ImportError("plots need matplotlib: pip install -e '.[figures]' in SemGS's folder", name="matplotlib")


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
        for (name, bins), colour in zip(plot.curves, RELIABILITY_COLOURS, strict=False):
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


@dataclass(frozen=True)
class RiskCurve:
    """A curve.

    Attributes:
        name: in the legend.
        coverages: shares of the pixels, the most confident ones, ascending.
        risks: the share of these that is wrong.
        lows, highs: the ends of the intervals; None without.
    """

    name: str
    coverages: tuple[float, ...]
    risks: tuple[float, ...]
    lows: tuple[float | None, ...]
    highs: tuple[float | None, ...]


def risk_coverage_picture(curves: Sequence[RiskCurve]) -> UInt8[np.ndarray, "h w 3"]:
    """The share of wrong pixels over the share of pixels that counts, with 95 % intervals as bands."""
    figure = new_figure((4.2, 2.8), dpi=160, layout="constrained")
    axes = figure.subplots()
    for index, curve in enumerate(curves):
        colour = RISK_COLOURS[index % len(RISK_COLOURS)]
        coverages, risks = (100 * np.array(values) for values in (curve.coverages, curve.risks))
        axes.plot(coverages, risks, color=colour, marker="o", markersize=2.5, linewidth=1, label=as_written(curve.name))
        if None not in (*curve.lows, *curve.highs):
            axes.fill_between(
                coverages,
                100 * np.array(curve.lows),
                100 * np.array(curve.highs),
                color=colour,
                alpha=0.15,
                linewidth=0,
            )
    axes.set(xlim=(0, 100), ylim=(0, None))
    label_axes(axes, "most confident pixels that count [%]", "wrong class [%]")
    axes.legend(fontsize=SIZE, frameon=False, loc="upper left")
    return render_figure(figure)

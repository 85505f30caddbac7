"""Plots of risk-coverage curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import UInt8

from semgs.figures.plotting import SIZE, as_written, label_axes, new_figure, render_figure

COLOURS = ("#4c72b0", "#c44e52", "#55a868", "#8172b3")


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
        colour = COLOURS[index % len(COLOURS)]
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

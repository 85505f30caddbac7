"""Plots of a score during training."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import UInt8

from semgs.figures.plotting import SIZE, as_written, label_axes, new_figure, render_figure


def validation_picture(runs: Mapping[str, Sequence[Mapping[int, float]]], score: str) -> UInt8[np.ndarray, "h w 3"]:
    """A score over the steps: for each kind of training, the mean of its runs, and their range as a band.

    Args:
        runs: by the name of the kind, the score by step of each of its runs. Steps that a run lacks are left out.
        score: its name.
    """
    figure = new_figure((5.8, 3.0), dpi=160, layout="constrained")
    axes = figure.subplots()
    for index, (name, found) in enumerate(runs.items()):
        steps = sorted(set.intersection(*[set(run) for run in found])) if found else []
        if not steps:
            continue
        values = np.array([[run[step] for step in steps] for run in found])
        axes.plot(
            steps,
            values.mean(axis=0),
            color=f"C{index}",
            marker="o",
            markersize=2.5,
            linewidth=1,
            label=as_written(name),
        )
        axes.fill_between(steps, values.min(axis=0), values.max(axis=0), color=f"C{index}", alpha=0.15, linewidth=0)
    axes.set(xlim=(0, None), ylim=(0, None))
    label_axes(axes, "step", score)
    if axes.lines:
        figure.legend(fontsize=SIZE, frameon=False, loc="outside right center")
    return render_figure(figure)

"""Draw the curve over core-hours of docs/lab/experiments.md from the table there, and print what a doubling gave: python docs/lab/learning_curve.py

It needs matplotlib (extra figures).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from semgs.figures.plotting import new_figure

HEADING = "## The curve over core-hours"
LAB = Path(__file__).resolve().parent


def table() -> tuple[list[str], np.ndarray]:
    """The names of the scores, and rows of core-hours and scores."""
    section = (LAB / "experiments.md").read_text("utf-8").partition(HEADING)[2].partition("\n## ")[0]
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in section.splitlines() if line.startswith("|")
    ]
    return [name.strip("`") for name in rows[0][2:]], np.array([[float(cell) for cell in row[1:]] for row in rows[2:]])


def doublings(hours: np.ndarray, scores: np.ndarray) -> tuple[float, float]:
    """Gain for each doubling of the hours, and the score after one hour, by least squares."""
    gain, start = np.polyfit(np.log2(hours), scores, 1)
    return float(gain), float(start)


def main() -> None:
    """Write docs/images/plot_core_hours.png."""
    names, rows = table()
    hours = rows[:, 0]
    ahead = np.geomspace(hours[0], 4 * hours[-1], 50)
    figure = new_figure((6.4, 3.6), layout="constrained")
    axes = figure.subplots()
    for name, scores in zip(names, rows[:, 1:].T, strict=True):
        gain, start = doublings(hours, scores)
        (line,) = axes.plot(hours, scores, "o", label=f"{name}: {gain:+.3f} per doubling")
        axes.plot(ahead, start + gain * np.log2(ahead), color=line.get_color(), linewidth=1, linestyle=":")
        twice = start + gain * np.log2(2 * hours[-1])
        print(f"{name}: {gain:+.3f} per doubling, {twice:.2f} expected at {2 * hours[-1]:g} core-hours")
    axes.set_xscale("log", base=2)
    axes.set_xticks([1, 2, 4, 8, 16], ["1", "2", "4", "8", "16"])
    axes.set(xlabel="core-hours of the class branch", ylabel="mIoU", ylim=(0, 0.8))
    axes.legend(frameon=False, fontsize=8, loc="lower right")
    figure.savefig(LAB.parent / "images" / "plot_core_hours.png", dpi=120)


if __name__ == "__main__":
    main()

"""matplotlib, which is optional: everything that plots takes its figure from here."""

from __future__ import annotations

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

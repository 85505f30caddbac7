"""Draw the figures of docs/conventions.md: python docs/convention_figures.py

Grey on transparent, so that they can be read on light and dark pages.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

IMAGES = Path(__file__).resolve().parent / "images"
INK = "#808890"
AXES = {"x": "#e0533d", "y": "#3a9d5d", "z": "#3b82f6"}
"""Red, green and blue for x, y and z, as everywhere."""

# Directions as seen from behind the camera: right, up, and forward (into the page, drawn as a slanted line).
RIGHT, UP, FORWARD = np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.array([0.55, 0.42])
FRAMES = {
    "OpenCV, COLMAP, ScanNet,\ngsplat, ROS's optical frames, and ours": (RIGHT, -UP, FORWARD),
    "OpenGL, Blender, nerfstudio,\ninstant-ngp, ARKit": (RIGHT, UP, -FORWARD),
    "PyTorch3D": (-RIGHT, UP, FORWARD),
    "ROS bodies (base_link)": (FORWARD, -RIGHT, UP),
}


def draw_frame(axes: Axes, title: str, directions: tuple[np.ndarray, ...]) -> None:
    """The camera seen from behind, and its three axes."""
    corners = np.array([[-0.45, -0.3], [0.45, -0.3], [0.45, 0.3], [-0.45, 0.3]])
    image = corners * 1.35 + 0.75 * FORWARD
    axes.fill(*image.T, facecolor=INK, alpha=0.18, edgecolor=INK)
    for corner in image:
        axes.plot([0, corner[0]], [0, corner[1]], color=INK, linewidth=0.8)
    for (name, colour), direction in zip(AXES.items(), directions, strict=True):
        tip = direction * 1.25
        axes.annotate("", tip, (0, 0), arrowprops={"arrowstyle": "-|>", "color": colour, "linewidth": 2.2})
        axes.text(*(tip * 1.16), name, color=colour, ha="center", va="center", fontsize=13, fontweight="bold")
    axes.set_title(title, color=INK, fontsize=10)
    axes.set(xlim=(-1.6, 1.6), ylim=(-1.6, 1.6), aspect="equal")
    axes.axis("off")


def frames_figure() -> None:
    """Four conventions of camera axes."""
    figure, axes = plt.subplots(1, len(FRAMES), figsize=(13, 3.6))
    for one, (title, directions) in zip(axes, FRAMES.items(), strict=True):
        draw_frame(one, title, directions)
    figure.text(
        0.5, 0.02, "each camera is seen from behind and looks into the page", color=INK, ha="center", fontsize=9
    )
    save(figure, "camera_axes.svg")


def pixels_figure() -> None:
    """The 3 x 4 image whose first pixel's centre is (0.5, 0.5)."""
    figure, axes = plt.subplots(figsize=(9, 6))
    for u in range(5):
        axes.plot([u, u], [0, 3], color=INK, linewidth=0.9)
    for v in range(4):
        axes.plot([0, 4], [v, v], color=INK, linewidth=0.9)
    axes.fill([0, 1, 1, 0], [0, 0, 1, 1], facecolor=AXES["z"], alpha=0.2)
    axes.fill([2, 3, 3, 2], [1, 1, 2, 2], facecolor=AXES["y"], alpha=0.2)
    for (u, v), text, colour in (
        ((0.5, 0.5), "row 0, column 0\n(0.5, 0.5)", AXES["z"]),
        ((2.5, 1.5), "row 1, column 2\n(2.5, 1.5)", AXES["y"]),
    ):
        axes.plot(u, v, "o", color=colour, markersize=4)
        axes.text(u, v + 0.24, text, color=colour, ha="center", va="center", fontsize=9)
    axes.plot(2, 1.5, "x", color=AXES["x"], markersize=9, markeredgewidth=2)
    axes.text(1.9, 1.5, "W/2, H/2\n(2, 1.5)", color=AXES["x"], ha="right", va="center", fontsize=9)
    axes.plot(0, 0, "o", color=INK, markersize=5)
    axes.text(-0.08, -0.12, "(0, 0)", color=INK, ha="right", va="center", fontsize=9)
    axes.text(4.08, 3.12, "(4, 3)", color=INK, ha="left", va="center", fontsize=9)
    axes.annotate("", (4.5, -0.3), (-0.05, -0.3), arrowprops={"arrowstyle": "-|>", "color": INK})
    axes.annotate("", (-0.45, 3.4), (-0.45, -0.05), arrowprops={"arrowstyle": "-|>", "color": INK})
    axes.text(4.6, -0.3, "u", color=INK, va="center", fontsize=11)
    axes.text(-0.45, 3.55, "v", color=INK, ha="center", fontsize=11)
    axes.set(xlim=(-0.8, 4.9), ylim=(3.7, -0.6), aspect="equal")
    axes.axis("off")
    save(figure, "pixel_centres.svg")


def save(figure: plt.Figure, name: str) -> None:
    """Write an SVG without a date, so that drawing it again changes nothing."""
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    figure.savefig(IMAGES / name, transparent=True, metadata={"Date": None})
    plt.close(figure)


if __name__ == "__main__":
    plt.rcParams["svg.hashsalt"] = "semgs"
    frames_figure()
    pixels_figure()

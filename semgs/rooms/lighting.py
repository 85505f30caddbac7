"""The light of a room: day through its windows, the sun through one of them, lamps."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from semgs.rooms import shading_kernels as kernels
from semgs.rooms.plans import Plan


def draw_lights(rng: np.random.Generator, plan: Plan) -> tuple[Float64[np.ndarray, "l 16"], Float64[np.ndarray, 3]]:
    """Lamps, windows, and at times the sun through one of them; at least one light, some rooms dim and warm, some bright."""
    day = len(plan.windows) > 0 and rng.random() < 0.75
    warm = np.array([1.0, rng.uniform(0.75, 0.95), rng.uniform(0.5, 0.85)])
    cool = np.array([rng.uniform(0.85, 1.0), rng.uniform(0.93, 1.0), 1.0])
    rows = []
    if day:
        for window in plan.windows[:2]:
            place = np.array(window.middle) + 0.12 * np.array(window.facing)
            area = 4 * np.hypot(*window.half_width[:2]) * window.half_height
            power = rng.uniform(1.0, 3.0) * np.sqrt(area)
            rows.append(_light(kernels.WINDOW, place, cool * power, window))
        if rng.random() < 0.45:
            window = plan.windows[0]
            aside = np.array([-window.facing[1], window.facing[0], 0.0]) * rng.uniform(-1, 1)
            way = np.array(window.facing) + aside + (0, 0, -rng.uniform(0.25, 0.9))
            row = _light(
                kernels.SUN, np.array(window.middle), np.array([1.0, 0.93, 0.82]) * rng.uniform(1.0, 3.0), window
            )
            row[7:10] = way / np.linalg.norm(way)
            rows.append(row)
    if not day or rng.random() < 0.5:
        x, y, z = plan.size
        spots = 1 + int(rng.random() < 0.3 and len(rows) < 2)
        for _ in range(spots):
            place = np.array([rng.uniform(-0.25, 0.25) * x, rng.uniform(-0.25, 0.25) * y, z - rng.uniform(0.15, 0.6)])
            rows.append(_light(kernels.LAMP, place, warm * rng.uniform(1.0, 4.0) / spots, None))
    ambient = rng.uniform(0.25, 0.8) * (0.5 * warm + 0.5 * cool if day else warm)
    return np.array(rows), ambient


def _light(kind: int, place: np.ndarray, colour: np.ndarray, window) -> Float64[np.ndarray, 16]:
    row = np.zeros(kernels.LIGHT_WIDTH)
    row[0] = kind
    row[1:4], row[4:7] = place, colour
    if window is not None:
        row[7:10], row[10:13], row[13] = window.facing, window.half_width, window.half_height
    return row

"""Lights of a room: daylight through its windows, the sun through one of them, lamps."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from semgs_rooms.drawing import shading_kernels as kernels
from semgs_rooms.plans.floor_plan import FloorPlan, Lamp, Opening

MOST = 8
"""Maximum number of lights; each costs one ray per pixel."""
SHARES = {1: 4, 2: 2}
"""Lights per window, by the number of windows; one if there are more."""


def draw_lights(
    rng: np.random.Generator, plan: FloorPlan
) -> tuple[Float64[np.ndarray, "l 16"], Float64[np.ndarray, " 3"]]:
    """Lights for the shading kernels, at least one, and the ambient light (linear RGB).

    A window has up to four lights spread over it, for soft shadows. Sometimes the sun shines through one window.
    """
    warm = np.array([1.0, rng.uniform(0.75, 0.95), rng.uniform(0.5, 0.85)])
    cool = np.array([rng.uniform(0.85, 1.0), rng.uniform(0.93, 1.0), 1.0])
    windows = sorted(plan.windows, key=lambda window: -window.light * window.half_height)[:3]
    day = sum(window.light for window in windows)
    lamps = plan.lamps or (() if day > 0.15 else (Lamp((0.0, 0.0, plan.size[2] - 0.15), rng.uniform(1.0, 3.0)),))
    rows = []
    shares = SHARES.get(len(windows), 1)
    gain = rng.uniform(1.2, 3.0)
    for window in windows:
        area = 4 * np.hypot(*window.half_width[:2]) * window.half_height
        for place in _spread(window, shares):
            rows.append(_light(kernels.WINDOW, place, cool * (gain * window.light * np.sqrt(area) / shares), window))
    if windows and windows[0].light > 0.3 and rng.random() < 0.45:
        rows.append(_sun(rng, windows[0]))
    for lamp in lamps[: MOST - len(rows)]:
        rows.append(_light(kernels.LAMP, np.array(lamp.place), warm * lamp.power / np.sqrt(len(lamps)), None))
    lamplight = sum(lamp.power for lamp in lamps)
    tone = (cool * day + warm * 0.5 * lamplight) / max(day + 0.5 * lamplight, 1e-6)
    ambient = rng.uniform(0.18, 0.5) * min(1.0, 0.35 + 0.6 * day + 0.25 * lamplight) * tone
    return np.array(rows), ambient


def _spread(window: Opening, count: int) -> list[Float64[np.ndarray, " 3"]]:
    """Positions 12 cm in front of a window: at its centre, two side by side, or four."""
    middle = np.array(window.middle) + 0.12 * np.array(window.facing)
    across, up = np.array(window.half_width) / 2, np.array([0.0, 0.0, window.half_height / 2])
    if count == 1:
        return [middle]
    if count == 2:
        return [middle - across, middle + across]
    return [middle + a * across + b * up for a in (-1, 1) for b in (-1, 1)]


def _sun(rng: np.random.Generator, window: Opening) -> Float64[np.ndarray, " 16"]:
    """The sun through a window."""
    aside = np.array([-window.facing[1], window.facing[0], 0.0]) * rng.uniform(-1, 1)
    way = np.array(window.facing) + aside + (0, 0, -rng.uniform(0.25, 0.9))
    strength = rng.uniform(1.0, 3.0) * min(1.0, window.light)
    row = _light(kernels.SUN, np.array(window.middle), np.array([1.0, 0.93, 0.82]) * strength, window)
    row[7:10] = way / np.linalg.norm(way)
    return row


def _light(kind: int, place: np.ndarray, colour: np.ndarray, window: Opening | None) -> Float64[np.ndarray, " 16"]:
    row = np.zeros(kernels.LIGHT_WIDTH)
    row[0] = kind
    row[1:4], row[4:7] = place, colour
    if window is not None:
        row[7:10], row[10:13], row[13] = window.facing, window.half_width, window.half_height
    return row

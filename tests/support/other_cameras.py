"""Scenes of the landmarks with cameras as Metashape and LLFF write them, from the descriptions of their formats."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from landmarks import POINTS, drawn, looking
from PIL import Image

SIZE = (120, 170)
EYES = [(0.5, -0.3, -3.2), (-0.4, 0.2, -2.9), (0.1, 0.4, -3.4)]
POSES = np.stack([looking(eye, (0, 0, 0)) for eye in EYES])
FRAME = {"f": 150.0, "cx": 6.3, "cy": -4.8, "b1": 3.0, "k1": 0.1, "k2": -0.05, "k3": 0.01, "p1": 0.004, "p2": -0.003}
FISHEYE = {"f": 150.0, "cx": 6.3, "cy": -4.8, "k1": -0.06, "k2": 0.03, "k3": 0.01, "k4": 0.002}


def metashape_pixels(pose: np.ndarray, kind: str, c: dict[str, float]) -> np.ndarray:
    """Where Metashape's manual puts the landmarks: u = w/2 + cx + x' f + x' b1, v = h/2 + cy + y' f."""
    inside = (POINTS - pose[:3, 3]) @ pose[:3, :3]
    x, y = inside[:, 0] / inside[:, 2], inside[:, 1] / inside[:, 2]
    if kind == "fisheye":
        r0 = np.hypot(x, y)
        x, y = x * np.arctan(r0) / r0, y * np.arctan(r0) / r0
    r2 = x * x + y * y
    k1, k2, k3, k4, p1, p2, b1 = (c.get(name, 0.0) for name in ("k1", "k2", "k3", "k4", "p1", "p2", "b1"))
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3 + k4 * r2**4
    u = x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
    v = y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
    return np.stack((SIZE[1] / 2 + c["cx"] + u * (c["f"] + b1), SIZE[0] / 2 + c["cy"] + v * c["f"]), axis=1)


def write_metashape(
    folder: Path, kind: str = "frame", calibration: dict[str, float] = FRAME, component: str = "", **more: Any
) -> Path:
    """Photos and `cameras.xml`; `component` is the text of a transform, `more` replaces texts."""
    folder.mkdir(parents=True, exist_ok=True)
    cameras = ""
    for index, pose in enumerate(POSES):
        Image.fromarray(drawn(SIZE, metashape_pixels(pose, kind, calibration))).save(folder / f"IMG_{index}.png")
        numbers = " ".join(map(repr, pose.ravel().tolist()))
        label = f"IMG_{index}" + ".png" * (index == 1)
        cameras += f'<camera id="{index}" sensor_id="0" component_id="0" label="{label}"><transform>{numbers}</transform></camera>\n'
    values = "".join(f"<{name}>{value!r}</{name}>" for name, value in calibration.items())
    sides = f'<resolution width="{SIZE[1]}" height="{SIZE[0]}"/>'
    (folder / "cameras.xml").write_text(
        f'<?xml version="1.0" encoding="UTF-8"?>\n<document version="2.0.0">\n<chunk label="Chunk 1" enabled="true">\n'
        f'<sensors next_id="1"><sensor id="0" label="a" type="{kind}">{sides}'
        f'<calibration type="{kind}" class="adjusted">{sides}{values}</calibration></sensor></sensors>\n'
        f'<components next_id="1"><component id="0">{component}</component></components>\n'
        f'<cameras next_id="4"><group id="0" label="walk">{cameras}</group><camera id="3" sensor_id="0" label="IMG_9"/></cameras>\n'
        "</chunk></document>\n"
    )
    return folder


def write_llff(folder: Path, shrink: int = 1, name: str = "images") -> Path:
    """Photos and `poses_bounds.npy`; the photos are `shrink` times smaller than their camera says."""
    (folder / name).mkdir(parents=True)
    rows = []
    for index, pose in enumerate(POSES):
        inside = (POINTS - pose[:3, 3]) @ pose[:3, :3]
        places = 150.0 * inside[:, :2] / inside[:, 2:] + np.array(SIZE[::-1]) / 2
        Image.fromarray(drawn(SIZE, places)).save(folder / name / f"{index:03d}.png")
        right, down, forward, eye = pose[:3].T
        matrix = np.stack((down, right, -forward, eye, shrink * np.array([*SIZE, 150.0])), axis=1)
        rows.append([*matrix.ravel(), 1.2, 9.0])
    np.save(folder / "poses_bounds.npy", np.array(rows))
    return folder

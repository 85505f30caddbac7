"""A folder as `semgs reconstruct` writes it, without a network: a wall and a chair."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from wall_and_chair import wall_and_chair

from semgs.files.images.pictures import write_png
from semgs.scene.scene_file import FILE_NAME, save_scene

NOTES = (
    "The cameras of 2 of 3 photos were estimated from the photos.",
    "The scale of this scene is unknown, so lengths are in its own unit.",
    "Something <b>new</b>.",
    "Fix it with --size.",
)


def write_reconstruction(folder: Path, refined: bool = False) -> Path:
    """Write the folder and return it."""
    scene = wall_and_chair((40, 50))
    folder.mkdir(parents=True)
    (folder / "renders").mkdir()
    save_scene(folder / FILE_NAME, scene)
    (folder / "gaussians.ply").write_bytes(b"ply")
    red = np.full((40, 50, 3), (200, 30, 30), np.uint8)
    for position in range(2):
        for kind in ("input", "image", "classes", *(["before"] if refined else [])):
            write_png(folder / "renders" / f"context_{position:03d}_{kind}.png", red)
    scores = {"context": {"psnr": 21.0}, "target": None}
    report = {
        "scene": {"usable_frames": 3, "unit": "metric"},
        "views": [{"role": "context", "position": n, "name": name} for n, name in enumerate(scene.frames)],
        "gaussians": len(scene.gaussians),
        "refinement": {"before": {"context": {"psnr": 20.0}}} if refined else None,
        "means": scores,
        "seconds": {},
        "notes": list(NOTES),
    }
    (folder / "report.json").write_text(json.dumps(report))
    return folder

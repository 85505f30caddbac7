"""What the table of a batch shows of a result: scores, notes and a small picture."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from semgs.batch.tasks import Task
from semgs.data.scenes import open_scene
from semgs.files.atomic import write_bytes
from semgs.files.images.pictures import jpeg_bytes, read_rgb
from semgs.files.strict_json import read_json

SCORES = ("psnr", "miou", "accuracy", "depth_error")
"""The scores of a report that are shown, if it has them."""

WIDTH, QUALITY = 160, 80
"""Width of a picture [px], and its JPEG quality."""

REPORTED = ("reconstruct", "label-splat")
"""Commands that write a report."""


def read_scores(task: Task) -> dict[str, float]:
    """Mean scores of the held-out views, or of the input views if there are none, of a report; nothing for other commands.

    Raises:
        InputError: the report is damaged.
    """
    if task.command not in REPORTED:
        return {}
    report = read_json(task.out / task.result / "report.json", "a report")
    means = report["means"]["target"] or report["means"]["context"]
    scores = {name: float(means[name]) for name in SCORES if means.get(name) is not None}
    return {**scores, "gaussians": float(report["gaussians"])}


def write_picture(task: Task, path: Path) -> None:
    """Write a small picture: the first held-out rendering, or a photo of the scene; nothing if there is neither.

    Raises:
        InputError: an image is damaged.
        OSError: it cannot be written.
    """
    pixels = next(_images(task), None)
    if pixels is None:
        return
    size = (WIDTH, max(1, round(WIDTH * pixels.shape[0] / pixels.shape[1])))
    small = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    path.parent.mkdir(exist_ok=True)
    write_bytes(path, jpeg_bytes(small, QUALITY))


def _images(task: Task) -> Iterator[UInt8[np.ndarray, "h w 3"]]:
    """Images of a scene, the best one first."""
    result = task.out / task.result
    renders = (task.scene if task.command == "export" else result) / "renders"
    for pattern in ("target_*_image.png", "context_*_image.png"):
        yield from map(read_rgb, sorted(renders.glob(pattern)))
    if task.command == "poses":
        yield from map(read_rgb, sorted((result / "images").glob("*")))
    elif task.command in ("doctor", "label"):
        yield from (frame.read_image() for frame in open_scene(task.scene).frames)

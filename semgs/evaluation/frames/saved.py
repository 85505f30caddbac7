"""Saved predictions as a method: label maps, images and depths from any source, checked before they are scored.

See `semgs.evaluation.frames.predictions` for the files.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int32, UInt8
from torch import Tensor

from semgs.data.maps import read_labels
from semgs.data.tables.classes import ClassTable
from semgs.evaluation.frames.frame_plan import FramePlan, Task
from semgs.evaluation.frames.predictions import Inputs, Prediction
from semgs.figures.view_images import MILLIMETRES
from semgs.files.arrays import read_map
from semgs.files.errors import InputError
from semgs.files.images.pictures import read_header, read_numbers, read_rgb, read_uint16
from semgs.files.paths import found_at
from semgs.files.strict_json import read_json
from semgs.files.text import listed

KINDS = {
    "labels": (".png",),
    "colour": (".colour.png",),
    "depth": (".depth.png", ".depth.npy"),
    "things": (".instance.png",),
}
"""What can be predicted, and the file endings, in the order in which they are tried."""

TIMING = "timing.json"


class SavedPredictions:
    """Predictions in files, as a method.

    Args:
        folder: contains N2/, N3/, ...
        name: of the method in tables.
    """

    def __init__(self, folder: str | Path, name: str) -> None:
        self.folder = Path(folder)
        self.name = name

    def check(self, plan: FramePlan) -> None:
        """Refuse incomplete predictions, or predictions of the wrong size, before any is scored.

        A kind (labels, colour, depth) may be missing for all targets. Classes and depths are not needed for scenes without
        true classes or depths.

        Raises:
            InputError: a kind exists for some targets only, there are no predictions at all, or an image has another size than
                the evaluation. The error names the frames.
        """
        for views in plan.views:
            missing = {kind: self._missing(kind, plan.of(views)) for kind in KINDS}
            given = [kind for kind, (asked, absent) in missing.items() if len(absent) < asked]
            for kind in given or (["labels"] if missing["labels"][0] else ["colour"]):
                asked, absent = missing[kind]
                if absent:
                    raise InputError(
                        self.folder,
                        f"{'labels' if kind == 'labels' else f'a file of {kind}'} of all {asked} targets of {views} views",
                        f"none of {listed(absent, 6)}",
                    )
        wrong = []
        for task in plan.tasks:
            for kind in KINDS:
                path = self._file(kind, task)
                if path is not None and path.suffix == ".png" and read_header(path).size != task.size:
                    height, width = read_header(path).size
                    wrong.append(f"{path.relative_to(self.folder)} ({height}x{width})")
        if wrong:
            sizes = sorted({f"{task.size[0]}x{task.size[1]}" for task in plan.tasks})
            raise InputError(
                self.folder, f"images of {' and '.join(sizes)} pixels (height x width)", f"others: {listed(wrong, 6)}"
            )

    def predict(self, inputs: Inputs) -> Prediction:
        """The prediction in the files; raises as `read`."""
        return self.read(inputs.task)

    def read(self, task: Task) -> Prediction:
        """Read the prediction for the target of a task.

        Raises:
            InputError: a file cannot be used, or contains a label outside the scene's class table.
        """
        labels, colour, depth, things = (self._file(kind, task) for kind in KINDS)
        seconds = _timing(self.folder / f"N{task.views}" / TIMING)
        return Prediction(
            labels=None if labels is None or task.scene.classes is None else _labels(labels, task, task.scene.classes),
            image=None if colour is None else _picture(colour, task),
            depths=None if depth is None else _depths(depth, task),
            instances=None if things is None else _things(things, task),
            seconds_encode=seconds.get("seconds_encode"),
            seconds_render=seconds.get("seconds_render"),
        )

    def _file(self, kind: str, task: Task) -> Path | None:
        """The file of a kind; None if there is none."""
        paths = (self.folder / f"{task.stem}{ending}" for ending in KINDS[kind])
        return next((path for path in paths if path.is_file()), None)

    def _missing(self, kind: str, tasks: tuple[Task, ...]) -> tuple[int, list[str]]:
        """For how many targets a kind is needed, and which files are missing."""
        if kind != "colour":
            attribute = {"labels": "labels", "depth": "depth", "things": "instances"}[kind]
            tasks = tuple(task for task in tasks if getattr(task.scene.frames[task.sample.target], attribute))
        return len(tasks), [f"{task.stem}{KINDS[kind][0]}" for task in tasks if self._file(kind, task) is None]


def find_view_counts(folder: Path) -> tuple[int, ...]:
    """The numbers of views for which a predictions folder has a subfolder, ascending.

    Raises:
        InputError: it is no folder, or has no such subfolder.
    """
    if not folder.is_dir():
        raise InputError(folder, "a folder of predictions", found_at(folder))
    names = [child.name[1:] for child in folder.iterdir() if child.is_dir() and child.name.startswith("N")]
    found = tuple(sorted(int(name) for name in names if name.isdecimal() and int(name) >= 2))
    if not found:
        raise InputError(folder, "folders N2, N3, ... with the predictions from 2, 3, ... views", "none of them")
    return found


def _labels(path: Path, task: Task, classes: ClassTable) -> UInt8[Tensor, "h w"]:
    """Predicted labels."""
    labels = read_labels(path, classes, key=f"target {task.target} of {task.scene.name}")
    return torch.from_numpy(_of_size(path, labels, task))


def _picture(path: Path, task: Task) -> Float[Tensor, "3 h w"]:
    """A predicted image."""
    return torch.from_numpy(read_rgb(path, task.size)).permute(2, 0, 1).float() / 255


def _depths(path: Path, task: Task) -> Float[Tensor, "h w"]:
    """A predicted depth map; depths that are negative or not finite become 0."""
    if path.suffix == ".png":
        depths = read_uint16(path).astype(np.float32) / MILLIMETRES
    else:
        loaded = read_map(path)
        if loaded.dtype.kind != "f":
            raise InputError(path, "a floating-point array [height width]", f"{loaded.dtype}")
        depths = loaded.astype(np.float32)
    depths = _of_size(path, depths, task)
    return torch.from_numpy(np.where(np.isfinite(depths) & (depths > 0), depths, np.float32(0)))


def _things(path: Path, task: Task) -> Int32[Tensor, "h w"]:
    """Predicted numbers of things."""
    return torch.from_numpy(_of_size(path, read_numbers(path).astype(np.int32), task))


def _of_size(path: Path, values: np.ndarray, task: Task) -> np.ndarray:
    """The array, if it has the size of the evaluation."""
    if values.shape != task.size:
        raise InputError(path, f"{task.size} (height, width)", f"{values.shape}")
    return values


def _timing(path: Path) -> dict[str, float]:
    """The seconds in a timing file; empty if there is no file."""
    if not path.is_file():
        return {}
    content = read_json(path, "a JSON object")
    known = ("seconds_encode", "seconds_render")
    if not isinstance(content, dict):
        raise InputError(path, f"a JSON object with {' and '.join(known)}", f"{content!r:.40}")
    found = {}
    for key in known:
        value = content.get(key)
        if value is None:
            continue
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0 <= value < math.inf:
            raise InputError(path, "seconds", f"{value!r:.40}", key=key)
        found[key] = float(value)
    return found

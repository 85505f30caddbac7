"""Predictions: what a method gives for a target, in memory and in files that any method can write.

Files of target "images/0001.jpg" of scene "living", from two views (`N2/living/0001`):

    .png            class of each pixel, 8 bits, position in the class table; 255 = no prediction
    .colour.png     image, 8-bit RGB
    .depth.png      z-depth in millimetres, 16 bits, 0 = none; or
    .depth.npy      z-depth in the scene's unit, floating point [h w]
    .instance.png   number of the thing at each pixel, 16 bits, 0 = none; in a thing, pixels have one class
    .unseen.png     255 where the method saw nothing, else 0; never read
    N2/timing.json  {"seconds_encode": ..., "seconds_render": ...} per target

All have the size of the evaluation. `semgs evaluate` writes its own predictions in this format, so they can be scored again.
"""

from __future__ import annotations

import io
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float, Float64, Int32, UInt8
from torch import Tensor

from semgs.data.views import Views
from semgs.evaluation.frames.frame_plan import Task
from semgs.evaluation.frames.free_space import FreeSpace
from semgs.figures.view_images import as_bytes, millimetres
from semgs.files.atomic import write_bytes
from semgs.files.images.pictures import write_png
from semgs.geometry.cameras import Cameras
from semgs.robotics.boxes import Box


@dataclass(frozen=True, eq=False)
class Inputs:
    """What a method gets for one target.

    Attributes:
        task: the target.
        contexts: images, cameras and bounds of the contexts in the order of the protocol, without labels and depths.
        camera: of the target [1].
        measured: the contexts with their true depth, to score free space, or to place Gaussians by it if the user wants that; no other prediction may use it.
            None if they have none.
    """

    task: Task
    contexts: Views
    camera: Cameras
    measured: Views | None = None


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a method predicts for one target; None for what it does not predict.

    Attributes:
        labels: the class of each pixel, 255 = no prediction.
        image: RGB, 0..1 (clamped for the comparison).
        depths: z-depth, 0 = none [m, or the scene's unit].
        unseen: where the method saw nothing, whatever it predicts there.
        confidences: the probability of the predicted class, calibrated if possible; 0 where the method saw nothing.
        seconds_encode: from its inputs to its scene; None if not measured.
        seconds_render: from its scene to this view.
        one_pass: what the method predicts before it refines its scene; None if it does not refine.
        instances: the number of the thing at each pixel, 0 = none; None if things are not searched.
        boxes: class and box of each thing of the scene, in the level frame; None if things are not searched, or without boxes.
        free_space: scores of the map of free space; None if it is not requested or cannot be scored.
        level_from_world: from the world of the contexts to that frame, a rotation.
    """

    labels: UInt8[Tensor, "h w"] | None = None
    image: Float[Tensor, "3 h w"] | None = None
    depths: Float[Tensor, "h w"] | None = None
    unseen: Bool[Tensor, "h w"] | None = None
    seconds_encode: float | None = None
    seconds_render: float | None = None
    confidences: Float[Tensor, "h w"] | None = None
    one_pass: Prediction | None = None
    instances: Int32[Tensor, "h w"] | None = None
    boxes: tuple[tuple[int, Box], ...] | None = None
    level_from_world: Float64[np.ndarray, "3 3"] | None = None
    free_space: FreeSpace | None = None

    def copy(self) -> Prediction:
        """A copy with its own memory."""
        held: dict[str, Any] = {name: value.clone() for name, value in vars(self).items() if isinstance(value, Tensor)}
        return replace(self, **held, one_pass=None if self.one_pass is None else self.one_pass.copy())


@runtime_checkable
class Method(Protocol):
    """A method to evaluate.

    Attributes:
        name: in tables.
    """

    name: str

    def predict(self, inputs: Inputs) -> Prediction:
        """Its prediction for a target."""
        ...


def write_prediction(folder: Path, task: Task, prediction: Prediction) -> None:
    """Write the prediction for a target into a predictions folder.

    Raises:
        OSError: a file cannot be written.
    """
    write_maps(folder, task.stem, prediction, task.scene.unit == "metric")
    if prediction.unseen is not None:
        write_png(folder / f"{task.stem}.unseen.png", prediction.unseen.numpy().astype(np.uint8) * 255)
    if prediction.instances is not None:
        write_png(folder / f"{task.stem}.instance.png", prediction.instances.numpy().astype(np.uint16))


def write_maps(folder: Path, stem: str, maps: Prediction, metric: bool) -> None:
    """Write labels, image and depth, each if it is given.

    Raises:
        OSError: a file cannot be written.
    """
    (folder / stem).parent.mkdir(parents=True, exist_ok=True)
    if maps.labels is not None:
        write_png(folder / f"{stem}.png", maps.labels.numpy())
    if maps.image is not None:
        write_png(folder / f"{stem}.colour.png", as_bytes(maps.image))
    if maps.depths is not None and metric:
        write_png(folder / f"{stem}.depth.png", millimetres(maps.depths))
    elif maps.depths is not None:
        buffer = io.BytesIO()
        np.save(buffer, maps.depths.float().numpy())
        write_bytes(folder / f"{stem}.depth.npy", buffer.getvalue())

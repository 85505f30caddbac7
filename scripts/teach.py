"""Predict classes with a published segmentation network for all images of some scenes, for `semgs train --teacher OUT`.

    python scripts/teach.py NETWORK.tflite OUT SCENES [SCENES ...]
    python scripts/teach.py NETWORK.tflite OUT SCENES --table TABLE.npy --beside WEIGHTS [--share SHARE]

NETWORK is a segmentation network for LiteRT that maps uint8 images to class indices, such as MOSAIC of MLPerf Mobile. LiteRT is no
dependency of semgs; install it with pip install ai-edge-litert. SCENES are what `semgs train --data` takes. Each image is resized to the
network's input size. The softmax of the logits, averaged to an eighth of the image's size, is saved to OUT/SOURCE/SCENE.npy as float16
[frame rows columns class]. All images of a scene get maps of one size, that of the first. Existing files are skipped, so you can repeat the command after adding scenes.

With --table, the probabilities become those of SemGS's classes: TABLE [class of NETWORK, class of SemGS] has the share of each class of
NETWORK that is each class of SemGS. With --beside, SHARE of them (a half) is mixed with what WEIGHTS say of each image by itself, both as
means with the mirrored image. Such a teacher is for `semgs train --teacher-target classes`.
"""

from __future__ import annotations

import argparse
import io
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch

from semgs.data.resampling import default_size, resized
from semgs.data.scenes import open_scene, scene_paths
from semgs.data.views import Views
from semgs.files.atomic import write_bytes
from semgs.model.semgs import SemGS
from semgs.model.weights.load import load
from semgs.training.data.augmentation import flip
from semgs.training.data.teacher import STRIDE, Teacher

AFTER_LOGITS = ("ARG_MAX", "RESIZE_BILINEAR", "RESIZE_NEAREST_NEIGHBOR", "CAST", "SQUEEZE")
"""Operators after the logits, which turn them into class indices."""


class Segmenter:
    """Gives the class probabilities of a LiteRT network whose output is class indices.

    Args:
        path: the .tflite file.
        threads: number of threads.
    """

    def __init__(self, path: Path, threads: int = 1) -> None:
        from ai_edge_litert.interpreter import Interpreter

        self._network: Any = Interpreter(str(path), num_threads=threads, experimental_preserve_all_tensors=True)
        self._network.allocate_tensors()
        given = self._network.get_input_details()[0]
        self._input, self._size = given["index"], tuple(int(side) for side in given["shape"][1:3])
        made_by = {}
        for one in self._network._get_ops_details():
            for output in one["outputs"]:
                made_by.setdefault(int(output), one)  # the network's own operators come before those of delegates
        self._logits = self._network.get_output_details()[0]["index"]
        while made_by[self._logits]["op_name"] in AFTER_LOGITS:
            self._logits = int(made_by[self._logits]["inputs"][0])
        details = {one["index"]: one for one in self._network.get_tensor_details()}
        self._scale, self._zero = details[self._logits]["quantization"]

    def probabilities(self, image: np.ndarray) -> np.ndarray:
        """Class probabilities [rows columns class] of an image [h w 3], uint8, at the resolution of the logits."""
        small = cv2.resize(image, self._size[::-1], interpolation=cv2.INTER_AREA)
        self._network.set_tensor(self._input, small[None])
        self._network.invoke()
        logits = (self._network.get_tensor(self._logits)[0].astype(np.float32) - self._zero) * (self._scale or 1)
        found = np.exp(logits - logits.max(-1, keepdims=True))
        return found / found.sum(-1, keepdims=True)


@dataclass(frozen=True)
class Mixture:
    """A published network, as it speaks of SemGS's classes, mixed with a network of SemGS.

    Attributes:
        table: from the published network's classes to others [class class]; None keeps its own.
        network: in evaluation mode, with the table's classes; None for the published network alone, without mirroring.
        share: of the published network.
    """

    table: np.ndarray | None = None
    network: SemGS | None = None
    share: float = 0.5

    def predict(self, views: Views, segmenter: Segmenter, size: tuple[int, int]) -> torch.Tensor:
        """Class probabilities of a view at a size (rows, columns) [1 class rows columns]."""
        if self.network is None:
            return self._published(views, segmenter, size)
        small = resized(views, default_size(views.size))
        maps = torch.zeros(())
        for mirrored in (False, True):
            seen, own = (flip(views), flip(small)) if mirrored else (views, small)
            with torch.no_grad():
                classes = torch.nn.functional.interpolate(
                    self.network.classify(own, alone=True), size=size, mode="area"
                )
            mixed = self.share * self._published(seen, segmenter, size) + (1 - self.share) * classes
            maps = maps + (mixed.flip(-1) if mirrored else mixed) / 2
        return maps

    def _published(self, views: Views, segmenter: Segmenter, size: tuple[int, int]) -> torch.Tensor:
        """What the published network says, through the table."""
        image = np.rint(255 * views.images[0].permute(1, 2, 0).numpy()).astype(np.uint8)
        found = segmenter.probabilities(np.ascontiguousarray(image))
        if self.table is not None:
            found = found @ self.table
        maps = torch.from_numpy(found.astype(np.float32)).permute(2, 0, 1)[None]
        return torch.nn.functional.interpolate(maps, size=size, mode="area")


def predicted(views: Views, segmenter: Segmenter, size: tuple[int, int], mixture: Mixture) -> np.ndarray:
    """Class probabilities of a view at a size (rows, columns), float16 [1 rows columns class]."""
    return mixture.predict(views, segmenter, size).permute(0, 2, 3, 1).numpy().astype(np.float16)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("network", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--table", type=Path)
    parser.add_argument("--beside", metavar="WEIGHTS")
    parser.add_argument("--share", type=float, default=0.5)
    given = parser.parse_args()
    if given.beside and not given.table:
        parser.error("--beside needs --table")
    torch.set_num_threads(1)
    table = None if given.table is None else np.load(given.table)
    mixture = Mixture(table, load(given.beside).eval() if given.beside else None, given.share)
    segmenter, count, began = Segmenter(given.network), 0, time.process_time()
    for path in [path for scenes in given.scenes for path in scene_paths(scenes)]:
        scene = open_scene(path.absolute(), needs_cameras=False)
        file = Teacher(given.out, 0).path(scene)
        if file.exists():
            continue
        height, width = scene.frames[0].lens.size
        size = height // STRIDE, width // STRIDE
        found = np.concatenate([predicted(frame.view((1, 2)), segmenter, size, mixture) for frame in scene.frames])
        file.parent.mkdir(parents=True, exist_ok=True)
        data = io.BytesIO()
        np.save(data, found)
        write_bytes(file, data.getbuffer())
        count += len(found)
    print(f"{count} images, {time.process_time() - began:.0f} core-seconds")

"""Predict classes with a published segmentation network for all images of some scenes, for `semgs train --teacher OUT`.

    python scripts/teach.py NETWORK.tflite OUT SCENES [SCENES ...]

NETWORK is a segmentation network for LiteRT that maps uint8 images to class indices, such as MOSAIC of MLPerf Mobile. LiteRT is no
dependency of semgs; install it with pip install ai-edge-litert. SCENES are what `semgs train --data` takes. Each image is resized to the
network's input size. The softmax of the logits, averaged to an eighth of the image's size, is saved to OUT/SOURCE/SCENE.npy as float16
[frame rows columns class]. Existing files are skipped, so you can repeat the command after adding scenes.
"""

from __future__ import annotations

import argparse
import io
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch

from semgs.data.scenes import open_scene, scene_paths
from semgs.data.views import Views
from semgs.files.atomic import write_bytes
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


def predicted(views: Views, segmenter: Segmenter, size: tuple[int, int]) -> np.ndarray:
    """Class probabilities of a view at a size (rows, columns), float16 [1 rows columns class]."""
    image = np.rint(255 * views.images[0].permute(1, 2, 0).numpy()).astype(np.uint8)
    found = segmenter.probabilities(np.ascontiguousarray(image))
    maps = torch.from_numpy(found).permute(2, 0, 1)[None]
    small = torch.nn.functional.interpolate(maps, size=size, mode="area")
    return small.permute(0, 2, 3, 1).numpy().astype(np.float16)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("network", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", nargs="+")
    given = parser.parse_args()
    torch.set_num_threads(1)
    segmenter, count, began = Segmenter(given.network), 0, time.process_time()
    for path in [path for scenes in given.scenes for path in scene_paths(scenes)]:
        scene = open_scene(path.absolute(), needs_cameras=False)
        file = Teacher(given.out, 0).path(scene)
        if file.exists():
            continue
        height, width = scene.frames[0].lens.size
        size = height // STRIDE, width // STRIDE
        found = np.concatenate([predicted(frame.view((1, 2)), segmenter, size) for frame in scene.frames])
        file.parent.mkdir(parents=True, exist_ok=True)
        data = io.BytesIO()
        np.save(data, found)
        write_bytes(file, data.getbuffer())
        count += len(found)
    print(f"{count} images, {time.process_time() - began:.0f} core-seconds")

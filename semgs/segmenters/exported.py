"""Segmentation networks in files, exported for a runtime, as `semgs.sources.network_files` describes them, with two more keys:

"classes": ["wall", "building", "sky"]     names in the order of the network
"output": "logits"                         or "probabilities", or "class numbers"
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, final, get_args

import numpy as np
import torch
from jaxtyping import Float32, UInt8

from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.files.errors import InputError, input_error
from semgs.segmenters.class_map_files import SUMS_TO_1
from semgs.segmenters.tables import make_class_table
from semgs.sources.network_files import (
    ArrayNetwork,
    InputDescription,
    description_of,
    open_network_file,
    read_description,
    run_on,
)
from semgs.sources.photo_maps import normalised, one_hot
from semgs.sources.source import MadeBy

Output = Literal["logits", "probabilities", "class numbers"]


@dataclass(frozen=True)
class Description:
    """What a segmenter expects and gives.

    Attributes:
        input: what it expects.
        classes: the table of its answers.
        output: what comes out.
    """

    input: InputDescription
    classes: ClassTable
    output: Output

    def distribution_of(self, found: np.ndarray) -> Float32[np.ndarray, "class rows columns"]:
        """The distribution over the classes, from what the network gave for one image.

        Raises:
            ValueError: it is not of this kind.
        """
        count = len(self.classes)
        if self.output == "class numbers":
            maps = found if found.ndim == 4 else found.reshape(1, -1, *found.shape[-2:]) if found.ndim > 1 else None
            maps = None if maps is None else self._channels_first(maps, 1)
            if maps is None or found.dtype.kind not in "iu":
                raise ValueError(f"{found.dtype} of shape {found.shape} instead of whole numbers [height width]")
            numbers = maps[0]
            if numbers.min() < 0 or numbers.max() >= count:
                wrong = numbers.min() if numbers.min() < 0 else numbers.max()
                raise ValueError(f"class number {wrong}, outside 0 to {count - 1}")
            return one_hot(torch.from_numpy(numbers.astype(np.uint8)), count).numpy()
        maps = self._channels_first(found, count)
        if maps is None:
            raise ValueError(
                f"shape {found.shape} instead of one image with {count} classes along axis 1 (NCHW) or 3 (NHWC)"
            )
        values = torch.from_numpy(maps.astype(np.float32))
        if not values.isfinite().all():
            raise ValueError("NaN or infinity")
        if self.output == "logits":
            return values.softmax(0).numpy()
        if values.min() < 0 or (off := float((values.sum(0) - 1).abs().max())) > SUMS_TO_1:
            raise ValueError(
                "negative numbers" if values.min() < 0 else f"sums over the classes that are off 1 by up to {off:.2g}"
            )
        return normalised(values).numpy()

    def _channels_first(self, found: np.ndarray, count: int) -> np.ndarray | None:
        """An output as [count rows columns], from the layout of the input or else from the other; None if it fits neither."""
        axes = (1, 3) if self.input.layout == "NCHW" else (3, 1)
        if found.ndim != 4 or found.shape[0] != 1:
            return None
        axis = next((axis for axis in axes if found.shape[axis] == count), None)
        return None if axis is None else np.moveaxis(found[0], axis - 1, 0)


@final
@dataclass(frozen=True)
class Exported:
    """A network in a file; a `Segmenter`.

    Attributes:
        path: of the file.
        description: what it expects and gives.
        network: runs it.
        made_by: which one it is.
    """

    path: Path
    description: Description
    network: ArrayNetwork
    made_by: MadeBy

    @property
    def classes(self) -> ClassTable:
        """The network's own table."""
        return self.description.classes

    def __call__(self, image: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "class rows columns"]:
        """The distribution over the classes, at the network's own resolution.

        Args:
            image: RGB.

        Raises:
            InputError: the network cannot take the image, or gives something else than its description says.
        """
        found = run_on(image, self.path, self.network, self.description.input)
        with input_error(self.path, f"{self.description.output} that fit {self.path.with_suffix('.json').name}"):
            return self.description.distribution_of(found)


def open_exported(path: Path) -> Exported:
    """Open a `.onnx` or `.tflite` file with its description.

    Raises:
        InputError: one of the files is missing or damaged, or they contradict each other.
        ImportError: the library that runs it is not installed.
    """
    description = read_segmenter(description_of(path))
    classes = None if description.output == "class numbers" else len(description.classes)
    network, made_by = open_network_file(path, description.input, classes)
    return Exported(path, description, network, made_by)


def read_segmenter(path: Path) -> Description:
    """The description of a segmenter in a file.

    Raises:
        InputError: it is missing, or not as at the head of this module; the error names the key.
    """
    found, inputs = read_description(path, ("classes", "output"), {"output": get_args(Output)})
    names = found["classes"]
    if not isinstance(names, list) or not all(isinstance(name, str) and name.strip() for name in names):
        raise InputError(path, "a list of names", f"{names!r:.60}", key="classes")
    with input_error(path, f"1 to {IGNORE} different names", key="classes"):
        classes = make_class_table(path.stem, names)
    return Description(inputs, classes, found["output"])

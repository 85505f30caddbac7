"""Segmentation networks in files, exported for a runtime: `NAME.onnx` or `NAME.tflite`, with a description `NAME.json` beside it.

    {"size": [512, 512],                       height and width of the input in pixels, or "any" for those of the photo
     "scaling": {"mean": [0.485, 0.456, 0.406], "std": [0.229, 0.224, 0.225]},
     "layout": "NCHW",                         or "NHWC": the order of axes, of the input and of the output
     "dtype": "float32",                       of the input: float32, float16, uint8 or int8
     "classes": ["wall", "building", "sky"],   names in the order of the network
     "output": "logits",                       or "probabilities", or "class numbers"
     "tensor": "decoder/add",                  optional: which output; in .tflite files also an inner tensor
     "licence": "Apache-2.0"}                  optional

The scaling is (pixel / 255 - mean) / std, or, with {"offset": 128, "scale": 128}, (pixel - offset) / scale: a number, or one each for red, green and
blue. The network sees the whole photo, resized to its size without cropping.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Protocol, cast, final, get_args, runtime_checkable

import cv2
import numpy as np
import torch
from jaxtyping import Float32, UInt8

from semgs.data.tables.classes import IGNORE, ClassTable
from semgs.files.errors import InputError, input_error
from semgs.files.hashes import sha256
from semgs.files.strict_json import read_json
from semgs.segmenters.class_map_files import SUMS_TO_1, MadeBy
from semgs.segmenters.networks.litert import LiteRTNetwork
from semgs.segmenters.networks.onnx import OnnxNetwork
from semgs.segmenters.photo_maps import normalised, one_hot
from semgs.segmenters.tables import make_class_table

Layout = Literal["NCHW", "NHWC"]
DType = Literal["float32", "float16", "uint8", "int8"]
Output = Literal["logits", "probabilities", "class numbers"]

ENDINGS = (".onnx", ".tflite")
"""Of the files that can be opened."""

LEAST_SCALE = 1e-6
"""Pixels are not divided by less."""

REQUIRED = ("size", "scaling", "layout", "dtype", "classes", "output")
OPTIONAL = ("tensor", "licence")


@runtime_checkable
class ArrayNetwork(Protocol):
    """A network with one input and one output, as arrays."""

    shape: tuple[int | None, ...]
    dtype: str

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """The output for an input.

        Raises:
            ValueError: the network refuses the input.
        """
        ...


@dataclass(frozen=True)
class Description:
    """What a network expects and gives.

    Attributes:
        size: (height, width) of the input [px]; None for any.
        offset, scale: of red, green and blue: the network's numbers are (pixel - offset) / scale, for pixels from 0 to 255.
        layout: the order of axes.
        dtype: of the input.
        classes: the table of its answers.
        output: what comes out.
        tensor: name of the output; None for the only one.
        licence: of the network.
    """

    size: tuple[int, int] | None
    offset: Float32[np.ndarray, " rgb=3"]
    scale: Float32[np.ndarray, " rgb=3"]
    layout: Layout
    dtype: DType
    classes: ClassTable
    output: Output
    tensor: str | None = None
    licence: str = "unknown"

    @property
    def shape(self) -> tuple[int | None, ...]:
        """Of the input; None along an axis that may have any length."""
        sides = self.size or (None, None)
        return (1, 3, *sides) if self.layout == "NCHW" else (1, *sides, 3)

    def input_of(self, image: UInt8[np.ndarray, "h w 3"]) -> np.ndarray:
        """An image as the network takes it."""
        height, width = self.size or image.shape[:2]
        if (height, width) != image.shape[:2]:
            shrinks = height <= image.shape[0] and width <= image.shape[1]
            image = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
        values = (image - self.offset) / self.scale
        if not self.dtype.startswith("float"):
            bounds = np.iinfo(self.dtype)
            values = np.clip(np.rint(values), bounds.min, bounds.max)
        axes = values.transpose(2, 0, 1) if self.layout == "NCHW" else values
        return np.ascontiguousarray(axes[None], self.dtype)

    def distribution_of(self, found: np.ndarray) -> Float32[np.ndarray, "class rows columns"]:
        """The distribution over the classes, from what the network gave for one image.

        Raises:
            ValueError: it is not of this kind.
        """
        count = len(self.classes)
        if self.output == "class numbers":
            alone = found.shape[:-2] if self.layout == "NCHW" or found.ndim < 4 else (found.shape[0], found.shape[3])
            if found.ndim < 2 or found.dtype.kind not in "iu" or any(side != 1 for side in alone):
                raise ValueError(f"{found.dtype} of shape {found.shape} instead of whole numbers [height width]")
            numbers = found.reshape(found.shape[-2:] if alone == found.shape[:-2] else found.shape[1:3])
            if numbers.min() < 0 or numbers.max() >= count:
                wrong = numbers.min() if numbers.min() < 0 else numbers.max()
                raise ValueError(f"class number {wrong}, outside 0 to {count - 1}")
            return one_hot(torch.from_numpy(numbers.astype(np.uint8)), count).numpy()
        axis = 1 if self.layout == "NCHW" else 3
        if found.ndim != 4 or found.shape[0] != 1 or found.shape[axis] != count:
            raise ValueError(
                f"shape {found.shape} instead of one image with {count} classes along axis {axis} ({self.layout})"
            )
        values = torch.from_numpy(np.moveaxis(found[0], axis - 1, 0).astype(np.float32))
        if not values.isfinite().all():
            raise ValueError("NaN or infinity")
        if self.output == "logits":
            return values.softmax(0).numpy()
        if values.min() < 0 or (off := float((values.sum(0) - 1).abs().max())) > SUMS_TO_1:
            raise ValueError(
                "negative numbers" if values.min() < 0 else f"sums over the classes that are off 1 by up to {off:.2g}"
            )
        return normalised(values).numpy()


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
        values = self.description.input_of(image)
        height, width = image.shape[:2]
        with input_error(self.path, f"a network that can take an image of {height}x{width} (height x width)"):
            found = self.network(values)
        with input_error(self.path, f"{self.description.output} that fit {described_in(self.path).name}"):
            return self.description.distribution_of(found)


def open_exported(path: Path) -> Exported:
    """Open a `.onnx` or `.tflite` file with its description.

    Raises:
        InputError: one of the files is missing or damaged, or they contradict each other.
        ImportError: the library that runs it is not installed.
    """
    beside = described_in(path)
    if not path.is_file():
        raise InputError(path, "an exported network", "nothing")
    description = read_description(beside)
    network = _network(path, description.tensor)
    if network.dtype != description.dtype:
        raise InputError(beside, f"{network.dtype}, as in {path.name}", description.dtype, key="dtype")
    if not fits(description.shape, network.shape):
        other = replace(description, layout="NHWC" if description.layout == "NCHW" else "NCHW")
        place = "layout" if fits(other.shape, network.shape) else "size"
        raise InputError(
            beside, f"an input of {path.name}: {_shown(network.shape)}", _shown(description.shape), key=place
        )
    made_by = MadeBy(path.name, f"{sha256(path)} {sha256(beside)}", description.licence)
    return Exported(path, description, network, made_by)


def described_in(path: Path) -> Path:
    """The file with the description of a network."""
    return path.with_suffix(".json")


def read_description(path: Path) -> Description:
    """The description in a file.

    Raises:
        InputError: it is missing, or not as at the head of this module; the error names the key.
    """
    found: Any = read_json(path, "the description of an exported network", advice="see docs/segmenters.md")
    if not isinstance(found, dict):
        raise InputError(path, "an object", f"{found!r:.60}")
    if unknown := sorted(found.keys() - {*REQUIRED, *OPTIONAL}):
        raise InputError(path, ", ".join((*REQUIRED, *OPTIONAL)), repr(unknown[0]))
    if missing := [key for key in REQUIRED if key not in found]:
        raise InputError(path, ", ".join(REQUIRED), f"no {missing[0]}")
    size = found["size"]
    if size != "any" and not (_numbers(size, 2) and all(type(side) is int and side > 0 for side in size)):
        raise InputError(path, '[height, width] in pixels, or "any"', repr(size), key="size")
    for key, choices in (("layout", Layout), ("dtype", DType), ("output", Output)):
        if found[key] not in get_args(choices):
            raise InputError(path, ", ".join(get_args(choices)), f"{found[key]!r:.60}", key=key)
    names = found["classes"]
    if not isinstance(names, list) or not all(isinstance(name, str) and name.strip() for name in names):
        raise InputError(path, "a list of names", f"{names!r:.60}", key="classes")
    with input_error(path, f"1 to {IGNORE} different names", key="classes"):
        classes = make_class_table(path.stem, names)
    for key in OPTIONAL:
        if key in found and not (isinstance(found[key], str) and found[key]):
            raise InputError(path, "text", f"{found[key]!r:.60}", key=key)
    offset, scale = _scaling(path, found["scaling"])
    return Description(
        size=None if size == "any" else (size[0], size[1]),
        offset=offset,
        scale=scale,
        layout=found["layout"],
        dtype=found["dtype"],
        classes=classes,
        output=found["output"],
        tensor=found.get("tensor"),
        licence=found.get("licence", "unknown"),
    )


def _network(path: Path, tensor: str | None) -> ArrayNetwork:
    """What runs a file.

    Raises:
        InputError, ImportError: as `open_exported`.
    """
    run = OnnxNetwork if path.suffix.lower() == ".onnx" else LiteRTNetwork
    return run(path, tensor, torch.get_num_threads())


def fits(described: Sequence[int | None], shape: Sequence[int | None]) -> bool:
    """Whether an input of one shape is one of another; None stands for any length."""
    return len(described) == len(shape) and all(b is None or a == b for a, b in zip(described, shape, strict=True))


def _scaling(path: Path, found: Any) -> tuple[Float32[np.ndarray, " rgb=3"], Float32[np.ndarray, " rgb=3"]]:
    """Offset and scale of pixels from 0 to 255, from the description's scaling.

    Raises:
        InputError: it is not one.
    """
    pairs = (("mean", "std"), ("offset", "scale"))
    pair = next((pair for pair in pairs if isinstance(found, dict) and found.keys() == set(pair)), None)
    if pair is None:
        raise InputError(path, "an object with mean and std, or with offset and scale", f"{found!r:.60}", key="scaling")
    values = []
    for key in pair:
        value = found[key]
        if not (_numbers(value, 3) or _numbers([value], 1)):
            raise InputError(path, "a number, or three", f"{value!r:.60}", key=f"scaling.{key}")
        values.append(np.broadcast_to(np.array(value, np.float32), 3))
    offset, scale = values
    if not (scale > LEAST_SCALE).all():
        raise InputError(path, "positive numbers", f"{found[pair[1]]!r:.60}", key=f"scaling.{pair[1]}")
    return (255 * offset, 255 * scale) if pair[0] == "mean" else (offset, scale)


def _numbers(value: Any, count: int) -> bool:
    """Whether a value is a list of that many finite numbers."""
    return (
        isinstance(value, list)
        and len(value) == count
        and all(type(one) in (int, float) and abs(cast(float, one)) < 1e9 for one in value)
    )


def _shown(shape: Sequence[int | None]) -> str:
    """A shape as text."""
    return f"[{', '.join('any' if side is None else str(side) for side in shape)}]"

"""Networks in files, exported for a runtime: `NAME.onnx` or `NAME.tflite`, with a description `NAME.json` beside it. What each expects:

    {"size": [512, 512],                       height and width of the input in pixels, or "any" for those of the photo
     "scaling": {"mean": [0.485, 0.456, 0.406], "std": [0.229, 0.224, 0.225]},
     "layout": "NCHW",                         or "NHWC": the order of axes of the input
     "dtype": "float32",                       of the input: float32, float16, uint8 or int8
     "tensor": "decoder/add",                  optional: which output; in .tflite files also an inner tensor
     "licence": "Apache-2.0"}                  optional

The scaling is (pixel / 255 - mean) / std, or, with {"offset": 128, "scale": 128}, (pixel - offset) / scale: a number, or one each for red, green and
blue. The network sees the whole photo, resized to its size without cropping. What comes out is said by further keys.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, cast, get_args

import cv2
import numpy as np
import torch
from jaxtyping import Float32, UInt8

from semgs.files.contents import sha256
from semgs.files.errors import InputError, input_error
from semgs.files.strict_json import read_json
from semgs.sources.runtimes import LiteRTNetwork, OnnxNetwork
from semgs.sources.source import MadeBy

ArrayNetwork = OnnxNetwork | LiteRTNetwork
"""A network with one input and one output, as arrays."""

Layout = Literal["NCHW", "NHWC"]
DType = Literal["float32", "float16", "uint8", "int8"]

ENDINGS = (".onnx", ".tflite")
"""Of the files that can be opened."""

LEAST_SCALE = 1e-6
"""Pixels are not divided by less."""

REQUIRED = ("size", "scaling", "layout", "dtype")
OPTIONAL = ("tensor", "licence")


@dataclass(frozen=True)
class InputDescription:
    """What a network expects.

    Attributes:
        size: (height, width) of the input [px]; None for any.
        offset, scale: of red, green and blue: the network's numbers are (pixel - offset) / scale, for pixels from 0 to 255.
        layout: the order of axes.
        dtype: of the input.
        tensor: name of the output; None for the only one.
        licence: of the network.
    """

    size: tuple[int, int] | None
    offset: Float32[np.ndarray, " rgb=3"]
    scale: Float32[np.ndarray, " rgb=3"]
    layout: Layout
    dtype: DType
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


def read_description(
    path: Path, required: Sequence[str], choices: dict[str, Sequence[str]]
) -> tuple[dict[str, Any], InputDescription]:
    """The description in a file: all of it, and what the network expects.

    Args:
        path: the file.
        required: keys beside `REQUIRED`.
        choices: of keys that have few values.

    Raises:
        InputError: it is missing, or not as at the head of this module; the error names the key.
    """
    found: Any = read_json(path, "the description of an exported network", advice="see docs/segmenters.md")
    if not isinstance(found, dict):
        raise InputError(path, "an object", f"{found!r:.60}")
    needed = (*REQUIRED, *required)
    if unknown := sorted(found.keys() - {*needed, *OPTIONAL}):
        raise InputError(path, ", ".join((*needed, *OPTIONAL)), repr(unknown[0]))
    if missing := [key for key in needed if key not in found]:
        raise InputError(path, ", ".join(needed), f"no {missing[0]}")
    size = found["size"]
    if size != "any" and not (_numbers(size, 2) and all(type(side) is int and side > 0 for side in size)):
        raise InputError(path, '[height, width] in pixels, or "any"', repr(size), key="size")
    for key, values in {"layout": get_args(Layout), "dtype": get_args(DType), **choices}.items():
        if found[key] not in values:
            raise InputError(path, ", ".join(values), f"{found[key]!r:.60}", key=key)
    for key in OPTIONAL:
        if key in found and not (isinstance(found[key], str) and found[key]):
            raise InputError(path, "text", f"{found[key]!r:.60}", key=key)
    offset, scale = _scaling(path, found["scaling"])
    sides = None if size == "any" else (size[0], size[1])
    said = {key: found[key] for key in OPTIONAL if key in found}
    return found, InputDescription(sides, offset, scale, found["layout"], found["dtype"], **said)


def open_network_file(
    path: Path, description: InputDescription, classes: int | None = None
) -> tuple[ArrayNetwork, MadeBy]:
    """What runs a file, and which network it is.

    Args:
        path: the file.
        description: what it expects.
        classes: as for `several_outputs`.

    Raises:
        InputError: the file is damaged, or contradicts its description.
        ImportError: the library that runs it is not installed.
    """
    beside = path.with_suffix(".json")
    run = OnnxNetwork if path.suffix.lower() == ".onnx" else LiteRTNetwork
    network = run(path, description.tensor, torch.get_num_threads(), classes)
    if network.dtype != description.dtype:
        raise InputError(beside, f"{network.dtype}, as in {path.name}", description.dtype, key="dtype")
    if not fits(description.shape, network.shape):
        other = replace(description, layout="NHWC" if description.layout == "NCHW" else "NCHW")
        place = "layout" if fits(other.shape, network.shape) else "size"
        raise InputError(
            beside, f"an input of {path.name}: {_shown(network.shape)}", _shown(description.shape), key=place
        )
    return network, MadeBy(path.name, f"{sha256(path)} {sha256(beside)}", description.licence)


def run_on(
    image: UInt8[np.ndarray, "h w 3"], path: Path, network: ArrayNetwork, description: InputDescription
) -> np.ndarray:
    """What a network gives for an image.

    Raises:
        InputError: it cannot take the image; the error names its file.
    """
    height, width = image.shape[:2]
    with input_error(path, f"a network that can take an image of {height}x{width} (height x width)"):
        return network(description.input_of(image))


def description_of(path: Path) -> Path:
    """The file with the description of a network.

    Raises:
        InputError: there is no such network.
    """
    if not path.is_file():
        raise InputError(path, "an exported network", "nothing")
    return path.with_suffix(".json")


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

"""Writes small ONNX files byte by byte, as the format is specified: a message is a list of numbered fields (protobuf)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

TYPES = {"float32": 1, "uint8": 2, "int8": 3, "int64": 7, "float16": 10}
"""Numbers of the number types."""


def varint(number: int) -> bytes:
    """A whole number, seven bits a byte."""
    return bytes([number]) if number < 128 else bytes([number & 127 | 128]) + varint(number >> 7)


def field(place: int, value: int | str | bytes) -> bytes:
    """A field of a message: a number, or something with a length."""
    if isinstance(value, int):
        return varint(place << 3) + varint(value)
    data = value.encode() if isinstance(value, str) else value
    return varint(place << 3 | 2) + varint(len(data)) + data


def tensor(name: str, values: np.ndarray) -> bytes:
    """A constant."""
    sides = b"".join(field(1, side) for side in values.shape)
    return sides + field(2, TYPES[values.dtype.name]) + field(8, name) + field(9, values.tobytes())


def value(name: str, dtype: str, shape: Sequence[int | str]) -> bytes:
    """An input or output; a side that is text may have any length."""
    sides = b"".join(field(1, field(2 if isinstance(side, str) else 1, side)) for side in shape)
    return field(1, name) + field(2, field(1, field(1, TYPES[dtype]) + field(2, sides)))


def node(operator: str, inputs: Sequence[str], output: str, **attributes: int) -> bytes:
    """An operator with whole numbers as attributes."""
    data = b"".join(field(1, one) for one in inputs) + field(2, output) + field(4, operator)
    for name, number in attributes.items():
        data += field(5, field(1, name) + field(3, number) + field(20, 2))
    return data


def write_pixelwise(
    path: Path,
    weight: np.ndarray,
    bias: np.ndarray,
    *,
    shape: Sequence[int | str],
    outputs: dict[str, str],
    dtype: str = "float32",
) -> Path:
    """A network that multiplies each pixel with a matrix.

    Args:
        path: of the file.
        weight: [class 3].
        bias: [class].
        shape: of the input, (1, 3, height, width).
        outputs: of the file: names among "logits", "probabilities" and "numbers" [1 height width], and their number types.
        dtype: of the input.
    """
    nodes = [
        node("Cast", ["image"], "real", to=TYPES["float32"]),
        node("Conv", ["real", "weight", "bias"], "logits"),
        node("Softmax", ["logits"], "probabilities", axis=1),
        node("ArgMax", ["logits"], "numbers", axis=1, keepdims=0),
    ]
    graph = b"".join(field(1, one) for one in nodes) + field(2, "pixelwise")
    graph += field(5, tensor("weight", weight.astype(np.float32)[:, :, None, None]))
    graph += field(5, tensor("bias", bias.astype(np.float32)))
    graph += field(11, value("image", dtype, shape))
    for name, kind in outputs.items():
        sides = (1, *shape[2:]) if name == "numbers" else (1, len(weight), *shape[2:])
        graph += field(12, value(name, kind, sides))
    path.write_bytes(field(1, 8) + field(7, graph) + field(8, field(1, "") + field(2, 13)))
    return path

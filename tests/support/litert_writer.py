"""Writes small LiteRT files with the classes that ai-edge-litert generated from the format's schema."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def write_pixelwise(
    path: Path,
    weight: np.ndarray,
    bias: np.ndarray,
    size: tuple[int, int],
    quantised: tuple[float, int] | None = None,
) -> Path:
    """A network that multiplies each pixel of a float image [1 height width 3] with a matrix; its output is the number of the largest result.

    The results themselves, [1 height width class], are the inner tensor "inner/logits".

    Args:
        path: of the file.
        weight: [class 3].
        bias: [class].
        size: (height, width) of the input.
        quantised: scale and zero point; the output then is the results as uint8. None for the number of the largest.
    """
    import flatbuffers
    from ai_edge_litert import schema_py_generated as schema

    buffers = [schema.BufferT()]
    tensors = []

    def add(name: str, shape: tuple[int, ...], kind: int, values: np.ndarray | None = None) -> int:
        """A tensor, and its place."""
        one = schema.TensorT()
        one.name, one.shape, one.type, one.buffer = name, list(shape), kind, 0
        if values is not None:
            content = schema.BufferT()
            content.data = np.frombuffer(values.tobytes(), np.uint8)
            one.buffer = len(buffers)
            buffers.append(content)
        tensors.append(one)
        return len(tensors) - 1

    kinds = schema.TensorType
    count = len(weight)
    image = add("image", (1, *size, 3), kinds.FLOAT32)
    matrix = add("weight", (count, 1, 1, 3), kinds.FLOAT32, weight.astype(np.float32))
    shift = add("bias", (count,), kinds.FLOAT32, bias.astype(np.float32))
    logits = add("inner/logits", (1, *size, count), kinds.FLOAT32)
    axis = add("axis", (), kinds.INT32, np.array(3, np.int32))
    if quantised is None:
        output = add("numbers", (1, *size), kinds.INT64)
    else:
        output = add("quantised", (1, *size, count), kinds.UINT8)
        tensors[output].quantization = schema.QuantizationParametersT()
        tensors[output].quantization.scale, tensors[output].quantization.zeroPoint = [quantised[0]], [quantised[1]]

    convolve, last = schema.OperatorT(), schema.OperatorT()
    convolve.opcodeIndex, convolve.inputs, convolve.outputs = 0, [image, matrix, shift], [logits]
    convolve.builtinOptionsType = schema.BuiltinOptions.Conv2DOptions
    convolve.builtinOptions = schema.Conv2DOptionsT()
    convolve.builtinOptions.strideW = convolve.builtinOptions.strideH = 1
    last.opcodeIndex, last.inputs, last.outputs = 1, [logits], [output]
    if quantised is None:
        last.inputs.append(axis)
        last.builtinOptionsType = schema.BuiltinOptions.ArgMaxOptions
        last.builtinOptions = schema.ArgMaxOptionsT()
        last.builtinOptions.outputType = kinds.INT64

    graph = schema.SubGraphT()
    graph.tensors, graph.inputs, graph.outputs, graph.operators = tensors, [image], [output], [convolve, last]
    model = schema.ModelT()
    model.version, model.subgraphs, model.buffers = 3, [graph], buffers
    model.operatorCodes = []
    second = schema.BuiltinOperator.ARG_MAX if quantised is None else schema.BuiltinOperator.QUANTIZE
    for number in (schema.BuiltinOperator.CONV_2D, second):
        code = schema.OperatorCodeT()
        code.builtinCode = code.deprecatedBuiltinCode = number
        code.version = 1
        model.operatorCodes.append(code)
    builder = flatbuffers.Builder(1024)
    builder.Finish(model.Pack(builder), b"TFL3")
    path.write_bytes(builder.Output())
    return path

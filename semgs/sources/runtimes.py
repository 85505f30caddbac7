"""Runs networks in files, on the CPU: ONNX with onnxruntime, and LiteRT (TensorFlow Lite) with ai-edge-litert. ONNX files are simplified here, too."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, final

import numpy as np

from semgs.files.errors import InputError, needs_extra
from semgs.files.text import listed

DTYPES = {
    "tensor(float)": "float32",
    "tensor(float16)": "float16",
    "tensor(uint8)": "uint8",
    "tensor(int8)": "int8",
}
"""Names of number types: onnxruntime's, and NumPy's."""


@final
class OnnxNetwork:
    """A network with one input, and one of its outputs.

    Args:
        path: the file.
        tensor: name of the output; None for the only one.
        threads: number of threads.
        classes: as for `several_outputs`.

    Attributes:
        shape: of the input; None along an axis that may have any length.
        dtype: of the input.

    Raises:
        InputError: it cannot be read, has several inputs, or does not have that output.
        ImportError: onnxruntime is not installed; the message names the extra.
    """

    def __init__(self, path: Path, tensor: str | None, threads: int, classes: int | None = None) -> None:
        with needs_extra("onnx", f"{path} is an ONNX file; running it needs onnxruntime", "onnxruntime"):
            import onnxruntime
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.log_severity_level = 4  # errors are raised
        try:
            self._session: Any = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        except Exception as error:  # each kind of damage has its own class, without a common one
            raise InputError(path, "a network that onnxruntime can run", str(error)) from error
        given = self._session.get_inputs()
        if len(given) != 1:
            raise InputError(path, "one input", listed([one.name for one in given]) or "none")
        outputs = {one.name: _sides(one.shape) for one in self._session.get_outputs()}
        names = list(outputs)
        if tensor is None and len(names) != 1:
            raise several_outputs(path, outputs, classes)
        if tensor is not None and tensor not in names:
            raise InputError(path, f'the "tensor" of its JSON, {tensor}, among its outputs', listed(names))
        self._input, self._output = given[0].name, tensor or names[0]
        self.shape = _sides(given[0].shape)
        self.dtype = DTYPES.get(given[0].type, given[0].type)

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """The output for an input.

        Raises:
            ValueError: the network refuses the input.
        """
        try:
            return np.asarray(self._session.run([self._output], {self._input: values})[0])
        except Exception as error:  # as above
            raise ValueError(str(error)) from error


def simplified(graph: bytes) -> bytes:
    """An ONNX graph without what is constant or without effect; its operators stay those of ONNX's standard.

    Raises:
        ImportError: onnxruntime is not installed; the message names the extra.
    """
    with needs_extra("onnx", "simplifying an ONNX file needs onnxruntime", "onnxruntime"):
        import onnxruntime
    options = onnxruntime.SessionOptions()
    # Later levels use their own operators.
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
    options.log_severity_level = 4
    with TemporaryDirectory() as folder:
        path = Path(folder) / "simplified.onnx"
        options.optimized_model_filepath = str(path)
        onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
        return path.read_bytes()


@final
class LiteRTNetwork:
    """A network with one input, and one of its outputs or inner tensors.

    Quantised outputs are converted to real numbers with the file's own scale and zero point.

    Args:
        path: the file.
        tensor: name of an output or of an inner tensor; None for the only output.
        threads: number of threads.
        classes: as for `several_outputs`.

    Attributes:
        shape: of the input; None along an axis that may have any length.
        dtype: of the input.

    Raises:
        InputError: it cannot be read, has several inputs, or does not have one tensor with that name.
        ImportError: ai-edge-litert is not installed; the message names the extra.
    """

    def __init__(self, path: Path, tensor: str | None, threads: int, classes: int | None = None) -> None:
        with needs_extra("litert", f"{path} is a LiteRT file; running it needs ai-edge-litert", "ai_edge_litert"):
            from ai_edge_litert.interpreter import Interpreter
        try:
            with _quiet(), warnings.catch_warnings():
                warnings.simplefilter("ignore")  # keeping inner tensors takes memory
                self._network: Any = Interpreter(
                    str(path), num_threads=threads, experimental_preserve_all_tensors=tensor is not None
                )
                self._network.allocate_tensors()
        except (ValueError, RuntimeError) as error:
            raise InputError(path, "a network that LiteRT can run", str(error)) from error
        given, outputs = self._network.get_input_details(), self._network.get_output_details()
        if len(given) != 1:
            raise InputError(path, "one input", listed([one["name"] for one in given]) or "none")
        shapes = {one["name"]: _sides(one["shape_signature"]) for one in outputs}
        if tensor is not None:
            outputs = [one for one in self._network.get_tensor_details() if one["name"] == tensor]
        if len(outputs) != 1:
            if tensor is None:
                raise several_outputs(path, shapes, classes)
            raise InputError(path, f'one tensor named {tensor}, the "tensor" of its JSON', f"{len(outputs)}")
        self._input, self._output = given[0]["index"], outputs[0]["index"]
        self._scale, self._zero = outputs[0]["quantization"]
        self.shape = _sides(given[0]["shape_signature"])
        self.dtype = np.dtype(given[0]["dtype"]).name

    def __call__(self, values: np.ndarray) -> np.ndarray:
        """The output for an input.

        Raises:
            ValueError: the network refuses the input.
        """
        try:
            if None in self.shape:
                self._network.resize_tensor_input(self._input, values.shape)
                self._network.allocate_tensors()
            self._network.set_tensor(self._input, values)
            self._network.invoke()
            found = np.asarray(self._network.get_tensor(self._output))
        except RuntimeError as error:
            raise ValueError(str(error)) from error
        return found if self._scale == 0 else (found.astype(np.float32) - self._zero) * np.float32(self._scale)


@contextmanager
def _quiet() -> Iterator[None]:
    """Drop what the library's C++ code writes to stderr; it raises its errors too."""
    stderr = os.dup(2)
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
            yield
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)


def several_outputs(path: Path, outputs: Mapping[str, Sequence[int | None]], classes: int | None = None) -> InputError:
    """The error for a network with several outputs, or none, if its description names none of them.

    Args:
        path: the network.
        outputs: their names and shapes, None along an axis that may have any length.
        classes: how many numbers the output must have for each pixel; None if the shape cannot show whether one is meant.
    """
    advice = 'name one in the JSON: "tensor"'
    if classes is not None and outputs and not any(_may_have(shape, classes) for shape in outputs.values()):
        found = listed([f"{name} {list(shape)}" for name, shape in outputs.items()])
        advice = (
            f"none of them has a number for each of the {classes} classes and each pixel, as networks for boxes or instances (YOLO-seg): use a network for semantic "
            "segmentation"
        )
        return InputError(path, "one output", found, advice=advice)
    return InputError(path, "one output", listed(list(outputs)) or "none", advice=advice)


def _may_have(shape: Sequence[int | None], classes: int) -> bool:
    """Whether an output of a shape may have so many numbers for each pixel."""
    return not shape or (len(shape) == 4 and any(side in (None, classes) for side in (shape[1], shape[3])))


def _sides(shape: Iterable[Any]) -> tuple[int | None, ...]:
    """A shape as a runtime says it; None along an axis that may have any length, which has a name or a number that is not positive there."""
    return tuple(None if side is None or isinstance(side, str) or side <= 0 else int(side) for side in shape)

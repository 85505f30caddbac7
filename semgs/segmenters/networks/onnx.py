"""Runs and simplifies ONNX files with onnxruntime, on the CPU."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, final

import numpy as np

from semgs.files.errors import InputError
from semgs.files.extras import needs_extra
from semgs.files.text import listed
from semgs.segmenters.networks.outputs import several_outputs

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


def _sides(shape: Sequence[int | str | None]) -> tuple[int | None, ...]:
    """A shape as onnxruntime says it; None along an axis that may have any length."""
    return tuple(side if isinstance(side, int) and side > 0 else None for side in shape)


def simplified(graph: bytes) -> bytes:
    """An ONNX graph without what is constant or without effect; its operators stay those of ONNX's standard.

    Raises:
        ImportError: onnxruntime is not installed; the message names the extra.
    """
    with needs_extra("onnx", "simplifying an ONNX file needs onnxruntime", "onnxruntime"):
        import onnxruntime
    options = onnxruntime.SessionOptions()
    options.graph_optimization_level = (
        onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
    )  # later levels use their own operators
    options.log_severity_level = 4
    with TemporaryDirectory() as folder:
        path = Path(folder) / "simplified.onnx"
        options.optimized_model_filepath = str(path)
        onnxruntime.InferenceSession(graph, options, providers=["CPUExecutionProvider"])
        return path.read_bytes()

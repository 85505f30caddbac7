"""Runs LiteRT files (TensorFlow Lite) with ai-edge-litert, on the CPU."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, final

import numpy as np

from semgs.files.errors import InputError
from semgs.files.extras import needs_extra
from semgs.files.text import listed
from semgs.segmenters.networks.outputs import several_outputs


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


def _sides(signature: np.ndarray) -> tuple[int | None, ...]:
    """A shape as LiteRT says it; None along an axis that may have any length."""
    return tuple(int(side) if side > 0 else None for side in signature)


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

"""Arrays in NumPy's file format, read without trusting the header."""

from __future__ import annotations

import io
import math
import tokenize

import numpy as np

from semgs.files.contents import read_bytes
from semgs.files.errors import InputError, input_error
from semgs.files.stored import Stored

KINDS = "fiu"
"""Floating-point and whole numbers; nothing that would be unpickled."""


def read_array(path: Stored, kinds: str = KINDS) -> np.ndarray:
    """The array of numbers in a `.npy` file.

    Args:
        path: the file.
        kinds: NumPy's letters of the types that may be in it: "b" for truth values, "U" for texts, never "O".

    Raises:
        InputError: it is missing or damaged, does not hold numbers, or has another length than its header says. The length is
            checked before anything is allocated.
    """
    data = read_bytes(path, "an array of numbers")
    file = io.BytesIO(data)
    with input_error(path, "an array of numbers"):
        version = np.lib.format.read_magic(file)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        try:
            shape, in_columns, dtype = read_header(file)
        except (tokenize.TokenError, SyntaxError, TypeError, RecursionError, MemoryError) as error:
            raise ValueError(f"a header that cannot be parsed: {error}") from error
    length = math.prod(shape) * dtype.itemsize
    if (
        any(isinstance(side, bool) for side in shape)
        or dtype.kind not in kinds
        or dtype.hasobject
        or min(shape, default=0) < 0
        or length != len(data) - file.tell()
    ):
        found = f"a header of {shape} of {dtype} and {len(data) - file.tell()} bytes"
        advice = (
            "Python objects are not read: stack the arrays, np.stack(list(array)), and save again"
            if dtype.hasobject
            else None
        )
        raise InputError(path, "an array of numbers, as long as its header says", found, advice=advice)
    with input_error(path, "an array of numbers"):
        return np.frombuffer(data, dtype, offset=file.tell()).reshape(shape, order="F" if in_columns else "C")


def read_map(path: Stored) -> np.ndarray:
    """The array of numbers in a `.npy` file; [h w 1] and [1 h w], as many tools save maps, become [h w].

    Raises:
        InputError: as `read_array`.
    """
    return without_channel(read_array(path))


def without_channel(values: np.ndarray) -> np.ndarray:
    """[h w 1] and [1 h w] as [h w]; others as they are."""
    if values.ndim != 3 or 1 not in (values.shape[0], values.shape[-1]):
        return values
    return values[..., 0] if values.shape[-1] == 1 else values[0]

"""Arrays in NumPy's format, read without trusting their header."""

from __future__ import annotations

import io
import math

import numpy as np

from semgs.files.errors import InputError
from semgs.files.stored import Stored

KINDS = "fiu"
"""Floating-point and whole numbers: nothing that would be unpickled."""


def read_array(path: Stored) -> np.ndarray:
    """The array of numbers in a `.npy` file.

    Raises:
        InputError: absent, damaged, of something else than numbers, or not as long as its header says, which is seen before
            anything is allocated.
    """
    try:
        data = path.read_bytes()
        file = io.BytesIO(data)
        version = np.lib.format.read_magic(file)
        read_header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, in_columns, dtype = read_header(file)
    except OSError as error:
        raise InputError(path, "an array of numbers", error.strerror or str(error)) from error
    except (ValueError, EOFError) as error:
        raise InputError(path, "an array of numbers", str(error)) from error
    length = math.prod(shape) * dtype.itemsize
    if dtype.kind not in KINDS or min(shape, default=0) < 0 or length != len(data) - file.tell():
        found = f"a header of {shape} of {dtype} and {len(data) - file.tell()} bytes"
        raise InputError(path, "an array of numbers as long as its header says", found)
    return np.frombuffer(data, dtype, offset=file.tell()).reshape(shape, order="F" if in_columns else "C")

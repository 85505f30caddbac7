"""Safetensors files, with checks against crafted headers: too long, or ambiguous."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from safetensors import SafetensorError, safe_open

from semgs.files.contents import LFS_POINTER, check_fetched
from semgs.files.errors import InputError, input_error
from semgs.files.strict_json import parse_json

LONGEST_HEADER = 8 * 2**20
"""Largest header that is parsed [bytes]. Ours, with the names of thousands of scenes, reach a tenth of it; parsing 80 MB takes half a minute."""

NO_TENSORS = "a file of another format, or one that is cut off"
"""What is found if the header cannot be read, or does not fit the file."""


@contextmanager
def open_tensors(path: str | Path, expected: str) -> Iterator[Any]:
    """Open a safetensors file for the block; its tensors are torch's.

    Args:
        path: the file.
        expected: what it should be, for the error.

    Yields:
        What `safetensors.safe_open` gives.

    Raises:
        InputError: it cannot be read, is not a complete safetensors file, or its header is longer than 8 MiB or refused by `parse_json`.
    """
    try:
        with Path(path).open("rb") as file:
            check_fetched(Path(path), file.read(len(LFS_POINTER)), expected)
            file.seek(0)
            (length,) = struct.unpack("<Q", file.read(8).ljust(8, b"\0"))
            if 8 + length > Path(path).stat().st_size:
                raise InputError(path, expected, NO_TENSORS)
            if length > LONGEST_HEADER:
                raise InputError(path, expected, f"a header of {length:,} bytes; at most {LONGEST_HEADER:,} are read")
            header = file.read(length)
        with safe_open(path, "pt") as opened:
            with input_error(path, expected, "header"):
                parse_json(header)  # refuses duplicate keys
            yield opened
    except SafetensorError:
        raise InputError(path, expected, NO_TENSORS) from None
    except FileNotFoundError:
        raise InputError(path, expected, "no such file") from None
    except OSError as error:
        raise InputError(path, expected, error.strerror or str(error)) from None


def tensor_bytes(tensors: Mapping[str, Any], metadata: Mapping[str, str]) -> bytes:
    """A safetensors file whose bytes depend on its content alone: safetensors itself writes metadata in another order each time.

    Args:
        tensors: torch's, by name.
        metadata: texts by name.
    """
    from safetensors.torch import save  # imports torch

    data = save(dict(tensors))
    (length,) = struct.unpack("<Q", data[:8])
    header = {"__metadata__": dict(sorted(metadata.items()))} | json.loads(data[8 : 8 + length])
    text = json.dumps(header, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 8)  # tensors are aligned
    return struct.pack("<Q", len(text)) + text + data[8 + length :]

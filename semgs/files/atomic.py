"""Files that appear whole or not at all: written under another name in the same folder, then renamed."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
from pathlib import Path


def write_bytes(path: str | Path, data: bytes | bytearray | memoryview, *, durable: bool = False) -> None:
    """Write a file in one step: readers see the old file or the new one, never a part.

    Args:
        path: the file; what it held before stays if writing fails.
        data: all of it.
        durable: wait until the disk holds the bytes before the rename, so that a power cut leaves the old file or the
            new one (for checkpoints; it costs milliseconds to seconds).

    Raises:
        OSError: the folder is missing or closed to us, or the disk is full; nothing is left behind.
    """
    target = Path(path)
    partial = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    try:
        with partial.open("xb") as file:
            file.write(data)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        partial.replace(target)
    except BaseException:
        # The first error is the one to tell; a disk that fails again while we tidy up must not hide it.
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


def is_part_of(file: Path, target: Path) -> bool:
    """Whether a file is what a writing of `target` left behind that was killed at once."""
    return file.name.startswith(f".{target.name}.") and file.name.endswith(".part")


def write_text(path: str | Path, text: str, *, durable: bool = False) -> None:
    """Write a text file in one step, UTF-8 with the line ends of `text`; errors as `write_bytes`."""
    write_bytes(path, text.encode(), durable=durable)


def write_json(path: str | Path, content: object, *, durable: bool = False) -> None:
    """Write a JSON file in one step, indented by two, keys in the order given.

    Raises:
        ValueError: a number is NaN or infinite, which JSON has no word for; write None where nothing is known.
        TypeError: something in it is neither a dict, list, text, number, bool nor None.
        OSError: as `write_bytes`.
    """
    try:
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    except ValueError as error:
        raise ValueError(
            f"{path}: expected finite numbers, found NaN or infinity ({error}); write None instead"
        ) from error
    write_text(path, text + "\n", durable=durable)

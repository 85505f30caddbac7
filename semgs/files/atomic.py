"""Files that appear whole or not at all: written under another name in the same folder, then renamed."""

from __future__ import annotations

import contextlib
import json
import os
import secrets
from pathlib import Path

from semgs.files.errors import InputError


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
    partial = partial_name(target)
    try:
        with partial.open("xb") as file:
            file.write(data)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        partial.replace(target)
    except BaseException as error:
        if isinstance(error, OSError) and error.filename is None:
            error.filename = str(target)
        # The first error is the one to tell; a disk that fails again while we tidy up must not hide it.
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


def check_file(path: str | Path) -> None:
    """Say now whether `write_bytes` could write a file, before long work is done for nothing.

    Raises:
        InputError: it is a folder, or the folder that it is in is missing or closed to us.
    """
    target = Path(path)
    try:
        if target.is_dir():
            raise InputError(path, "a file to write", "a folder")
        if not target.absolute().parent.is_dir():
            raise InputError(path, "a file in a folder that is there", "no such folder")
        partial = partial_name(target)
        partial.touch(exist_ok=False)
        partial.unlink()
    except OSError as error:
        raise InputError(
            path, "a file that can be written", f"{error.strerror} ({target.absolute().parent})"
        ) from error


def partial_name(target: Path) -> Path:
    """A new name beside a file or folder, hidden, for what is to take its name once it is complete."""
    return target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")


def is_part_of(file: Path, target: Path) -> bool:
    """Whether a file is what a writing of `target` left behind that was killed at once."""
    return file.name.startswith(f".{target.name}.") and file.name.endswith(".part")


def write_text(path: str | Path, text: str, *, durable: bool = False) -> None:
    """Write a text file in one step, UTF-8 with the line ends of `text`; errors as `write_bytes`.

    The bytes of file names that are no UTF-8, which Python keeps as lone surrogates, are written as escapes (`\\udcff`).
    """
    write_bytes(path, text.encode(errors="backslashreplace"), durable=durable)


def write_json(path: str | Path, content: object, *, durable: bool = False) -> None:
    """Write a JSON file in one step, indented by two, keys in the order given; lone surrogates become JSON's own escapes.

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

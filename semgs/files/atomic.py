"""Atomic writes: a file is written under a temporary name in the same folder, then renamed, so it is complete or absent."""

from __future__ import annotations

import contextlib
import io
import json
import os
import secrets
from collections.abc import Iterator
from pathlib import Path

from semgs.files.errors import InputError


def write_bytes(path: str | Path, data: bytes | bytearray | memoryview, *, durable: bool = False) -> None:
    """Write a file atomically: readers see the old file or the new one, never a part.

    Args:
        path: the file; its old content stays if writing fails.
        data: the new content.
        durable: sync to disk before the rename, so that even after a power cut the file is complete (for checkpoints; takes
            milliseconds to seconds).

    Raises:
        OSError: the folder is missing or not writable, or the disk is full; nothing is left behind.
    """
    with new_file(path, durable=durable) as file:
        file.write(data)


@contextlib.contextmanager
def new_file(path: str | Path, *, durable: bool = False) -> Iterator[io.BufferedWriter]:
    """A file to write, which is renamed to `path` if the block succeeds and removed if it fails.

    Args:
        path, durable: as for `write_bytes`.

    Raises:
        OSError: as `write_bytes`.
    """
    target = Path(path)
    partial = partial_name(target)
    try:
        with partial.open("xb") as file:
            yield file
            if durable:
                file.flush()
                os.fsync(file.fileno())
        partial.replace(target)
    except BaseException as error:
        if isinstance(error, OSError) and error.filename is None:
            error.filename = str(target)
        # Report the first error; a second one while tidying up must not hide it.
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)
        raise


def check_file(path: str | Path) -> None:
    """Check that `write_bytes` could write a file, before long work starts.

    Raises:
        InputError: it is a folder, or its folder is missing or not writable.
    """
    target = Path(path)
    try:
        if target.is_dir():
            raise InputError(path, "a file to write", "a folder")
        if not target.absolute().parent.is_dir():
            raise InputError(path, "a file in an existing folder", "no such folder")
        partial = partial_name(target)
        partial.touch(exist_ok=False)
        partial.unlink()
    except OSError as error:
        raise InputError(path, "a writable file", f"{error.strerror} ({target.absolute().parent})") from error


def partial_name(target: Path) -> Path:
    """A temporary hidden name beside a file or folder, to write it under until it is complete."""
    return target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")


def is_part_of(file: Path, target: Path) -> bool:
    """Whether a file is a temporary one that a killed process left while writing `target`."""
    return file.name.startswith(f".{target.name}.") and file.name.endswith(".part")


def remove_parts(folder: Path, record: Path) -> None:
    """Remove the temporary files that killed processes left in a folder. Only a process that has locked the folder may call this.

    Args:
        folder: the folder; folders in it stay untouched.
        record: the file that processes write before they lock the folder. Its temporary files may be in use, so they stay.
    """
    for file in folder.glob(".*.part"):
        if file.is_file() and not is_part_of(file, record):
            file.unlink(missing_ok=True)


def write_text(path: str | Path, text: str, *, durable: bool = False) -> None:
    """Write a text file atomically, in UTF-8 with the line ends of `text`; errors as `write_bytes`.

    File names that are not UTF-8 contain lone surrogates in Python; these are written as escapes (`\\udcff`).
    """
    write_bytes(path, text.encode(errors="backslashreplace"), durable=durable)


def write_json(path: str | Path, content: object, *, durable: bool = False) -> None:
    """Write a JSON file atomically, indented by two, keys in the given order; lone surrogates become JSON escapes.

    Raises:
        ValueError: a number is NaN or infinite, which JSON cannot express; use None for unknown numbers.
        TypeError: a value is not a dict, list, text, number, bool or None.
        OSError: as `write_bytes`.
    """
    try:
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
    except ValueError as error:
        raise ValueError(
            f"{path}: expected finite numbers, found NaN or infinity ({error}); write None instead"
        ) from error
    write_text(path, text + "\n", durable=durable)

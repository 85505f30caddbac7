"""Temporary names for outputs that take long to write. What a killed process left under one is removed by the next run to the same output.

`.out.1a2b3c4d.part` becomes `out`, and the process that fills it has locked `.out.1a2b3c4d.lock`. Without that file nobody knows whether the process lives,
so what has none is never removed.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from semgs.files.atomic import partial_name

PART, LOCK = ".part", ".lock"
_CANNOT_LOCK = (Timeout, OSError, NotImplementedError)


@contextlib.contextmanager
def staged(target: Path) -> Iterator[Path]:
    """A temporary name beside `target`, for a file or folder that will be renamed to it. What has that name at the end of the block is removed.

    First, what killed processes left under such names is removed.

        with staged(path) as partial:
            write(partial)
            partial.replace(path)

    Args:
        target: in an existing folder.

    Raises:
        OSError: nothing can be written there.
    """
    remove_left(target)
    partial, lock = _lock_name(target)
    try:
        yield partial
    finally:
        with contextlib.suppress(OSError):
            _remove(partial)
            partial.with_suffix(LOCK).unlink(missing_ok=True)
        if lock is not None:
            lock.release()


def remove_left(target: Path) -> None:
    """Remove what killed processes left under temporary names of `target`, from this version on. What a process is writing stays."""
    name = re.compile(rf"\.{re.escape(target.name)}\.[0-9a-f]{{8}}\{LOCK}")
    try:
        with os.scandir(target.parent) as entries:
            locks = [target.parent / entry.name for entry in entries if name.fullmatch(entry.name)]
    except OSError:
        return
    for path in locks:
        lock = FileLock(path)
        with contextlib.suppress(*_CANNOT_LOCK):
            lock.acquire(timeout=0)
            try:
                _remove(path.with_suffix(PART))
                path.unlink(missing_ok=True)
            finally:
                lock.release()


def _remove(path: Path) -> None:
    """Remove a file or folder, if there is one."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _lock_name(target: Path) -> tuple[Path, FileLock | None]:
    """A temporary name and its lock, which this process holds; None if the file system has no locks, and then nobody will remove what is left."""
    while True:
        partial = partial_name(target)
        path = partial.with_suffix(LOCK)
        path.touch(exist_ok=False)
        lock = FileLock(path)
        try:
            lock.acquire(timeout=0)
        except Timeout:  # another process has just found the file, and takes it for one that was left
            continue
        except (OSError, NotImplementedError):
            path.unlink(missing_ok=True)
            return partial, None
        if path.exists():
            return partial, lock
        lock.release()

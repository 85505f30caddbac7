"""Folders of ours: a result appears whole or not at all, and nobody else's folder is ever replaced."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from semgs.files.atomic import partial_name
from semgs.files.errors import InputError, readable

MARK = ".semgs"
"""The file that tells a folder of ours from any other."""

_MARK_TEXT = "This folder was written by semgs, which replaces it as a whole when it is told to overwrite it.\n"


def check_folder(path: str | Path, overwrite: bool = False) -> None:
    """Say now whether `own_folder` could make `path`, before long work is done for nothing.

    Raises:
        InputError: as `own_folder`.
    """
    with readable(path):
        _check_free(path, overwrite)
        target = Path(path).resolve()
        if target.is_mount():
            raise _mounted(path)
        nearest = next(parent for parent in target.parents if parent.exists())
    trial = partial_name(nearest / target.name)
    _make(path, trial)
    trial.rmdir()


def check_writable(path: str | Path) -> None:
    """Say now whether files can be written into a folder that is there, or into one that is to be made.

    Raises:
        InputError: they cannot.
    """
    with readable(path):
        nearest = next(one for one in (Path(path).absolute(), *Path(path).absolute().parents) if one.exists())
    trial = partial_name(nearest / MARK)
    _make(path, trial)
    trial.rmdir()


@contextlib.contextmanager
def alone(record: Path, expected: str, found: str) -> Iterator[None]:
    """Be the only process that works in a folder, until the block or the process ends; where the system has no locks, hope so.

    Args:
        record: a file in it, which is locked; it is made if it is not there.
        expected: what the folder should be, for the message.
        found: what it is if another process has the lock.

    Raises:
        InputError: another process has it.
        OSError: the file cannot be written.
    """
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    with record.open("ab") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(record.parent, expected, found, advice="end that first, or name another folder") from error
        except OSError:  # file systems without locks
            pass
        yield


def _check_free(path: str | Path, overwrite: bool) -> None:
    """Refuse what must not be replaced.

    Raises:
        InputError: it is a file, a folder that is not ours, one of ours without `overwrite`, or the working folder.
    """
    target = Path(path)
    if not target.exists():
        if target.is_symlink():
            raise InputError(path, "a folder or nothing", "a link that leads nowhere")
        for parent in target.absolute().parents:
            if parent.exists():
                if not parent.is_dir():
                    raise InputError(path, "a folder above it", f"that {parent} is a file")
                break
        return
    if not target.is_dir():
        raise InputError(path, "a folder to write", "a file", advice="name another folder")
    if target.resolve() == Path.cwd():
        raise InputError(path, "a folder to write", "the folder you are in", advice="name one inside it")
    if not any(target.iterdir()):
        return
    if not (target / MARK).is_file():
        raise InputError(
            path,
            "a new folder, an empty one or one that semgs wrote",
            f"a folder without the mark {MARK}",
            advice="name another folder, nothing was changed",
        )
    if not overwrite:
        raise InputError(
            path, "a new folder", "one that semgs wrote before", advice="add --overwrite to replace it or name another"
        )


@contextlib.contextmanager
def own_folder(path: str | Path, overwrite: bool = False) -> Iterator[Path]:
    """A folder to fill that takes the name `path` once the block ends well, and vanishes if it does not.

        with own_folder("out/living", overwrite=True) as folder:
            write_json(folder / "report.json", numbers)

    A new or empty `path` is filled; one that an earlier run wrote (it holds the file `.semgs`) is replaced as a whole
    with `overwrite`, and only then. What existed stays untouched until the new folder is complete. Missing folders above it are
    made (and stay, if the block fails).

    Args:
        path: the folder to appear.
        overwrite: replace one of ours.

    Yields:
        An empty folder beside `path`, on the same disk, that already bears the mark.

    Raises:
        InputError: it is a file, a folder that is not ours, one of ours without `overwrite`, or the working folder; it cannot be
            made there; or it cannot be renamed (a mount point).
        OSError: the disk is full.
    """
    with readable(path):
        _check_free(path, overwrite)
        target = Path(path).resolve()  # a link to one of ours stays, what it points to is replaced
    staging = partial_name(target)
    _make(path, staging)
    try:
        (staging / MARK).write_text(_MARK_TEXT)
        yield staging
        _check_free(path, overwrite)  # a long time may have passed
        _swap(staging, target)
    except BaseException:
        shutil.rmtree(staging, ignore_errors=True)
        raise


def _make(path: str | Path, folder: Path) -> None:
    """Make a folder, and those above it, that is to become `path`.

    Raises:
        InputError: that cannot be.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir()
    except OSError as error:
        raise InputError(path, "a folder that can be made", f"{error.strerror} ({folder.parent})") from error


def _swap(staging: Path, target: Path) -> None:
    """Give `staging` the name `target`; what had it is removed, or keeps it if that fails.

    The two exchange their names in one step where the system can, so that even a kill leaves one of them there. Elsewhere the old one
    moves aside first, and comes back if the second rename fails.

    Raises:
        InputError: `target` cannot be moved, as a mount point cannot.
    """
    if not target.exists():
        staging.replace(target)
        return
    try:
        if _exchange(staging, target):
            shutil.rmtree(staging, ignore_errors=True)
            return
        aside = staging.with_suffix(".old")
        target.replace(aside)
    except OSError as error:
        if error.errno in (errno.EBUSY, errno.EXDEV):
            raise _mounted(target) from error
        raise
    try:
        staging.replace(target)
    except BaseException:
        aside.replace(target)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def _mounted(path: str | Path) -> InputError:
    return InputError(path, "a folder that can be replaced", "a mount point", advice="name a folder inside it")


_HERE, _EXCHANGE = -100, 2
"""`AT_FDCWD` and `RENAME_EXCHANGE` of Linux."""


def _exchange(first: Path, second: Path) -> bool:
    """Exchange two names in one step (renameat2); False where the system or the file system cannot, and nothing was done.

    Raises:
        OSError: it can, and refuses.
    """
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):  # other systems, and old C libraries
        return False
    if rename(_HERE, os.fsencode(first), _HERE, os.fsencode(second), _EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in (errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP):
        return False
    raise OSError(number, os.strerror(number), str(first), None, str(second))

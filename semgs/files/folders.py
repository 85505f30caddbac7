"""Output folders: a result is complete or absent, and a command replaces only folders that it wrote itself."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import re
import shutil
from collections.abc import Iterable, Iterator
from pathlib import Path

from filelock import FileLock, Timeout

from semgs.files.atomic import check_file, partial_name
from semgs.files.errors import InputError, readable
from semgs.files.paths import typed_path

MARK = ".semgs"
"""The file that marks a folder as written by semgs."""

LOCK = ".lock"
"""The file that the process which fills a folder locks. It is empty, because no other process can read a locked file on Windows."""

FILE_ENDINGS = frozenset([
    ".avi", ".bmp", ".ckpt", ".csv", ".gif", ".glb", ".gltf", ".htm", ".html", ".jpeg", ".jpg", ".json", ".ksplat", ".m4v", ".mcap", ".mkv", ".mov", ".mp4",
    ".npy", ".npz", ".obj", ".onnx", ".pcd", ".pdf", ".ply", ".png", ".pt", ".pth", ".rrd", ".safetensors", ".sog", ".splat", ".spz", ".svg", ".tif", ".tiff",
    ".txt", ".usd", ".usda", ".usdc", ".usdz", ".webm", ".webp", ".zip",
])  # fmt: skip
"""Endings, in lower case, of files that a user may expect instead of a folder."""

_PART, _LOCKED = ".part", ".lock"
"""Endings of a temporary name and of the lock beside it: `.out.1a2b3c4d.part` becomes `out`, and the process that writes it has locked `.out.1a2b3c4d.lock`. Without
that file it is unknown whether the process lives, so what has none is never removed."""

_CANNOT_LOCK = (Timeout, OSError, NotImplementedError)

_WRITER = "This folder was written by semgs {}. The same command replaces it as a whole if you add --overwrite.\n"


def check_folder(
    path: str | Path, command: str, overwrite: bool = False, inputs: Iterable[str | Path | None] = ()
) -> None:
    """Check that `own_folder` could create `path`, before long work starts.

    Args:
        path, command, overwrite: as for `own_folder`.
        inputs: what will be read, as for `check_apart`.

    Raises:
        InputError: as `own_folder`, or `path` is or contains an input, or has the name of a file.
    """
    with readable(path):
        _check_free(path, command, overwrite, inputs)
        check_name(path)
        target = Path(path).resolve()
        if target.is_mount():
            raise _mounted(path)
        nearest = next(parent for parent in target.parents if parent.exists())
    with _staging(path, nearest / target.name):
        pass


def check_name(path: str | Path) -> None:
    """Check that a folder to write is not named like a file.

    Raises:
        InputError: it is.
    """
    ending = Path(path).suffix
    if ending.lower() in FILE_ENDINGS:
        raise InputError(path, "the name of a folder", f"one that ends with {ending}", advice="leave out the ending")


def check_apart(path: str | Path, inputs: Iterable[str | Path | None]) -> None:
    """Check that replacing `path` removes nothing that will be read. It may be inside an input.

    Args:
        path: the file or folder to replace.
        inputs: files and folders; None, and what does not exist, is left out.

    Raises:
        InputError: it is one of them, or contains one, perhaps by a link.
    """
    target = Path(path)
    if not target.exists():
        return
    for given in inputs:
        one = None if given is None else typed_path(given)
        if one is None or not one.exists():
            continue
        if one.samefile(target):
            raise InputError(path, "an output apart from the input", "the input itself", advice="name another output")
        if any(parent.samefile(target) for place in (one.absolute(), one.resolve()) for parent in place.parents):
            found = f"one that contains the input {given}"
            raise InputError(path, "an output apart from the input", found, advice="name another output")


def check_writable(path: str | Path) -> None:
    """Check that files can be written to a folder, or that the folder can be created.

    Raises:
        InputError: it is not writable.
    """
    with readable(path):
        nearest = next(one for one in (Path(path).absolute(), *Path(path).absolute().parents) if one.exists())
    trial = partial_name(nearest / MARK)
    try:
        trial.touch()
        trial.unlink(missing_ok=True)  # a process that has locked the folder may have removed it
    except OSError as error:
        raise InputError(path, "a folder that can be created", f"{error.strerror} ({nearest})") from error


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
            partial.with_suffix(_LOCKED).unlink(missing_ok=True)
        if lock is not None:
            lock.release()


def remove_left(target: Path) -> None:
    """Remove what killed processes left under temporary names of `target`, from this version on. What a process is writing stays."""
    name = re.compile(rf"\.{re.escape(target.name)}\.[0-9a-f]{{8}}\{_LOCKED}")
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
                _remove(path.with_suffix(_PART))
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
    """A temporary name and its lock, which this process holds; None if the file system has no locks. Then what a killed process leaves stays."""
    while True:
        partial = partial_name(target)
        partial.touch(exist_ok=False)  # where that is impossible, filelock would try for ever
        partial.unlink()
        # The lock must not exist before it is held: another process would take it for that of a killed one.
        path = partial.with_suffix(_LOCKED)
        lock = FileLock(path)
        try:
            lock.acquire(timeout=0)
        except Timeout:  # another process has just found the file, and takes it for one of a killed process
            continue
        except (OSError, NotImplementedError):
            path.unlink(missing_ok=True)
            return partial, None
        if path.exists():
            return partial, lock
        lock.release()


@contextlib.contextmanager
def lock_folder(folder: Path, expected: str, found: str, name: str = LOCK) -> Iterator[None]:
    """Lock a folder for this process, until the block or the process ends. Without effect on file systems that have no locks.

    Args:
        folder: an existing folder.
        expected: what it should be, for the message.
        found: what it is if another process has the lock, likewise.
        name: the lock file in it. It is created if missing, and stays.

    Raises:
        InputError: another process has it, or the file system fails to lock.
        OSError: the lock file cannot be written.
    """
    lock = FileLock(folder / name)
    try:
        lock.acquire(timeout=0)
    except Timeout as error:
        raise InputError(folder, expected, found, advice="stop that process first, or name another folder") from error
    except NotImplementedError:  # a file system without locks, told by filelock 3; filelock 4 keeps a marker file there
        pass
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            if error.filename is not None:
                raise
            raise InputError(folder, "a folder that can be locked", error.strerror or str(error)) from error
    try:
        yield
    finally:
        lock.release()


_NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP)
"""What `flock` says where locks are switched off, as on some network drives."""


def _check_free(path: str | Path, command: str, overwrite: bool, inputs: Iterable[str | Path | None] = ()) -> None:
    """Refuse what must not be replaced."""
    target = Path(path)
    if not target.exists():
        if target.is_symlink():
            raise InputError(path, "a folder or nothing", "a broken link")
        for parent in target.absolute().parents:
            if parent.exists():
                if not parent.is_dir():
                    raise InputError(path, "a path below a folder", f"that {parent} is a file")
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
            "a new or empty folder, or one that semgs wrote",
            f"a folder without the mark {MARK}",
            advice="name another folder; nothing was changed",
        )
    check_apart(path, inputs)
    writer = _writer_of(target)
    if writer not in (None, command):
        expected = f"a new or empty folder, or one that semgs {command} wrote"
        raise InputError(path, expected, f"one of semgs {writer}", advice="name another folder; nothing was changed")
    if not overwrite:
        raise InputError(
            path, "a new folder", "one that semgs wrote before", advice="add --overwrite to replace it or name another"
        )


def _writer_of(folder: Path) -> str | None:
    """The command that wrote a marked folder; None if the mark is from a version that did not say."""
    before, after = _WRITER.split("{}")
    text = (folder / MARK).read_text(encoding="utf-8", errors="replace")
    return text.removeprefix(before).removesuffix(after) if text.startswith(before) and text.endswith(after) else None


@contextlib.contextmanager
def own_folder(path: str | Path, command: str, overwrite: bool = False) -> Iterator[Path]:
    """A folder to fill, which is renamed to `path` if the block succeeds and removed if it fails.

        with own_folder("out/living", "reconstruct", overwrite=True) as folder:
            write_json(folder / "report.json", numbers)

    `path` may be new or empty. A folder that the same command wrote (the file `.semgs` in it says so) is replaced only with
    `overwrite`, and stays untouched until the new one is complete. Missing parent folders are created, and stay if the block fails. If
    the process is killed, the next one that fills `path` removes what it left.

    Args:
        path: the folder to create.
        command: of semgs that writes it.
        overwrite: replace a folder that this command wrote.

    Yields:
        An empty, already marked folder beside `path`, on the same disk.

    Raises:
        InputError: `path` is a file, the working folder, a folder that this command did not write, or one that it did without
            `overwrite`; or the folder cannot be created or renamed (a mount point).
        OSError: the disk is full.
    """
    with readable(path):
        _check_free(path, command, overwrite)
        target = Path(path).resolve()  # a link stays; its target is replaced
    with _staging(path, target) as staging:
        (staging / MARK).write_text(_WRITER.format(command), encoding="utf-8")
        yield staging
        _check_free(path, command, overwrite)  # again, as time has passed
        try:
            _swap(staging, target)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST):
                raise
            _check_free(path, command, overwrite)  # another process was first
            _swap(staging, target)


@contextlib.contextmanager
def _staging(path: str | Path, target: Path) -> Iterator[Path]:
    """A new folder under a temporary name beside `target`, which will become `path`; parents are created."""
    with contextlib.ExitStack() as stack:
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            staging = stack.enter_context(staged(target))
            staging.mkdir()
        except OSError as error:
            raise InputError(path, "a folder that can be created", f"{error.strerror} ({target.parent})") from error
        yield staging


def _swap(staging: Path, target: Path) -> None:
    """Rename `staging` to `target` and remove the old folder, or leave it in place if that fails.

    If the system can, the two exchange names in one step, so one of them is there even if the process is killed. Otherwise the old one
    is moved aside first, and moved back if the second rename fails.
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
    return InputError(path, "a replaceable folder", "a mount point", advice="name a folder inside it")


_HERE, _EXCHANGE = -100, 2
"""`AT_FDCWD` and `RENAME_EXCHANGE` of Linux."""


def _exchange(first: Path, second: Path) -> bool:
    """Exchange two names in one step (renameat2). False if the system or file system does not support it; then nothing was done.

    Raises:
        OSError: the exchange failed.
    """
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):  # not Linux, or an old C library
        return False
    if rename(_HERE, os.fsencode(first), _HERE, os.fsencode(second), _EXCHANGE) == 0:
        return True
    number = ctypes.get_errno()
    if number in (errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP):
        return False
    raise OSError(number, os.strerror(number), str(first), None, str(second))


def check_new_file(path: Path, overwrite: bool | None = None, inputs: Iterable[str | Path | None] = ()) -> None:
    """Check that a file can be written, and replaced only if the user wants it.

    Args:
        path: the file.
        overwrite: whether --overwrite is given; None if the command has no such option.
        inputs: what will be read, as for `check_apart`.

    Raises:
        InputError: it exists, is an input, or cannot be written.
    """
    check_apart(path, inputs)
    if path.exists() and not overwrite:
        advice = "choose another name" if overwrite is None else "use --overwrite to replace it"
        raise InputError(path, "a new file", "one that exists", advice=advice)
    check_file(path)

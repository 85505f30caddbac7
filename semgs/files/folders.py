"""Folders of ours: a result appears whole or not at all, and nobody else's folder is ever replaced."""

from __future__ import annotations

import contextlib
import errno
import secrets
import shutil
from collections.abc import Iterator
from pathlib import Path

from semgs.files.errors import InputError

MARK = ".semgs"
"""The file that tells a folder of ours from any other."""

_MARK_TEXT = "This folder was written by semgs, which replaces it as a whole when it is told to overwrite it.\n"


def check_folder(path: str | Path, overwrite: bool = False) -> None:
    """Say now whether `own_folder` would accept `path`, before long work is done for nothing.

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
        InputError: as `check_folder`; it cannot be made there; or it cannot be renamed (a mount point).
        OSError: the disk is full.
    """
    check_folder(path, overwrite)
    target = Path(path).resolve()  # a link to one of ours stays, what it points to is replaced
    token = secrets.token_hex(4)
    staging = target.with_name(f".{target.name}.{token}.part")
    try:
        staging.parent.mkdir(parents=True, exist_ok=True)
        staging.mkdir()
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG):
            raise InputError(path, "a folder that can be made", f"{error.strerror} ({staging.parent})") from error
        raise
    try:
        (staging / MARK).write_text(_MARK_TEXT)
        yield staging
        check_folder(path, overwrite)  # a long time may have passed
        _swap(staging, target, target.with_name(f".{target.name}.{token}.old"))
    except BaseException:
        shutil.rmtree(staging, ignore_errors=True)
        raise


def _swap(staging: Path, target: Path, aside: Path) -> None:
    """Give `staging` the name `target`; what had it is moved `aside`, then removed, or comes back if the rename fails.

    Raises:
        InputError: `target` cannot be moved, as a mount point cannot.
    """
    existed = target.exists()
    try:
        if existed:
            target.replace(aside)
    except OSError as error:
        if error.errno in (errno.EBUSY, errno.EXDEV):
            raise InputError(
                target, "a folder that can be replaced", "a mount point", advice="name a folder inside it"
            ) from error
        raise
    try:
        staging.replace(target)
    except BaseException:
        if existed:
            aside.replace(target)
        raise
    if existed:
        shutil.rmtree(aside, ignore_errors=True)

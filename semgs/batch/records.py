"""What became of the scenes of a batch.

OUT/NAME/               what the command wrote for a scene, complete or absent
OUT/records/NAME.json   whether it succeeded, with which options and inputs, its scores and notes, and how long it took
OUT/pictures/NAME.jpg   a small picture of it
OUT/failures.jsonl      the scenes that failed, with a line on why each did
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from semgs.batch.tasks import Task
from semgs.files.atomic import write_bytes, write_json
from semgs.files.errors import InputError
from semgs.files.records import make_record
from semgs.files.strict_json import read_json

FOLDER, PICTURES = "records", "pictures"
FAILURES = "failures.jsonl"

WRONG_CAMERAS = 3
"""The code of `semgs doctor` for cameras that do not fit, which is a result, and of `semgs export` if it wrote only some of the formats."""


@dataclass(frozen=True)
class Record:
    """What became of a scene.

    Attributes:
        name: of the scene.
        fingerprint: of the task that was run.
        code: exit code of the command: 0 for success; negative for the signal that killed it.
        why: the error in one line; empty after success, unless some formats were not written.
        seconds: how long it took [s].
        scores: numbers of its report by name; those of held-out views if there are any.
        notes: of its report, or what the command printed.
    """

    name: str
    fingerprint: str
    code: int
    why: str = ""
    seconds: float = 0.0
    scores: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def succeeded(self) -> bool:
        """Whether there is a result."""
        return self.code in (0, WRONG_CAMERAS)


def write_record(out: Path, record: Record) -> None:
    """Write the record of a scene.

    Raises:
        OSError: it cannot be written.
    """
    write_json(out / FOLDER / f"{record.name}.json", asdict(record))


def read_record(out: Path, name: str) -> Record | None:
    """The record of a scene; None if there is none.

    Raises:
        InputError: it is damaged, or a folder.
    """
    path = out / FOLDER / f"{name}.json"
    if path.is_dir():
        raise InputError(path, "the record of a scene", "a folder", advice="delete it to repeat the scene")
    if not path.is_file():
        return None
    try:
        return make_record(Record, read_json(path, "the record of a scene"))
    except ValueError as error:
        raise InputError(path, "the record of a scene", str(error), advice="delete it to repeat the scene") from error


def is_done(task: Task, retry_failed: bool) -> bool:
    """Whether a task has a record with its fingerprint, and its result is there; with `retry_failed`, failures are not done.

    Raises:
        InputError: the record is damaged.
    """
    record = read_record(task.out, task.name)
    if record is None or record.fingerprint != task.fingerprint:
        return False
    return (task.out / task.result).exists() if record.succeeded else not retry_failed


def write_failures(out: Path, records: Sequence[Record]) -> None:
    """Write the list of scenes that failed; none for no failures.

    Raises:
        OSError: it cannot be written.
    """
    failed = [record for record in records if not record.succeeded]
    lines = [json.dumps({"scene": record.name, "code": record.code, "error": record.why}) for record in failed]
    if lines:
        write_bytes(out / FAILURES, ("\n".join(lines) + "\n").encode())
    else:
        (out / FAILURES).unlink(missing_ok=True)


def remove_leftovers(out: Path, names: Sequence[str], shared: bool = False) -> None:
    """Remove the temporary files and folders that killed processes left. Only a process that has locked the scenes may call this.

    Args:
        out: the batch's folder.
        names: of the scenes.
        shared: whether other processes work on other scenes; then files of all scenes stay.
    """
    ours = {*names, *(() if shared else ("batch", "index", "index.csv", FAILURES))}
    for folder in (out, out / FOLDER, out / PICTURES):
        for path in folder.glob(".*"):
            left = re.fullmatch(r"\.(.+?)(?:\.html|\.json|\.jpg)?\.[0-9a-f]{8}\.(?:part|old)", path.name)
            if left is None or left[1] not in ours:
                continue
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)

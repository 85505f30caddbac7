"""What became of the scenes of a batch.

OUT/NAME/               what the command wrote for a scene, whole or not there
OUT/records/NAME.json   whether it succeeded, with which options and inputs, and how long it took
OUT/failures.jsonl      the scenes that failed, with a line on why each did
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from semgs.batch.tasks import Task
from semgs.files.atomic import write_bytes, write_json
from semgs.files.errors import InputError
from semgs.files.records import make_record
from semgs.files.strict_json import read_json

FOLDER = "records"
FAILURES = "failures.jsonl"


@dataclass(frozen=True)
class Record:
    """What became of a scene.

    Attributes:
        name: of the scene.
        fingerprint: of the task that was run.
        code: exit code of the command: 0 for success; negative for the signal that killed it.
        why: the error in one line; empty after success.
        seconds: how long it took [s].
    """

    name: str
    fingerprint: str
    code: int
    why: str = ""
    seconds: float = 0.0

    @property
    def succeeded(self) -> bool:
        """Whether the result is there. `semgs doctor` says with 3 that cameras are wrong, which is a result."""
        return self.code in (0, 3)


def write_record(out: Path, record: Record) -> None:
    """Write the record of a scene.

    Raises:
        OSError: it cannot be written.
    """
    (out / FOLDER).mkdir(exist_ok=True)
    write_json(out / FOLDER / f"{record.name}.json", asdict(record))


def read_record(out: Path, name: str) -> Record | None:
    """The record of a scene; None if there is none.

    Raises:
        InputError: it is damaged.
    """
    path = out / FOLDER / f"{name}.json"
    if not path.is_file():
        return None
    try:
        return make_record(Record, read_json(path, "the record of a scene"))
    except ValueError as error:
        raise InputError(path, "the record of a scene", str(error)) from error


def left_to_do(out: Path, tasks: Sequence[Task], retry_failed: bool) -> list[Task]:
    """The tasks without a record, with another fingerprint, or whose result is gone; with `retry_failed` also those that failed.

    Raises:
        InputError: a record is damaged.
    """
    left = []
    for task in tasks:
        record = read_record(out, task.name)
        same = record is not None and record.fingerprint == task.fingerprint
        done = same and record is not None and (record.succeeded or not retry_failed)
        if not done or (record is not None and record.succeeded and not any(out.glob(f"{task.name}*"))):
            left.append(task)
    return left


def write_failures(out: Path, tasks: Sequence[Task]) -> int:
    """Write the list of scenes that failed, in the order of the tasks; none for no failures. Returns how many they are.

    Raises:
        InputError: a record is damaged.
        OSError: it cannot be written.
    """
    records = [record for task in tasks if (record := read_record(out, task.name)) is not None]
    failed = [record for record in records if not record.succeeded]
    lines = [json.dumps({"scene": record.name, "code": record.code, "error": record.why}) for record in failed]
    if lines:
        write_bytes(out / FAILURES, ("\n".join(lines) + "\n").encode())
    else:
        (out / FAILURES).unlink(missing_ok=True)
    return len(failed)

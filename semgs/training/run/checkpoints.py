"""Checkpoints: complete states on disk. A run resumes from the newest intact one.

A checkpoint is two files: `00012000.safetensors` with the tensors and, written after it, `00012000.json` with the numbers
and the hash of the first. Both are written under a temporary name and renamed, so a killed run leaves no incomplete file under
a checkpoint's name. A file that is damaged later fails its hash.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from safetensors.torch import load, save
from torch import Tensor

from semgs.files.atomic import write_bytes, write_json
from semgs.files.errors import InputError
from semgs.files.strict_json import parse_json
from semgs.training.state import TrainingState, are_numbers

KEPT = 3
"""Checkpoints to keep besides the best; each is about five times the size of the network."""


@dataclass(frozen=True)
class Checkpoint:
    """A state as it was read.

    Attributes:
        tensors: by name, from `TrainingState.tensors`.
        numbers: from `TrainingState.numbers`.
        damaged: newer checkpoints that were skipped.
    """

    tensors: dict[str, Tensor]
    numbers: dict[str, int | float]
    damaged: tuple[Path, ...]


def save_checkpoint(folder: Path, state: TrainingState) -> Path:
    """Write the state, then delete all but the last few checkpoints and the best.

    Returns:
        The file of numbers, which completes the checkpoint.
    """
    folder.mkdir(parents=True, exist_ok=True)
    tensors = save(state.tensors())
    record = _record(folder, state.step)
    write_bytes(record.with_suffix(".safetensors"), tensors, durable=True)
    write_json(record, {"sha256": hashlib.sha256(tensors).hexdigest(), **state.numbers()}, durable=True)
    _delete_old(folder, state)
    return record


def has_checkpoints(folder: Path) -> bool:
    """Whether a folder has a complete checkpoint, even a damaged one."""
    return bool(_records(folder))


def newest_checkpoint(folder: Path) -> Checkpoint | None:
    """The newest intact checkpoint of a folder; None if there are no checkpoints.

    Raises:
        InputError: there are checkpoints, but none is intact.
    """
    damaged: list[Path] = []
    for record in _records(folder):
        checkpoint = _read_checkpoint(record, tuple(damaged))
        if checkpoint is not None:
            return checkpoint
        damaged.append(record)
    if damaged:
        raise InputError(
            folder, "an intact checkpoint", f"{len(damaged)}, all damaged; the newest is {damaged[0].name}",
            advice="nothing was changed; train in a new folder, with --init and weights of this run to keep what was learned",
        )  # fmt: skip
    return None


def best_checkpoint(folder: Path, newest: Checkpoint) -> Checkpoint | None:
    """The checkpoint of the best validation, as recorded in the newest; None if there was none or it is damaged."""
    best = newest.numbers.get("best_step")
    if best is None:
        return None
    if best == newest.numbers["step"]:
        return newest
    return _read_checkpoint(_record(folder, int(best)))


def _record(folder: Path, step: int) -> Path:
    """The file of numbers of a checkpoint."""
    return folder / f"{step:08d}.json"


def _records(folder: Path) -> list[Path]:
    """The files of numbers of all checkpoints, the newest first."""
    return sorted(folder.glob("[0-9]*.json"), reverse=True)


def _read_checkpoint(record: Path, damaged: tuple[Path, ...] = ()) -> Checkpoint | None:
    """The checkpoint of a record, None if it is damaged."""
    contents = _read_intact(record)
    return None if contents is None else Checkpoint(load(contents[1]), contents[0], damaged)


def _read_intact(record: Path) -> tuple[dict[str, int | float], bytes] | None:
    """The numbers of a checkpoint and its file of tensors; None if either is damaged."""
    try:
        numbers = parse_json(record.read_bytes())
        tensors = record.with_suffix(".safetensors").read_bytes()
        intact = hashlib.sha256(tensors).hexdigest() == numbers.pop("sha256") and are_numbers(numbers)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
    return (numbers, tensors) if intact and _record(record.parent, numbers["step"]) == record else None


def _delete_old(folder: Path, state: TrainingState) -> None:
    """Delete checkpoints older than the last few intact ones, except the best, and incomplete files of a killed run.

    The newest is that of the state itself. Unreadable ones do not count. Those of later steps, which were skipped, stay until the run
    reaches their step.
    """
    own, best = _record(folder, state.step), _record(folder, state.best_step)
    intact = 0
    for record in _records(folder):
        if intact < KEPT:
            intact += record <= own and (record == own or _read_intact(record) is not None)
        elif record != best:
            record.unlink()
    kept = {record.stem for record in _records(folder)}
    for file in [*folder.glob("[0-9]*.safetensors"), *folder.glob(".[0-9]*.part")]:
        if file.stem not in kept:
            file.unlink()

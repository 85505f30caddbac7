"""Checkpoints: whole states on disk, of which the newest intact one counts.

A checkpoint is two files: `00012000.safetensors` with the tensors and, written after it, `00012000.json` with the numbers
and the hash of the first. Both are written to a temporary name and renamed, so a killed run leaves no half file under
a checkpoint's name; a file damaged later fails its hash.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from safetensors.torch import load, save
from torch import Tensor

from semgs.files.atomic import write_bytes, write_json
from semgs.training.state import TrainingState

KEPT = 3
"""How many checkpoints stay beside the best; each is about five times the size of the network."""


@dataclass(frozen=True)
class Checkpoint:
    """A state as it was read.

    Attributes:
        tensors: by name, as `TrainingState.tensors` gave them.
        numbers: as `TrainingState.numbers` gave them.
        damaged: newer checkpoints that had to be passed over.
    """

    tensors: dict[str, Tensor]
    numbers: dict[str, int | float]
    damaged: tuple[Path, ...]


def save_checkpoint(folder: Path, state: TrainingState) -> Path:
    """Write the state, then drop all but the last few checkpoints and the best.

    Returns:
        the file of numbers, which makes the checkpoint valid.
    """
    folder.mkdir(parents=True, exist_ok=True)
    tensors = save(state.tensors())
    record = _record(folder, state.step)
    write_bytes(record.with_suffix(".safetensors"), tensors, durable=True)
    write_json(record, {"sha256": hashlib.sha256(tensors).hexdigest(), **state.numbers()}, durable=True)
    _tidy(folder, state.best_step)
    return record


def newest_checkpoint(folder: Path) -> Checkpoint | None:
    """The newest intact checkpoint of a folder, None where there is none."""
    damaged: list[Path] = []
    for record in sorted(folder.glob("*.json"), reverse=True):
        checkpoint = _read(record, tuple(damaged))
        if checkpoint is not None:
            return checkpoint
        damaged.append(record)
    return None


def best_checkpoint(folder: Path) -> Checkpoint | None:
    """The checkpoint of the best validation, as the newest one knows it; None where there is none or it is damaged."""
    newest = newest_checkpoint(folder)
    if newest is None or "best_step" not in newest.numbers:
        return None
    return _read(_record(folder, int(newest.numbers["best_step"])))


def _record(folder: Path, step: int) -> Path:
    """The file of numbers of a checkpoint."""
    return folder / f"{step:08d}.json"


def _read(record: Path, damaged: tuple[Path, ...] = ()) -> Checkpoint | None:
    """The checkpoint of a record, None if it is damaged."""
    try:
        numbers = json.loads(record.read_text())
        tensors = record.with_suffix(".safetensors").read_bytes()
        intact = hashlib.sha256(tensors).hexdigest() == numbers.pop("sha256")
    except (OSError, ValueError, KeyError):
        return None
    return Checkpoint(load(tensors), numbers, damaged) if intact else None


def _tidy(folder: Path, best: int) -> None:
    """Remove older checkpoints but the best, and what a killed run left half-written."""
    records = sorted(folder.glob("*.json"))
    last = [record for record in records[:-KEPT] if record == _record(folder, best)] + records[-KEPT:]
    for old in set(records) - set(last):
        old.unlink()
    kept = {record.stem for record in last}
    for file in [*folder.glob("[0-9]*.safetensors"), *folder.glob(".[0-9]*.part")]:
        if file.stem not in kept:
            file.unlink()

"""The run folder: whose it is, and the weights that come out of it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from semgs.files.atomic import is_part_of, write_json
from semgs.files.errors import InputError
from semgs.rooms.assets.lock import lock_digest
from semgs.training.checkpoints import newest_checkpoint
from semgs.training.settings import TrainingSettings, differences
from semgs.training.state import TrainingState
from semgs.weights.file import save
from semgs.weights.load import load


def claim(out: Path, settings: TrainingSettings) -> None:
    """Make the folder a run of these settings.

    Raises:
        ValueError: it holds a run of other settings; they are listed.
        InputError: it holds something else.
    """
    record = out / "settings.json"
    if record.exists():
        other = differences(settings, read_settings(out))
        if other:
            listed = ", ".join(f"{name} = {there!r} there, {here!r} asked" for name, (here, there) in other.items())
            raise ValueError(f"{out} holds a run of other settings: {listed}; give the same ones or another folder")
        return
    if out.exists() and not (out.is_dir() and all(is_part_of(file, record) for file in out.iterdir())):
        raise InputError(out, "a new or empty folder, or a run to go on with", "something else", advice="name another")
    out.mkdir(parents=True, exist_ok=True)
    write_json(record, settings.as_json())


def hold_assets(out: Path, folders: Sequence[str]) -> None:
    """Note the locks of the assets that a run is furnished with, so that it goes on with the same only: a baked folder may have
    grown.

    Raises:
        InputError: the run began with others.
    """
    record = out / "assets.json"
    locks = [lock_digest(folder) for folder in folders]
    if not record.exists():
        if folders:
            write_json(record, locks)
        return
    there = record.read_text(encoding="utf-8")
    if json.loads(there) != locks:
        raise InputError(
            record, f"assets of the locks {', '.join(locks)}, which are asked for", f"others, {there}",
            advice="give those that the run began with, or another run folder",
        )  # fmt: skip


def read_settings(out: Path) -> TrainingSettings:
    """The settings of a run.

    Raises:
        InputError: the folder holds no run, or one that this version cannot read.
    """
    record = out / "settings.json"
    try:
        return TrainingSettings.from_json(json.loads(record.read_text()))
    except FileNotFoundError as error:
        raise InputError(record, "the settings of a training run", "no such file") from error
    except (ValueError, TypeError) as error:
        raise InputError(record, "the settings of a training run", str(error)) from error


def export_weights(run: Path, path: Path) -> Path:
    """Write the averaged weights of a run's newest checkpoint as a file of weights, in bfloat16.

    Its header says of which training they are: settings, step and seed.

    Raises:
        InputError: the run has no intact checkpoint yet.
    """
    settings = read_settings(run)
    checkpoint = newest_checkpoint(run / "checkpoints")
    if checkpoint is None:
        raise InputError(run, "a run with a checkpoint", "none that is intact", advice="train first")
    model = load(settings.model, "random", seed=settings.seed)
    state = TrainingState.begin(model, settings.learning_rate, settings.average_decay)
    state.restore(checkpoint.tensors, checkpoint.numbers)
    model.load_state_dict(state.average.module.state_dict())
    save(
        path,
        model,
        {
            "description": f"{settings.model}, {state.step} of {settings.steps} steps of a training in generated rooms",
            "training": json.dumps(settings.as_json()),
            "data": f"rooms of seed {settings.seed}, drawn live",
            "seed": str(settings.seed),
            "step": str(state.step),
        },
    )
    return path

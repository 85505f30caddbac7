"""The run folder: whose it is, its network, and the weights that come out of it."""

from __future__ import annotations

import errno
import json
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import fields, replace
from pathlib import Path

from filelock import FileLock, Timeout

from semgs.data.classes import SCANNET20
from semgs.data.terms import terms_text
from semgs.files.atomic import is_part_of, write_json
from semgs.files.errors import InputError
from semgs.files.paths import check_utf8
from semgs.files.strict_json import parse_json, read_json
from semgs.model.semgs import SemGS
from semgs.model.settings import NetworkSettings
from semgs.model.switches import Switches
from semgs.rooms.assets.lock import lock_digest
from semgs.training.checkpoints import Checkpoint, best_checkpoint, newest_checkpoint
from semgs.training.differences import changed, listed
from semgs.training.settings import TrainingSettings
from semgs.training.state import averaged_weights
from semgs.training.survey.record import RECORD, data_terms_of, scenes_of
from semgs.weights.file import save
from semgs.weights.load import DATA_TERMS, SCENES, untrained
from semgs.weights.start import start

SETTINGS = "settings.json"
WEIGHTS, BEST = "weights.safetensors", "best.safetensors"
"""The averaged weights of the newest checkpoint and of the best validation."""
NETWORK = "network.json"
"""The settings of the network, which may come from a file of weights that is not there any more when the run goes on."""

LOCK = "lock"
"""An empty file that whoever trains into the folder has locked; it stays when they end, without the lock."""


def claim(out: Path, settings: TrainingSettings) -> None:
    """Make the folder a run of these settings; one that is there may be a shorter one, which `prolong` makes longer.

    Raises:
        ValueError: it holds a run of other settings; they are listed.
        InputError: it holds something else, or its path is no UTF-8.
    """
    check_utf8(out, "TensorBoard")
    record = out / SETTINGS
    if record.exists():
        there = read_settings(out)
        if other := changed(settings, replace(there, steps=max(there.steps, settings.steps))):
            raise ValueError(
                f"{out} holds a run of other settings: {listed(other, 'asked')}; give the same ones or another folder "
                "(of a run that has begun only steps may change, and only grow)"
            )
        return
    # The record itself may appear meanwhile: the other processes of a training start at the same time.
    if out.exists() and not (
        out.is_dir() and all(file == record or is_part_of(file, record) for file in out.iterdir())
    ):
        raise InputError(out, "a new or empty folder, or a run to go on with", "something else", advice="name another")
    out.mkdir(parents=True, exist_ok=True)
    write_json(record, settings.as_json())


def prolong(out: Path, settings: TrainingSettings) -> None:
    """Note in the run folder that the run is to have more steps than it began with, where these settings have more.

    Raises:
        InputError: the folder holds no run.
    """
    there = read_settings(out)
    if settings.steps > there.steps:
        write_json(out / SETTINGS, replace(there, steps=settings.steps).as_json())


def alone(out: Path) -> AbstractContextManager[object]:
    """Be the only process that trains into a run folder, from this call until the block or the process ends.

    Raises:
        InputError: another process trains into it.
    """
    # The lock is a file of its own: the settings are replaced when the run becomes longer.
    try:
        return FileLock(out / LOCK).acquire(timeout=0)
    except Timeout as error:
        raise InputError(
            out, "a run that nobody trains", "one that another process is training",
            advice="end that first, or name another folder",
        ) from error  # fmt: skip
    except OSError as error:
        if error.errno not in (errno.ENOLCK, errno.EOPNOTSUPP):
            raise
        return nullcontext()  # a file system without locks


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
    there = read_json(record, "the locks of the assets of a run")
    if there != locks:
        raise InputError(
            record, f"assets of the locks {', '.join(locks)}, which are asked for", f"others, {there}",
            advice="give those that the run began with, or another run folder",
        )  # fmt: skip


def read_settings(out: Path) -> TrainingSettings:
    """The settings of a run.

    Raises:
        InputError: the folder holds no run, or one that this version cannot read.
    """
    record = out / SETTINGS
    if not record.exists():
        raise InputError(record, "the settings of a training run", "no such file")
    saved = read_json(record, "the settings of a training run")
    try:
        return TrainingSettings.from_json(saved)
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(record, "the settings of a training run", str(error)) from error


def network(out: Path, settings: TrainingSettings) -> SemGS:
    """The network of a run as it begins; of a run that has a checkpoint, one of the same shape, to be filled from there.

    Raises:
        InputError: the weights to start from cannot be used, or the run has lost all its checkpoints.
    """
    classes = settings.classes or SCANNET20
    record = out / NETWORK
    if newest_checkpoint(out / "checkpoints") is None:
        if lost := [name for name in (WEIGHTS, BEST) if (out / name).exists()]:
            raise InputError(
                out, "a run with a checkpoint to go on from", f"none, but {' and '.join(lost)}",
                advice=f"nothing was changed; train in a new folder, with --init {out / lost[0]} to keep what was learned",
            )  # fmt: skip
        model = start(
            settings.model, settings.init, seed=settings.seed, classes=classes,
            own_classes=settings.classes is not None, switches=_switched(settings.network),
            fresh_semantics=settings.semantic_branch == "drawn", backbone=settings.backbone,
        )  # fmt: skip
        write_json(record, model.settings.as_json())
        return model
    try:
        return untrained(NetworkSettings.from_json(parse_json(record.read_bytes())), settings.seed, classes)
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(
            record, "the settings of a network", f"{type(error).__name__}: {error}",
            advice="another version of semgs wrote it; go on with that one or name a new folder",
        ) from error  # fmt: skip


def finished(run: Path) -> bool:
    """Whether a run's newest intact checkpoint is that of its last step.

    Raises:
        InputError: the folder holds no run.
    """
    checkpoint = newest_checkpoint(run / "checkpoints")
    return checkpoint is not None and checkpoint.numbers["step"] >= read_settings(run).steps


def export_weights(run: Path, path: Path, *, best: bool = False) -> Path:
    """Write the averaged weights of a run's newest checkpoint, or its best, as a file of weights, in bfloat16.

    Its header says of which training they are: settings, step, seed, the terms of its data and, where scenes are from files, their names.

    Raises:
        InputError: the run has no intact checkpoint yet.
    """
    settings = read_settings(run)
    checkpoint: Checkpoint | None = (best_checkpoint if best else newest_checkpoint)(run / "checkpoints")
    if checkpoint is None:
        raise InputError(run, "a run with a checkpoint", "none that is intact", advice="train first")
    model = network(run, settings)
    model.load_state_dict(averaged_weights(checkpoint.tensors))
    step = int(checkpoint.numbers["step"])
    live = all(source.is_rooms for source in settings.sources)
    data = "generated rooms" if live else ", ".join(Path(source.path).name for source in settings.sources)
    scenes = scenes_of(run / RECORD)
    save(
        path,
        model,
        {
            **({SCENES: json.dumps(scenes)} if scenes else {}),
            DATA_TERMS: terms_text(data_terms_of(run / RECORD)),
            "description": f"{settings.model}, {step} of {settings.steps} steps of a training in {data}",
            "training": json.dumps(settings.published()),
            "data": f"rooms of seed {settings.seed}, drawn live" if live else ", ".join(settings.published()["data"]),
            "seed": str(settings.seed),
            "step": str(step),
        },
    )
    return path


def _switched(switches: Switches) -> dict[str, bool | int | tuple[int, ...]]:
    """The switches that are not as they are by default."""
    usual = Switches()
    return {
        one.name: getattr(switches, one.name)
        for one in fields(switches)
        if getattr(switches, one.name) != getattr(usual, one.name)
    }

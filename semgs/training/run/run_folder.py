"""The run folder: its settings, its lock, its network and the weights exported from it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

from semgs.data.origin.terms import terms_text
from semgs.files.atomic import is_part_of, write_json
from semgs.files.contents import sha256
from semgs.files.errors import InputError, input_error, readable
from semgs.files.folders import lock_folder
from semgs.files.paths import check_utf8, typed_path
from semgs.files.strict_json import parse_json, read_json
from semgs.model.layers.network_input import padded_size
from semgs.model.semgs import SemGS
from semgs.model.settings import NetworkSettings
from semgs.model.weights.header import DATA_TERMS, SCENES
from semgs.model.weights.initial_weights import changed_switches, initial_network
from semgs.model.weights.load import untrained
from semgs.model.weights.weights_file import save
from semgs.scene.coarse_depth import SHRINK
from semgs.training.data.data_check.scene_record import RECORD, data_terms_of, scenes_of
from semgs.training.data.room_source import room_source
from semgs.training.run.checkpoints import best_checkpoint, has_checkpoints, newest_checkpoint
from semgs.training.state import averaged_weights
from semgs.training.training_settings import BEST, WEIGHTS, TrainingSettings, find_changes, list_changes

SETTINGS = "settings.json"
NETWORK = "network.json"
"""The settings of the network. They may come from a weights file that no longer exists when the run resumes."""
ASSETS = "assets.json"
ROOMS_POOL = "rooms"
"""The folder of the rooms that several samples share."""

_STARTS = ("init", "backbone")
"""The settings that name a file which a run starts from. RUN/NAME.json has its SHA-256."""


def claim_folder(out: Path, settings: TrainingSettings) -> None:
    """Make the folder a run with these settings, or check that it can become one. `start_run` then records the settings.

    A run with fewer steps will do, and so will any that has not `begun`: it has nothing to lose.

    Raises:
        InputError: it contains a run with other settings, which are listed, or something else, or its path is not UTF-8.
    """
    check_utf8(out, "TensorBoard")
    record = out / SETTINGS
    if record.exists():
        there = read_settings(out)
        other = find_changes(settings, replace(there, steps=max(there.steps, settings.steps)))
        if other and has_begun(out):
            raise InputError(
                out, "a run with the same settings", f"other settings: {list_changes(other, 'requested')}",
                advice="use the same settings or another folder (steps may grow, and files and folders may move but keep their names)",
            )  # fmt: skip
        return
    # The record itself may appear at any moment: the other processes of a training start at the same time.
    if out.exists() and not (
        out.is_dir() and all(file == record or is_part_of(file, record) for file in out.iterdir())
    ):
        raise InputError(out, "a new or empty folder, or a run to resume", "something else", advice="name another")
    out.mkdir(parents=True, exist_ok=True)
    write_json(record, settings.as_json())


def has_begun(out: Path) -> bool:
    """Whether a run has learned something: it has a checkpoint, even a damaged one, or weights."""
    return has_checkpoints(out / "checkpoints") or any((out / name).exists() for name in (WEIGHTS, BEST))


def start_run(out: Path, settings: TrainingSettings) -> None:
    """Record the settings of a run and what it starts from; call this with its lock.

    What a run that never reached a checkpoint has left is removed: it may have had other settings or other data.

    Raises:
        InputError: the run has other settings, or a file that it would start from cannot be read.
    """
    claim_folder(out, settings)  # again, as another process may have trained here since
    if has_begun(out):
        extend_run(out, settings)
        return
    for name in (NETWORK, RECORD, ASSETS, *(f"{start}.json" for start in _STARTS)):
        (out / name).unlink(missing_ok=True)
    shutil.rmtree(out / ROOMS_POOL, ignore_errors=True)
    write_json(out / SETTINGS, settings.as_json())
    record_files(out, settings)


def extend_run(out: Path, settings: TrainingSettings) -> None:
    """Record the number of steps, if the run now has more than it started with.

    Raises:
        InputError: the folder is not a run.
    """
    there = read_settings(out)
    if settings.steps > there.steps:
        write_json(out / SETTINGS, replace(there, steps=settings.steps).as_json())


def lock_run(out: Path) -> AbstractContextManager[None]:
    """Lock a run folder; an InputError if another process trains into it."""
    return lock_folder(out, "a run that no process is training", "one that another process is training")


def record_files(out: Path, settings: TrainingSettings) -> None:
    """Record which assets and weights a run starts from, or check that they are those.

    Raises:
        InputError: the run started from others, or they cannot be read.
    """
    record_assets(out, settings.assets)
    record_weights(out, settings)


def record_assets(out: Path, folders: Sequence[str]) -> None:
    """Record which assets a run uses, so that it only resumes with the same ones: an asset folder may have grown.

    Raises:
        InputError: the run started with other assets.
    """
    record = out / ASSETS
    locks = [room_source().digest(Path(folder)) for folder in folders]
    if not record.exists():
        if folders:
            write_json(record, locks)
        return
    there = read_json(record, "the locks of the assets of a run")
    if there != locks:
        raise InputError(
            record, f"the requested assets (locks {', '.join(locks)})", f"others, {there}",
            advice="use those that the run started with, or another run folder",
        )  # fmt: skip


def record_weights(out: Path, settings: TrainingSettings) -> None:
    """Record the SHA-256 of the files that a run starts from, so that it does not resume with others of the same names.

    Files that are gone are not checked, as a run with a checkpoint does not need them, nor are those of a run that began without a record.

    Raises:
        InputError: a file is not the one that the run started from, or cannot be read.
    """
    begun = has_begun(out)
    paths = {name: typed_path(place) for name in _STARTS if (place := getattr(settings, name))}
    for name, path in paths.items():
        record = out / f"{name}.json"
        with readable(path):
            if not path.is_file() or (begun and not record.exists()):
                continue
            found = sha256(path)
        if not begun:
            write_json(record, found)
        elif (there := read_json(record, "the SHA-256 of a file")) != found:
            raise InputError(
                path, f"the file that {out} started from, with SHA-256 {there!s:.64}", f"one with {found}",
                advice="restore it, or train in a new folder",
            )  # fmt: skip


def read_settings(out: Path) -> TrainingSettings:
    """The settings of a run.

    Raises:
        InputError: the folder is not a run, or is one that this version cannot read.
    """
    record = out / SETTINGS
    if not record.exists():
        raise InputError(record, "the settings of a training run", "no such file")
    saved = read_json(record, "the settings of a training run")
    with input_error(record, "the settings of a training run"):
        return TrainingSettings.from_json(saved)


def start_network(out: Path, settings: TrainingSettings) -> SemGS:
    """The network that a run without a checkpoint starts with.

    Raises:
        InputError: the initial weights cannot be used, the run has lost all its checkpoints, or windows do not fit the images.
    """
    if lost := [name for name in (WEIGHTS, BEST) if (out / name).exists()]:
        raise InputError(
            out, "a checkpoint to resume from", f"none, but {' and '.join(lost)}",
            advice=f"nothing was changed; train in a new folder, with --init {out / lost[0]} to keep what was learned",
        )  # fmt: skip
    model = initial_network(
        settings.model, settings.init, seed=settings.seed, classes=settings.table,
        own_classes=settings.classes is not None, switches=changed_switches(settings.network, settings.model),
        fresh_semantics=settings.semantic_branch == "drawn", backbone=settings.backbone,
    )  # fmt: skip
    if not settings.single_images:  # these pass no transformer
        halves = [tuple(side // 2 for side in settings.size)] if settings.half_size else []
        for size in (settings.size, *halves):
            check_windows(model.settings, size)
    write_json(out / NETWORK, model.settings.as_json())
    return model


def check_windows(network: NetworkSettings, size: tuple[int, ...]) -> None:
    """Refuse a network whose windows do not fit images of a size (height, width) [px].

    Raises:
        InputError: the tokens of a side cannot be divided among the windows.
    """
    semantic = network.semantic
    branches = {"windows": network.colour.transformer}
    if semantic is not None and semantic.compares_views:
        branches["windows-semantic"] = semantic.transformer
    for name, branch in branches.items():
        tokens = [side // (SHRINK * branch.reduction) for side in padded_size(size)]
        if any(side % branch.windows for side in tokens):
            raise InputError(
                f"--network.{name}", f"a number that divides the {tokens[0]}x{tokens[1]} tokens of images of {size[0]}x{size[1]}",
                f"{branch.windows}", advice="give another one, or another --size",
            )  # fmt: skip


def empty_network(out: Path, settings: TrainingSettings) -> SemGS:
    """A network of a run's shape, to be filled from a checkpoint.

    Raises:
        InputError: the settings of the network are damaged, or another version wrote them.
    """
    record = out / NETWORK
    try:
        return untrained(NetworkSettings.from_json(parse_json(record.read_bytes())), settings.seed, settings.table)
    except (OSError, ValueError, TypeError, KeyError, AttributeError, ArithmeticError) as error:
        raise InputError(
            record, "the settings of a network", f"{type(error).__name__}: {error}",
            advice="another version of semgs wrote it; resume with that version, or name a new folder",
        ) from error  # fmt: skip


def is_finished(run: Path) -> bool:
    """Whether a run's newest intact checkpoint is that of its last step, with nothing left to validate.

    Raises:
        InputError: the folder is not a run.
    """
    checkpoint = newest_checkpoint(run / "checkpoints")
    if checkpoint is None or checkpoint.numbers.get("validation_due"):
        return False
    return checkpoint.numbers["step"] >= read_settings(run).steps


def export_weights(run: Path) -> None:
    """Write the averaged weights of a run's newest checkpoint and, if it was validated, of its best one, in bfloat16.

    Raises:
        InputError: the run has no intact checkpoint yet.
    """
    settings, folder = read_settings(run), run / "checkpoints"
    newest = newest_checkpoint(folder)
    if newest is None:
        raise InputError(run, "a run with a checkpoint", "none that is intact", advice="train first")
    model = empty_network(run, settings)
    for name, checkpoint in ((WEIGHTS, newest), (BEST, best_checkpoint(folder, newest))):
        if checkpoint is not None:
            model.load_state_dict(averaged_weights(checkpoint.tensors))
            save(run / name, model, _header(run, settings, int(checkpoint.numbers["step"])))


def _header(run: Path, settings: TrainingSettings, step: int) -> dict[str, str]:
    """What weights say about their training: settings, step, seed, terms of the data and, for scenes from files, their names."""
    live = all(source.is_rooms for source in settings.sources)
    data = "generated rooms" if live else ", ".join(Path(source.path).name for source in settings.sources)
    scenes = scenes_of(run / RECORD)
    return {
        **({SCENES: json.dumps(scenes)} if scenes else {}),
        DATA_TERMS: terms_text(data_terms_of(run / RECORD)),
        "description": f"{settings.model}, {step} of {settings.steps} steps of a training in {data}",
        "training": json.dumps(settings.published()),
        "data": f"rooms of seed {settings.seed}, drawn live" if live else ", ".join(settings.published()["data"]),
        "seed": str(settings.seed),
        "step": str(step),
    }

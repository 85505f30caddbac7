"""Where a training starts: a network drawn at random, or weights of which it keeps all that fits its classes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch

from semgs.data.classes import SCANNET20, ClassTable
from semgs.files.errors import InputError
from semgs.model.presets import NAMES
from semgs.model.semgs import SemGS, arguments
from semgs.weights.file import fill, is_ours, read_header, read_tensors
from semgs.weights.load import drawn, find, from_mvsplat, load, shipped

SEMANTIC_SHAPE = ("semantic_pyramid",)
"""Settings that shape the semantic branch alone: weights that have others lend a network all else."""

CLASS_LAYERS = ("semantic_head.2.", "semantic_refinement.classes.")
"""Where the names of the layers that predict classes begin: the head's, whose first rows are the covariance's, which any table has, and a pyramid's."""


def start(
    name: str,
    init: str,
    *,
    seed: int = 0,
    classes: ClassTable = SCANNET20,
    own_classes: bool = False,
    switches: Mapping[str, bool | int | tuple[int, ...]] | None = None,
    fresh_semantics: bool = False,
) -> SemGS:
    """The network that a training starts with; `origin` of the result says what was kept of which weights.

    Args:
        name: "small" or "base".
        init: "random", the name of weights that ship, a hub id, or a file: ours, or MVSplat's checkpoint for "base".
        seed: of what is drawn.
        classes: the table to train on.
        own_classes: weights of another table are taken without their class head, which is drawn; else they are refused.
        switches: constructor arguments that differ from the network of that name; they must be those that the weights have,
            but for the shape of the semantic branch: where that differs the branch is drawn, and all else is kept.
        fresh_semantics: draw it in any case.

    Raises:
        InputError: the weights are absent, cannot be read or do not fit; the tensor, table or switch is named.
    """
    switched = {} if switches is None else dict(switches)
    if init == "random":
        if not switched:
            return load(name, init, seed=seed, classes=classes)
        return with_settings(drawn(name, seed, classes).settings | switched, classes, seed)
    if init in NAMES and shipped(init) is None:
        raise InputError(
            init, "random, a file of weights, or a name under which some ship", "a name under which none do"
        )
    _, path = find(init)
    if not is_ours(path):
        if not switched or name == "small":
            return load(name, path, seed=seed, classes=classes)
        return from_mvsplat(with_settings(drawn(name, seed, classes).settings | switched, classes, seed), path, seed)
    header = read_header(path)
    for key, value in switched.items():
        if header.settings.get(key, value) != value and key not in SEMANTIC_SHAPE:
            raise InputError(
                path, f"weights of a network with {key} = {value}", f"{header.settings[key]}", key="settings"
            )
    shape = {key: switched[key] for key in SEMANTIC_SHAPE if switched.get(key)}
    other = fresh_semantics or any(tuple(header.settings.get(key, ())) != value for key, value in shape.items())
    if other and header.settings.get("name") == name:
        return _with_another_branch(path, header.settings | shape, classes, seed)
    if header.classes not in (None, classes) and not own_classes:
        raise InputError(
            path, f"class table {classes.name} ({len(classes)} classes)", f"{header.classes.name} ({len(header.classes)} classes)",
            key="classes", advice="name the table to train on with --classes FILE",
        )  # fmt: skip
    if header.classes == classes or header.settings.get("name") != name:
        model = load(name, path, classes=classes)
        model.origin = f"{path.name}: all {len(model.state_dict())} tensors kept"
        return model
    return _with_other_classes(path, header.settings, classes, seed)


def with_settings(settings: Mapping[str, Any], classes: ClassTable | None, seed: int = 0) -> SemGS:
    """An untrained network from what `SemGS.settings` says; the caller's random state is left as it was.

    Raises:
        TypeError, ValueError: these are no such settings.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        model = SemGS(classes=classes, **arguments(settings))
    model.origin = f"untrained: drawn at random with seed {seed}"
    return model


def _with_another_branch(path: Path, settings: Mapping[str, Any], classes: ClassTable, seed: int) -> SemGS:
    """The network of a file but for the semantic branch, which these settings shape."""
    model = with_settings(settings, classes, seed)
    own, theirs = model.state_dict(), read_tensors(path)
    kept = {name: tensor for name, tensor in theirs.items() if not name.startswith("semantic_")}
    fresh = {name: tensor for name, tensor in own.items() if name.startswith("semantic_")}
    fill(model, kept | fresh, path)
    model.origin = (
        f"{path.name}: {len(kept)} of {len(own)} tensors kept; the semantic branch drawn anew with seed {seed}"
    )
    return model


def _with_other_classes(path: Path, settings: Mapping[str, Any], classes: ClassTable, seed: int) -> SemGS:
    """The network of a file for another table: everything but the rows of the classes."""
    model = with_settings(settings, classes, seed)
    own, theirs = model.state_dict(), read_tensors(path)
    fresh = [name for name in own if name.startswith(CLASS_LAYERS)]
    kept = dict(theirs)
    for name in fresh:
        rows = own[name].clone()
        shared = len(rows) - len(classes)
        if name in theirs and theirs[name].shape[1:] == rows.shape[1:] and len(theirs[name]) >= shared:
            rows[:shared] = theirs[name][:shared]
        kept[name] = rows
    fill(model, kept, path)
    model.origin = (
        f"{path.name}: {len(own) - len(fresh)} of {len(own)} tensors kept; drawn anew for the {len(classes)} classes of "
        f"{classes.name} with seed {seed}: {', '.join(fresh)}"
    )
    return model

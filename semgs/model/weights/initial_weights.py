"""The network that a training starts with: random, or from weights as far as they fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from torch import Tensor

from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.errors import InputError
from semgs.model.networks import NAMES, NETWORKS, named_switches
from semgs.model.semgs import SemGS
from semgs.model.settings import NetworkSettings
from semgs.model.switches import Switches, switched, switches_of
from semgs.model.weights.load import (
    find,
    from_mvsplat,
    load,
    other_table,
    semantic_tensors,
    shipped,
    untrained,
)
from semgs.model.weights.pretrained import as_large_as
from semgs.model.weights.published_backbones import is_mosaic, is_published, with_backbone
from semgs.model.weights.weights_file import fill, is_ours, read_header, read_tensors

SEMANTIC_SHAPE = ("class_backbone",)
"""Switches that only shape the semantic branch: from weights with other values, everything else is kept."""

FRESH_SHAPE = ("shared_layers", "windows_semantic", "camera_aware_semantic", "semantic_transformer")
"""The other switches of the semantic branch: weights with other values fit if the branch is drawn anew."""

MORE_DEPTH = ("cost_filter", "depth_cue", "depth_upsampling")
"""Switches that add layers to depth: from weights without these layers, everything else is kept."""

BESIDE = ("class_mosaic",)
"""Switches of a network beside the semantic branch: with or without it, everything else is kept."""

NO_WEIGHTS = ("class_fusion",)
"""Switches that no layer depends on: weights with other values are kept whole."""

ADDED = ("colour.depth.filter.", "colour.depth.regressor.cues.", "colour.heads.convex.")
"""Beginnings of the tensor names of the layers added to depth."""

SECOND = "semantic.mosaic."
"""Beginning of the tensor names of the network beside the semantic branch."""


def initial_network(
    name: str,
    init: str,
    *,
    seed: int = 0,
    classes: ClassTable = SCANNET20,
    own_classes: bool = False,
    switches: Mapping[str, Any] | None = None,
    fresh_semantics: bool = False,
    backbone: str = "",
) -> SemGS:
    """The network that a training starts with; its `origin` says which weights were kept.

    Args:
        name: "small" or "base".
        init: "random", the name of included weights, a hub id, or a file: a weights file, or MVSplat's checkpoint for "base".
        seed: of random weights.
        classes: the class table to train on.
        own_classes: use weights with another class table, but with a new class head; otherwise they are refused.
        switches: fields of `semgs.model.switches.Switches` that differ from the network of that name. They must agree with the weights,
            except for the class backbone, for layers added to depth, for a network beside the semantic branch, for switches without layers and, with `fresh_semantics`, for the
            semantic branch: layers that differ start at random, all others are kept.
        fresh_semantics: always reinitialise the semantic branch.
        backbone: a file of published MobileNetV2 weights for a network with `class_backbone`, or of MOSAIC's for one with `class_mosaic`; ""
            keeps those of `init`. With such a file as `init`, everything else is random.

    Raises:
        InputError: the weights are missing, unreadable or do not fit; the tensor, class table or switch is named.
    """
    requested = dict(switches or {})
    if backbone:
        network = initial_network(
            name, init, seed=seed, classes=classes, own_classes=own_classes, switches=switches, fresh_semantics=fresh_semantics
        )  # fmt: skip
        return with_backbone(network, backbone)
    if init == "random":
        return untrained(_switched(NETWORKS[name](), requested), seed, classes).eval()
    if init in NAMES and shipped(init) is None:
        raise InputError(
            init, "random, a weights file, or the name of included weights", "a name without included weights"
        )
    _, path = find(init)
    if is_published(path):
        added = {"class_mosaic" if is_mosaic(path) else "class_backbone": True}
        settings = _switched(NETWORKS[name](), {**added, **requested})
        return with_backbone(untrained(settings, seed, classes), path)
    if is_ours(path):
        return _from_weights(name, path, requested, seed, classes, own_classes, fresh_semantics)
    if not requested or name.startswith("small"):
        return load(name, path, seed=seed, classes=classes)
    return from_mvsplat(untrained(_switched(NETWORKS[name](), requested), seed, classes), path, seed)


def _from_weights(
    name: str,
    path: Path,
    requested: Mapping[str, Any],
    seed: int,
    classes: ClassTable,
    own_classes: bool,
    fresh_semantics: bool,
) -> SemGS:
    """The network of a weights file, with the requested switches and class table."""
    header = read_header(path)
    own_branch = (*SEMANTIC_SHAPE, *FRESH_SHAPE) if fresh_semantics else SEMANTIC_SHAPE
    _check_switches(path, requested, switches_of(header.settings), own_branch)
    present = _switched(header.settings, {key: requested[key] for key in NO_WEIGHTS if key in requested})
    layers = {key: requested[key] for key in (*own_branch, *MORE_DEPTH, *BESIDE) if key in requested}
    wanted = _switched(present, layers)
    if header.settings.name != name:
        return load(name, path, classes=classes)  # raises an InputError
    fresh_semantics |= (
        wanted.semantic != _switched(present, {key: layers[key] for key in BESIDE if key in layers}).semantic
    )
    if not fresh_semantics and header.classes not in (None, classes) and not own_classes:
        raise other_table(path, classes, header.classes, "name the table to train on with --classes FILE")
    fresh_classes = header.classes != classes
    if fresh_semantics or fresh_classes or wanted != header.settings:
        return _fill_fitting(path, wanted, classes, seed, fresh_classes, fresh_semantics)
    model = load(name, path, classes=classes)
    model.origin = f"{path.name}: all {len(model.state_dict())} tensors kept"
    return model


def _check_switches(path: Path, requested: Mapping[str, Any], present: Switches, own_branch: tuple[str, ...]) -> None:
    """Refuse weights whose switches differ from the requested ones, unless layers can be added or exchanged.

    Args:
        path: of the weights.
        requested, present: the switches of the network and of the weights.
        own_branch: switches that only change a semantic branch that does not keep its weights.
    """
    for key, value in requested.items():
        fits = key in (*own_branch, *BESIDE, *NO_WEIGHTS) or (
            key in MORE_DEPTH and getattr(present, key) == getattr(Switches, key)
        )
        if getattr(present, key) != value and not fits:
            raise InputError(
                path, f"weights of a network with {key} = {value}", f"{getattr(present, key)}", key="settings"
            )


def changed_switches(switches: Switches, network: str) -> dict[str, Any]:
    """The switches that differ from those of the network of that name."""
    own = asdict(named_switches(network))
    return {name: value for name, value in asdict(switches).items() if value != own[name]}


def _switched(settings: NetworkSettings, changes: Mapping[str, Any]) -> NetworkSettings:
    """`switched`, with an error for the user.

    Raises:
        InputError: the switches contradict each other.
    """
    try:
        return switched(settings, changes)
    except ValueError as error:
        raise InputError("--network", "switches that agree", "some that do not", advice=f"{error}") from None


def _fill_fitting(
    path: Path, settings: NetworkSettings, classes: ClassTable, seed: int, fresh_classes: bool, fresh_semantics: bool
) -> SemGS:
    """A network with these settings and all tensors of a file that fit; the others are random.

    Args:
        path: of the weights.
        settings: of the network; it may have another semantic branch than the weights, and more layers in depth.
        classes: the class table.
        seed: of random weights.
        fresh_classes: reinitialise the rows of the classes, because the weights have another class table.
        fresh_semantics: reinitialise the semantic branch.
    """
    with as_large_as(path):
        model = untrained(settings, seed, classes)
    random = model.state_dict()
    saved = {
        name: tensor
        for name, tensor in read_tensors(path).items()
        if name in random or not name.startswith((*ADDED, SECOND))
    }
    missing = [name for name in random if name.startswith((*ADDED, SECOND)) and name not in saved]
    fresh = {name: random[name] for name in missing}
    notes = [f"the layers added to depth drawn with seed {seed}"] if any(map(_in_depth, missing)) else []
    if not all(map(_in_depth, missing)):
        notes.append(f"MOSAIC drawn with seed {seed}")
    if fresh_semantics:
        saved = {name: tensor for name, tensor in saved.items() if not name.startswith("semantic.")}
        fresh |= {name: random[name] for name in semantic_tensors(model)}
        notes.append(f"the semantic branch drawn anew with seed {seed}")
    elif fresh_classes:
        class_layers = model.parts()["classes"]
        names = [name for name in random if name in class_layers]
        fresh |= {name: _keep_rows(random[name], saved.get(name), len(classes)) for name in names}
        notes.append(
            f"drawn anew for the {len(classes)} classes of {classes.name} with seed {seed}: {', '.join(names)}"
        )
    fill(model, saved | fresh, path, model.name)
    kept = len(random) - len(fresh)
    model.origin = "; ".join([f"{path.name}: {kept} of {len(random)} tensors kept", *notes])
    return model


def _in_depth(name: str) -> bool:
    """Whether a tensor is one of the layers added to depth."""
    return name.startswith(ADDED)


def _keep_rows(random: Tensor, saved: Tensor | None, classes: int) -> Tensor:
    """Random rows for the classes, which come last, below the rows of saved weights."""
    rows, shared = random.clone(), len(random) - classes
    if saved is not None and saved.shape[1:] == rows.shape[1:] and len(saved) >= shared:
        rows[:shared] = saved[:shared]
    return rows

"""The network that a training starts with: random, or from weights as far as they fit."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.errors import InputError
from semgs.model.networks import NAMES, NETWORKS
from semgs.model.semgs import SemGS
from semgs.model.settings import NetworkSettings
from semgs.model.switches import switched, switches_of
from semgs.model.weights.load import (
    as_large_as,
    find,
    from_mvsplat,
    load,
    other_table,
    semantic_tensors,
    shipped,
    untrained,
)
from semgs.model.weights.published_backbones import is_published, with_backbone
from semgs.model.weights.weights_file import fill, is_ours, read_header, read_tensors

SEMANTIC_SHAPE = ("class_backbone",)
"""Switches that only shape the semantic branch: from weights with other values, everything else is kept."""

MORE_DEPTH = ("cost_filter", "depth_cue")
"""Switches that add layers to depth: from weights without these layers, everything else is kept."""

NO_WEIGHTS = ("class_fusion",)
"""Switches that no layer depends on: weights with other values are kept whole."""

ADDED = ("colour.depth.filter.", "colour.depth.regressor.cues.")
"""Beginnings of the tensor names of those layers."""


def start(
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
            except for the shape of the semantic branch, for layers added to depth and for switches without layers: layers that differ
            start at random, all others are kept.
        fresh_semantics: always reinitialise the semantic branch.
        backbone: a file of published MobileNetV2 weights for a network with `class_backbone`; "" keeps that of `init`. With such a file
            as `init`, everything but the backbone is random.

    Raises:
        InputError: the weights are missing, unreadable or do not fit; the tensor, class table or switch is named.
    """
    asked = {} if switches is None else dict(switches)
    if backbone:
        begun = start(
            name, init, seed=seed, classes=classes, own_classes=own_classes, switches=switches, fresh_semantics=fresh_semantics
        )  # fmt: skip
        return with_backbone(begun, backbone)
    if init == "random":
        return untrained(_switched(NETWORKS[name](), asked), seed, classes).eval()
    if init in NAMES and shipped(init) is None:
        raise InputError(
            init, "random, a weights file, or the name of included weights", "a name without included weights"
        )
    _, path = find(init)
    if is_published(path):
        return with_backbone(
            untrained(_switched(NETWORKS[name](), {"class_backbone": True, **asked}), seed, classes), path
        )
    if not is_ours(path):
        if not asked or name == "small":
            return load(name, path, seed=seed, classes=classes)
        return from_mvsplat(untrained(_switched(NETWORKS[name](), asked), seed, classes), path, seed)
    header = read_header(path)
    there = switches_of(header.settings)
    for key, value in asked.items():
        fits = key in (*SEMANTIC_SHAPE, *NO_WEIGHTS) or (key in MORE_DEPTH and not getattr(there, key))
        if getattr(there, key) != value and not fits:
            raise InputError(
                path, f"weights of a network with {key} = {value}", f"{getattr(there, key)}", key="settings"
            )
    kept = _switched(header.settings, {key: asked[key] for key in NO_WEIGHTS if key in asked})
    wanted = _switched(kept, {key: asked[key] for key in (*SEMANTIC_SHAPE, *MORE_DEPTH) if asked.get(key)})
    if header.settings.name != name:
        return load(name, path, classes=classes)  # raises an InputError
    fresh_semantics |= wanted.semantic != kept.semantic
    if not fresh_semantics and header.classes not in (None, classes) and not own_classes:
        raise other_table(path, classes, header.classes, "name the table to train on with --classes FILE")
    fresh_classes = header.classes != classes
    if fresh_semantics or fresh_classes or wanted != header.settings:
        return _lent(path, wanted, classes, seed, fresh_classes, fresh_semantics)
    model = load(name, path, classes=classes)
    model.origin = f"{path.name}: all {len(model.state_dict())} tensors kept"
    return model


def _switched(settings: NetworkSettings, changes: Mapping[str, Any]) -> NetworkSettings:
    """`switched`, with an error for the user.

    Raises:
        InputError: the switches contradict each other.
    """
    try:
        return switched(settings, changes)
    except ValueError as error:
        raise InputError("--network", "switches that agree", "some that do not", advice=f"{error}") from None


def _lent(
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
    own = model.state_dict()
    theirs = {key: one for key, one in read_tensors(path).items() if key in own or not key.startswith(ADDED)}
    added = [name for name in own if name.startswith(ADDED) and name not in theirs]
    kept = theirs | {name: own[name] for name in added}
    notes = [f"the layers added to depth drawn with seed {seed}"] if added else []
    fresh = list(added)
    if fresh_semantics:
        semantic = semantic_tensors(model)
        kept = {name: tensor for name, tensor in kept.items() if not name.startswith("semantic.")}
        kept |= {name: own[name] for name in semantic}
        fresh += semantic
        notes.append(f"the semantic branch drawn anew with seed {seed}")
    elif fresh_classes:
        predict = model.parts()["classes"]
        names = [name for name in own if name in predict]
        for name in names:
            rows = own[name].clone()
            shared = len(rows) - len(classes)
            if name in theirs and theirs[name].shape[1:] == rows.shape[1:] and len(theirs[name]) >= shared:
                rows[:shared] = theirs[name][:shared]
            kept[name] = rows
        fresh += names
        notes.append(
            f"drawn anew for the {len(classes)} classes of {classes.name} with seed {seed}: {', '.join(names)}"
        )
    fill(model, kept, path, model.name)
    model.origin = "; ".join([f"{path.name}: {len(own) - len(fresh)} of {len(own)} tensors kept", *notes])
    return model

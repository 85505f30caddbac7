"""Where a training starts: a network drawn at random, or weights of which it keeps all that fits its classes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from semgs.data.classes import SCANNET20, ClassTable
from semgs.files.errors import InputError
from semgs.model.networks import NAMES, NETWORKS
from semgs.model.semgs import SemGS
from semgs.model.settings import NetworkSettings
from semgs.model.switches import switched, switches_of
from semgs.weights.file import fill, is_ours, read_header, read_tensors
from semgs.weights.load import as_large_as, find, from_mvsplat, load, other_table, semantic_tensors, shipped, untrained
from semgs.weights.published import is_published, with_backbone

SEMANTIC_SHAPE = ("semantic_pyramid", "class_backbone")
"""Switches that shape the semantic branch alone: weights that have others lend a network all else."""

MORE_DEPTH = ("cost_filter", "depth_cue")
"""Switches that add layers to depth: weights without them lend a network all else."""

ADDED = ("colour.depth.filter.", "colour.depth.regressor.cues.")
"""How the names of the tensors of those layers begin."""


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
    """The network that a training starts with; `origin` of the result says what was kept of which weights.

    Args:
        name: "small" or "base".
        init: "random", the name of weights that ship, a hub id, or a file: ours, or MVSplat's checkpoint for "base".
        seed: of what is drawn.
        classes: the table to train on.
        own_classes: weights of another table are taken without their class head, which is drawn; else they are refused.
        switches: of `semgs.model.switches.Switches`, by name, that differ from the network of that name; they must be those that
            the weights have, but for the shape of the semantic branch and for layers added to depth: what differs is drawn, and all
            else is kept.
        fresh_semantics: draw it in any case.
        backbone: a file of published MobileNetV2 weights, for a network with `class_backbone`; "" keeps what `init` gives. As `init`
            itself such a file fills the backbone of a network that is random otherwise.

    Raises:
        InputError: the weights are absent, cannot be read or do not fit; the tensor, table or switch is named.
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
            init, "random, a file of weights, or a name under which some ship", "a name under which none do"
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
        fits = key in SEMANTIC_SHAPE or (key in MORE_DEPTH and not getattr(there, key))
        if getattr(there, key) != value and not fits:
            raise InputError(
                path, f"weights of a network with {key} = {value}", f"{getattr(there, key)}", key="settings"
            )
    wanted = _switched(header.settings, {key: asked[key] for key in (*SEMANTIC_SHAPE, *MORE_DEPTH) if asked.get(key)})
    if header.settings.name != name:
        return load(name, path, classes=classes)  # which refuses it
    fresh_semantics |= wanted.semantic != header.settings.semantic
    if not fresh_semantics and header.classes not in (None, classes) and not own_classes:
        raise other_table(path, classes, header.classes, "name the table to train on with --classes FILE")
    fresh_classes = header.classes != classes
    if fresh_semantics or fresh_classes or wanted != header.settings:
        return _lent(path, wanted, classes, seed, fresh_classes, fresh_semantics)
    model = load(name, path, classes=classes)
    model.origin = f"{path.name}: all {len(model.state_dict())} tensors kept"
    return model


def _switched(settings: NetworkSettings, changes: Mapping[str, Any]) -> NetworkSettings:
    """`switched`, where what does not fit together is the user's.

    Raises:
        InputError: it does not; the switch is named.
    """
    try:
        return switched(settings, changes)
    except ValueError as error:
        raise InputError("--network", "switches that fit together", "some that do not", advice=f"{error}") from None


def _lent(
    path: Path, settings: NetworkSettings, classes: ClassTable, seed: int, fresh_classes: bool, fresh_semantics: bool
) -> SemGS:
    """A network of these settings with all of a file's tensors that have a place in it; the others are drawn.

    Args:
        path: of the weights.
        settings: which may have another semantic branch than the weights, and more layers in depth.
        classes: the table.
        seed: of what is drawn.
        fresh_classes: draw the rows of the classes, as the weights have another table.
        fresh_semantics: draw the whole semantic branch.
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
    model.origin = f"{path.name}: {len(own) - len(fresh)} of {len(own)} tensors kept; {'; '.join(notes)}"
    return model

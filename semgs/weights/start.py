"""Where a training starts: a network drawn at random, or weights of which it keeps all that fits its classes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from semgs.data.classes import SCANNET20, ClassTable
from semgs.files.errors import InputError
from semgs.model.presets import NAMES, PRESETS
from semgs.model.semgs import SemGS
from semgs.model.settings import NetworkSettings
from semgs.model.switches import switched, switches_of
from semgs.weights.file import fill, is_ours, read_header, read_tensors
from semgs.weights.load import as_large_as, drawn, find, from_mvsplat, load, semantic_tensors, shipped
from semgs.weights.published import is_published, with_backbone

SEMANTIC_SHAPE = ("semantic_pyramid", "class_backbone")
"""Switches that shape the semantic branch alone: weights that have others lend a network all else."""


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
            the weights have, but for the shape of the semantic branch: where that differs the branch is drawn, and all else is kept.
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
        return drawn(switched(PRESETS[name](), asked), seed, classes).eval()
    if init in NAMES and shipped(init) is None:
        raise InputError(
            init, "random, a file of weights, or a name under which some ship", "a name under which none do"
        )
    _, path = find(init)
    if is_published(path):
        return with_backbone(drawn(switched(PRESETS[name](), {"class_backbone": True, **asked}), seed, classes), path)
    if not is_ours(path):
        if not asked or name == "small":
            return load(name, path, seed=seed, classes=classes)
        return from_mvsplat(drawn(switched(PRESETS[name](), asked), seed, classes), path, seed)
    header = read_header(path)
    there = switches_of(header.settings)
    for key, value in asked.items():
        if getattr(there, key) != value and key not in SEMANTIC_SHAPE:
            raise InputError(
                path, f"weights of a network with {key} = {value}", f"{getattr(there, key)}", key="settings"
            )
    wanted = switched(header.settings, {key: asked[key] for key in SEMANTIC_SHAPE if asked.get(key)})
    if (fresh_semantics or wanted != header.settings) and header.settings.name == name:
        return _with_another_branch(path, wanted, classes, seed)
    if header.classes not in (None, classes) and not own_classes:
        raise InputError(
            path, f"class table {classes.name} ({len(classes)} classes)", f"{header.classes.name} ({len(header.classes)} classes)",
            key="classes", advice="name the table to train on with --classes FILE",
        )  # fmt: skip
    if header.classes == classes or header.settings.name != name:
        model = load(name, path, classes=classes)
        model.origin = f"{path.name}: all {len(model.state_dict())} tensors kept"
        return model
    return _with_other_classes(path, header.settings, classes, seed)


def _with_another_branch(path: Path, settings: NetworkSettings, classes: ClassTable, seed: int) -> SemGS:
    """The network of a file but for the semantic branch, which these settings shape."""
    with as_large_as(path):
        model = drawn(settings, seed, classes)
    own, theirs = model.state_dict(), read_tensors(path)
    fresh = {name: own[name] for name in own if name in semantic_tensors(model)}
    kept = {name: tensor for name, tensor in theirs.items() if not name.startswith("semantic.")}
    fill(model, kept | fresh, path)
    model.origin = (
        f"{path.name}: {len(kept)} of {len(own)} tensors kept; the semantic branch drawn anew with seed {seed}"
    )
    return model


def _with_other_classes(path: Path, settings: NetworkSettings, classes: ClassTable, seed: int) -> SemGS:
    """The network of a file for another table: everything but the rows of the classes."""
    with as_large_as(path):
        model = drawn(settings, seed, classes)
    own, theirs = model.state_dict(), read_tensors(path)
    predict = model.parts()["classes"]
    fresh = [name for name in own if name in predict]
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

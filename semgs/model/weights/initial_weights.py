"""The network that a training starts with: random, or from weights as far as they fit.

The class branch can start from published weights: safetensors with the names of MobileNetV2's tensors, or of MOSAIC's. A MobileNetV2 may come with a head (an ImageNet classifier, a segmentation
head). Heads are left out, because their classes are not ours. MOSAIC is taken as it is, with its own classes, which a layer of ours translates.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

from torch import Tensor

from semgs.data.tables.classes import SCANNET20, ClassTable
from semgs.files.errors import InputError
from semgs.files.tensor_files import open_tensors
from semgs.model.classes.mobilenet import MobileNetRefinement, MobileNetV2
from semgs.model.classes.mosaic import OWN_LAYERS, Mosaic
from semgs.model.networks import NAMES, NETWORKS, named_switches
from semgs.model.semgs import SemGS
from semgs.model.settings import NetworkSettings
from semgs.model.switches import Switches, switched, switches_of
from semgs.model.weights.header import Header
from semgs.model.weights.load import (
    find,
    from_mvsplat,
    load,
    other_table,
    shipped,
    untrained,
)
from semgs.model.weights.pretrained import as_large_as
from semgs.model.weights.weights_file import fill, is_ours, read_header, read_tensors

SEMANTIC_SHAPE = ("class_backbone",)
"""Switches that only shape the semantic branch: from weights with other values, everything else is kept."""

FRESH_SHAPE = ("shared_layers", "windows_semantic", "camera_aware_semantic", "semantic_transformer")
"""The other switches of the semantic branch: weights with other values fit if the branch is drawn anew."""

MORE_DEPTH = ("cost_filter", "depth_cue", "depth_upsampling")
"""Switches that add layers to depth: from weights without these layers, everything else is kept."""

BESIDE = ("class_mosaic", "class_fusion")
"""A network beside the semantic branch, and a switch that no layer depends on: with other values, everything else is kept."""

ADDED = {
    "the layers added to depth": ("colour.depth.filter.", "colour.depth.regressor.cues.", "colour.heads.convex."),
    "MOSAIC": ("semantic.mosaic.",),
}
"""Parts that weights may lack, with the beginnings of their tensor names."""


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
    if init in NAMES and shipped(init) is None:
        raise InputError(
            init, "random, a weights file, or the name of included weights", "a name without included weights"
        )
    path = None if init == "random" else find(init)[1]
    model: SemGS
    if path is None:
        model = untrained(_switched(NETWORKS[name](), requested), seed, classes).eval()
    elif is_published(path):
        added = {"class_mosaic" if is_mosaic(path) else "class_backbone": True}
        model = with_backbone(untrained(_switched(NETWORKS[name](), added | requested), seed, classes), path)
    elif is_ours(path):
        model = _from_weights(name, path, requested, seed, classes, own_classes, fresh_semantics)
    elif not requested or name.startswith("small"):
        model = load(name, path, seed=seed, classes=classes)
    else:
        model = from_mvsplat(untrained(_switched(NETWORKS[name](), requested), seed, classes), path, seed)
    return with_backbone(model, backbone) if backbone else model


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
    settings, fresh_semantics = network_for(header, requested, fresh_semantics)
    if header.settings.name != name:
        return load(name, path, classes=classes)  # raises an InputError
    if not fresh_semantics and header.classes not in (None, classes) and not own_classes:
        raise other_table(path, classes, header.classes, "name the table to train on with --classes FILE")
    if not fresh_semantics and (header.settings, header.classes) == (settings, classes):
        model = load(name, path, classes=classes)
        model.origin = f"{path.name}: all {len(model.state_dict())} tensors kept"
        return model
    with as_large_as(path):
        model = untrained(settings, seed, classes)
    others: Literal["classes"] | None = None if header.classes == classes else "classes"
    fill_fitting(model, path, classes, seed, "branch" if fresh_semantics else others)
    return model


def network_for(header: Header, requested: Mapping[str, Any], fresh_semantics: bool) -> tuple[NetworkSettings, bool]:
    """The network that starts from weights, and whether its semantic branch is drawn anew.

    Args:
        header: of the weights.
        requested: switches of the network; the others are those of the weights.
        fresh_semantics: draw the semantic branch anew in any case.

    Raises:
        InputError: the weights have another switch, and its layers can be neither added nor exchanged; or the switches contradict each other.
    """
    own_branch = (*SEMANTIC_SHAPE, *FRESH_SHAPE) if fresh_semantics else SEMANTIC_SHAPE
    present = switches_of(header.settings)
    for key, value in requested.items():
        there = getattr(present, key)
        added = key in MORE_DEPTH and there == getattr(Switches, key)
        if there != value and not added and key not in (*own_branch, *BESIDE):
            raise InputError(header.path, f"weights of a network with {key} = {value}", f"{there}", key="settings")
    settings = _switched(header.settings, requested)
    kept = {key: value for key, value in requested.items() if key in BESIDE}
    return settings, fresh_semantics or settings.semantic != _switched(header.settings, kept).semantic


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


def fill_fitting(
    model: SemGS, path: Path, classes: ClassTable, seed: int, fresh: Literal["branch", "classes"] | None
) -> None:
    """Fill a random network with all tensors of a file that fit; the others stay random. Its `origin` says which.

    Args:
        model: the network; it may have another semantic branch than the weights, and more layers in depth.
        path: of the weights.
        classes: the class table.
        seed: that the network was drawn with, for its `origin`.
        fresh: "branch" keeps nothing of the semantic branch, "classes" no row of a class; None keeps both.

    Raises:
        InputError: the file cannot be read or does not fit; the tensor is named.
    """
    random = model.state_dict()
    later = tuple(start for starts in ADDED.values() for start in starts)
    saved = {
        name: tensor for name, tensor in read_tensors(path).items() if name in random or not name.startswith(later)
    }
    drawn = {name: tensor for name, tensor in random.items() if name.startswith(later) and name not in saved}
    notes = [
        f"{part} drawn with seed {seed}"
        for part, starts in ADDED.items()
        if any(name.startswith(starts) for name in drawn)
    ]
    if fresh == "branch":
        saved = {name: tensor for name, tensor in saved.items() if not name.startswith("semantic.")}
        drawn |= {name: tensor for name, tensor in random.items() if name.startswith("semantic.")}
        notes.append(f"the semantic branch drawn anew with seed {seed}")
    elif fresh == "classes":
        class_layers = model.parts()["classes"]
        names = [name for name in random if name in class_layers]
        drawn |= {name: _keep_rows(random[name], saved.get(name), len(classes)) for name in names}
        notes.append(
            f"drawn anew for the {len(classes)} classes of {classes.name} with seed {seed}: {', '.join(names)}"
        )
    fill(model, saved | drawn, path, model.name)
    kept = f"{path.name}: {len(random) - len(drawn)} of {len(random)} tensors kept"
    model.origin = "; ".join([kept, *notes])


def _keep_rows(random: Tensor, saved: Tensor | None, classes: int) -> Tensor:
    """Random rows for the classes, which come last, below the rows of saved weights."""
    rows, shared = random.clone(), len(random) - classes
    if saved is not None and saved.shape[1:] == rows.shape[1:] and len(saved) >= shared:
        rows[:shared] = saved[:shared]
    return rows


BACKBONE = ("stem.", "blocks.")
"""Beginnings of the names of the backbone's tensors; other tensors belong to a head."""

CONTEXT = "pyramid."
"""Beginning of names that only MOSAIC has."""


def is_published(path: str | Path) -> bool:
    """Whether a file is safetensors with a stem and blocks of these names; shapes are not checked."""
    names = _names(path)
    return all(any(name.startswith(start) for name in names) for start in BACKBONE)


def is_mosaic(path: str | Path) -> bool:
    """Whether a file is safetensors with the names of MOSAIC's tensors; shapes are not checked."""
    return is_published(path) and any(name.startswith(CONTEXT) for name in _names(path))


def _names(path: str | Path) -> list[str]:
    """Names of the tensors in a file; none if it is no safetensors."""
    try:
        with open_tensors(path, "a safetensors file") as file:
            return list(file.keys())
    except InputError:
        return []


def with_backbone(model: SemGS, path: str | Path) -> SemGS:
    """The network with its class backbone, or its MOSAIC, filled from a published file; its `origin` says so.

    Raises:
        InputError: the network has no such part, or the file does not fit.
    """
    if is_mosaic(path):
        mosaic = None if model.semantic is None else model.semantic.mosaic
        if mosaic is None:
            raise InputError(path, "a network with MOSAIC", "one without", advice="give --network.class-mosaic")
        model.origin = f"{model.origin}; {fill_mosaic(mosaic, path)}"
        return model
    refinement = None if model.semantic is None else model.semantic.refinement
    if not isinstance(refinement, MobileNetRefinement):
        advice = "give --network.class-backbone"
        raise InputError(path, "a network with a MobileNetV2 class backbone", "one without", advice=advice)
    model.origin = f"{model.origin}; {fill_backbone(refinement.backbone, path)}"
    return model


def fill_mosaic(mosaic: Mosaic, path: str | Path) -> str:
    """Fill MOSAIC with the tensors of a published file; on an error it is unchanged. The layers for our own classes stay as they are.

    Args:
        mosaic: takes all of its other tensors from the file.
        path: the file.

    Returns:
        A sentence for `origin`.

    Raises:
        InputError: the file cannot be read, or a tensor is missing, unknown, of another shape or not finite; it is named.
    """
    tensors = read_tensors(path)
    own = {name: tensor for name, tensor in mosaic.state_dict().items() if name.startswith(OWN_LAYERS)}
    fill(mosaic, tensors | own, path, "MOSAIC")
    return f"{Path(path).name}: {len(tensors)} tensors taken for MOSAIC"


def fill_backbone(backbone: MobileNetV2, path: str | Path) -> str:
    """Fill a backbone with the tensors of a published file; on an error the backbone is unchanged.

    Args:
        backbone: takes all of its tensors from the file.
        path: the file.

    Returns:
        A sentence for `origin`: what was used and what was left out.

    Raises:
        InputError: the file cannot be read, or a tensor of the backbone is missing, unknown, of another shape or not finite; it is named.
    """
    tensors = read_tensors(path)
    own = {name: tensor for name, tensor in tensors.items() if name.startswith(BACKBONE)}
    fill(backbone, own, path, "MobileNetV2 1.0")
    heads = ", ".join(sorted({name.partition(".")[0] for name in tensors.keys() - own.keys()}))
    taken = f"{Path(path).name}: {len(own)} of {len(tensors)} tensors taken for the backbone"
    return f"{taken}; left out: {heads}" if heads else taken

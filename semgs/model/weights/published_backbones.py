"""Published weights to start the class branch from: safetensors with the names of MobileNetV2's tensors, or of MOSAIC's.

A MobileNetV2 may come with a head (an ImageNet classifier, a segmentation head). Heads are left out, because their classes are not ours. MOSAIC is
taken as it is, with its own classes, which a layer of ours translates.
"""

from __future__ import annotations

from pathlib import Path

from semgs.files.errors import InputError
from semgs.files.tensor_files import open_tensors
from semgs.model.classes.mobilenet import MobileNetRefinement, MobileNetV2
from semgs.model.classes.mosaic import OWN_LAYERS, Mosaic
from semgs.model.semgs import SemGS
from semgs.model.weights.weights_file import fill, read_tensors

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

"""Published MobileNetV2 weights to start the class branch from: safetensors with the backbone's own tensor names.

A file may also contain a head (an ImageNet classifier, a segmentation head). Heads are left out, because their classes are not ours.
"""

from __future__ import annotations

from pathlib import Path

from semgs.files.errors import InputError
from semgs.files.tensor_files import open_tensors
from semgs.model.classes.mobilenet import MobileNetRefinement, MobileNetV2
from semgs.model.semgs import SemGS
from semgs.model.weights.weights_file import fill, read_tensors

BACKBONE = ("stem.", "blocks.")
"""Beginnings of the names of the backbone's tensors; other tensors belong to a head."""


def is_published(path: str | Path) -> bool:
    """Whether a file is safetensors with a stem and blocks of these names; shapes are not checked."""
    try:
        with open_tensors(path, "a safetensors file") as file:
            names = list(file.keys())
    except InputError:
        return False
    return all(any(name.startswith(start) for name in names) for start in BACKBONE)


def with_backbone(model: SemGS, path: str | Path) -> SemGS:
    """The network with its class backbone filled from a published file; its `origin` says so.

    Raises:
        InputError: the network has no backbone, or the file does not fit.
    """
    refinement = None if model.semantic is None else model.semantic.refinement
    if not isinstance(refinement, MobileNetRefinement):
        advice = "give --network.class-backbone"
        raise InputError(path, "a network with a MobileNetV2 class backbone", "one without", advice=advice)
    model.origin = f"{model.origin}; {fill_backbone(refinement.backbone, path)}"
    return model


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

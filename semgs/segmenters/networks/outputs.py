"""Which output of a network in a file is used: the only one, or the one that its description names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from semgs.files.errors import InputError
from semgs.files.text import listed


def several_outputs(path: Path, outputs: Mapping[str, Sequence[int | None]], classes: int | None = None) -> InputError:
    """The error for a network with several outputs, or none, if its description names none of them.

    Args:
        path: the network.
        outputs: their names and shapes, None along an axis that may have any length.
        classes: how many numbers the output must have for each pixel; None if the shape cannot show whether one is meant.
    """
    advice = 'name one in the JSON: "tensor"'
    if classes is not None and outputs and not any(_may_have(shape, classes) for shape in outputs.values()):
        found = listed([f"{name} {list(shape)}" for name, shape in outputs.items()])
        advice = (
            f"none of them has a number for each of the {classes} classes and each pixel, as networks for boxes or instances (YOLO-seg): use a network for semantic "
            "segmentation"
        )
        return InputError(path, "one output", found, advice=advice)
    return InputError(path, "one output", listed(list(outputs)) or "none", advice=advice)


def _may_have(shape: Sequence[int | None], classes: int) -> bool:
    """Whether an output of a shape may have so many numbers for each pixel."""
    return not shape or (len(shape) == 4 and any(side in (None, classes) for side in (shape[1], shape[3])))

"""Take the class weights of a training back out of the weights that it left.

    python scripts/undo_class_weights.py WEIGHTS.safetensors RUN OUT.safetensors

A loss that counts rare classes w times as much teaches a network to find them w times as likely as they are. RUN is the folder of the training
with --class-weights; WEIGHTS are what it left, or a mean with others that learned by the same rule. OUT has the logarithm of each class's weight
subtracted from its logit (Menon et al., Long-tail learning via logit adjustment, ICLR 2021), and is the same otherwise. Temperatures and scores
are left out, so calibrate the result afterwards (`semgs weights calibrate`), and evaluate it again.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
import torch

from semgs.files.errors import InputError
from semgs.model.weights.header import OWN_KEYS, SCORES, TEMPERATURES
from semgs.model.weights.load import load
from semgs.model.weights.weights_file import read_header, save
from semgs.training.data.data_check.data_check import check_data
from semgs.training.run.run_folder import read_settings


def undo(weights: Path, run: Path, out: Path) -> tuple[float, ...]:
    """Write weights without the class weights of a training.

    Args:
        weights: the file to start from.
        run: the training's folder; what it learned from is still where it was.
        out: the file to write, in bfloat16.

    Returns:
        The class weights.

    Raises:
        InputError: a file cannot be read, the training weighted no class or one with 0, or it had other classes.
    """
    settings = read_settings(run)
    data = check_data(settings, settings, settings.init, run)
    if data.class_weights is None:
        raise InputError(run, "a training with --class-weights", "one without")
    if not all(data.class_weights):
        raise InputError(run, "class weights above 0", "a class with weight 0, which was not learned at all")
    header = read_header(weights)
    if header.classes != data.classes:
        found = "none" if header.classes is None else f"the table {header.classes.name}"
        raise InputError(weights, f"the classes of {run.name}", found)
    model = load(weights)
    assert model.semantic is not None
    if model.semantic.mosaic is not None:
        raise InputError(
            weights, "weights without MOSAIC, whose classes are not the mean of two networks", "some with it"
        )
    *_, last = model.semantic.class_layers()
    bias = last.bias
    assert isinstance(bias, torch.Tensor)
    shift = -np.log(np.array(data.class_weights))
    with torch.no_grad():
        bias[-len(shift) :] += torch.from_numpy(shift - shift.mean()).to(bias)
    described = f"{header.metadata.get('description', weights.name)}; without the class weights of {run.name}"
    kept = {key: value for key, value in header.metadata.items() if key not in OWN_KEYS | {TEMPERATURES, SCORES}}
    save(out, model, kept | {"description": described})
    return data.class_weights


def main() -> int:
    """Write the weights and print what was undone, or say in one line why not."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", type=Path, metavar="WEIGHTS.safetensors")
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("out", type=Path, metavar="OUT.safetensors")
    given = parser.parse_args()
    try:
        found = undo(given.weights, given.run, given.out)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"class weights {min(found):.2f} to {max(found):.2f} undone: {given.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Average the weights of several trainings of one network, or add up what they learned.

    python scripts/average_weights.py OUT.safetensors FILE FILE [FILE ...]                  the mean
    python scripts/average_weights.py --start START OUT.safetensors FILE FILE [FILE ...]    START, and what each FILE changed in it

Each FILE counts alike; name one twice to count it twice. They must have the same settings and classes, and should have begun from the same
weights: the mean of networks that were trained apart knows nothing. Changes can be added if the trainings changed different parts, such as
classes and depth, which can then learn at the same time. The header joins their data, seeds, names of scenes and terms. Temperatures are left
out, so calibrate the result afterwards (`semgs weights calibrate`).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor

from semgs.data.origin.terms import terms_text
from semgs.files.errors import InputError
from semgs.model.build import build
from semgs.model.weights.header import DATA_TERMS, SCENES
from semgs.model.weights.load import data_terms, trained_scenes
from semgs.model.weights.weights_file import fill, read_header, read_tensors, save


def average(files: Sequence[Path], out: Path, start: Path | None = None) -> None:
    """Write the mean of weights, or the sum of their changes.

    Args:
        files: weights of one network.
        out: the file to write, in bfloat16.
        start: weights that all files began from: the result is their sum with the differences from them. None for the mean.

    Raises:
        InputError: a file cannot be read, or is of another network or other classes than the first.
    """
    begun = () if start is None else (start,)
    headers = [read_header(path) for path in files]
    for path, header in zip((*files, *begun), (*headers, *map(read_header, begun)), strict=True):
        if (header.settings, header.classes) != (headers[0].settings, headers[0].classes):
            raise InputError(path, f"weights of the network and classes of {files[0].name}", "others")
    tensors = [read_tensors(path) for path in files]
    base = None if start is None else read_tensors(start)
    result = {
        name: _one([each[name].double() for each in tensors], None if base is None else base[name].double())
        if first.is_floating_point()
        else first
        for name, first in tensors[0].items()
    }
    model = build(headers[0].settings, headers[0].classes)
    fill(model, result, out, model.name)
    names = ", ".join(path.name for path in files)
    scenes = sorted({name for path in files for name in trained_scenes(path)})
    terms = dict.fromkeys(one for path in files for one in data_terms(path))
    save(
        out,
        model,
        {
            **({SCENES: json.dumps(scenes)} if scenes else {}),
            DATA_TERMS: terms_text(terms),
            **{
                key: ", ".join(dict.fromkeys(one.metadata.get(key, "unknown") for one in headers))
                for key in ("data", "seed")
            },
            "description": f"the mean of {names}" if start is None else f"{start.name} with the changes of {names}",
        },
    )


def _one(tensors: Sequence[Tensor], start: Tensor | None) -> Tensor:
    """The mean of tensors, or a tensor with their differences from it."""
    stacked = torch.stack(list(tensors))
    return stacked.mean(0) if start is None else start + (stacked - start).sum(0)


def main() -> int:
    """Average or add, or say in one line why not."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="OUT.safetensors")
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    parser.add_argument("--start", type=Path, metavar="START", help="weights that all files began from")
    given = parser.parse_args()
    try:
        average(given.files, given.out, given.start)
    except InputError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())

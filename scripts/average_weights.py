"""Average the weights of several trainings of one network, tensor by tensor.

    python scripts/average_weights.py OUT.safetensors FILE FILE [FILE ...]

Each FILE counts alike; name one twice to count it twice. They must have the same settings and classes, and should have begun from the same
weights: the mean of networks that were trained apart knows nothing. The header joins their data, seeds, names of scenes and terms.
Temperatures are left out, so calibrate the mean afterwards (`semgs weights calibrate`).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

import torch

from semgs.data.terms import terms_text
from semgs.files.errors import InputError
from semgs.model.build import build
from semgs.weights.file import fill, read_header, read_tensors, save
from semgs.weights.load import DATA_TERMS, SCENES, data_terms, trained_scenes


def average(files: Sequence[Path], out: Path) -> None:
    """Write the mean of weights.

    Args:
        files: weights of one network.
        out: the file to write, in bfloat16.

    Raises:
        InputError: a file cannot be read, or is of another network or other classes than the first.
    """
    headers = [read_header(path) for path in files]
    for path, header in zip(files, headers, strict=True):
        if (header.settings, header.classes) != (headers[0].settings, headers[0].classes):
            raise InputError(path, f"weights of the network and classes of {files[0].name}", "others")
    tensors = [read_tensors(path) for path in files]
    mean = {
        name: torch.stack([one[name].double() for one in tensors]).mean(0) if first.is_floating_point() else first
        for name, first in tensors[0].items()
    }
    model = build(headers[0].settings, headers[0].classes)
    fill(model, mean, out, model.name)
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
            "description": f"the mean of {', '.join(path.name for path in files)}",
        },
    )


def main() -> int:
    """Average, or say in one line why not."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="OUT.safetensors")
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    given = parser.parse_args()
    try:
        average(given.files, given.out)
    except InputError as error:
        print(error.first_line, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())

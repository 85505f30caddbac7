"""Train the backbone of the class branch on, in weights with MOSAIC (--start, by default the included ones).

    python scripts/train_class_backbone.py OUT.safetensors --photos DIR [DIR ...] --rooms DIR [DIR ...]

--photos are labelled images without cameras (docs/train.md), --rooms what `semgs train --data` takes. Name folders whose images the class branch never saw second and
later. The class branch learns
- in photos, from labels, and from a teacher: what START says of the photo in two looks;
- in rooms, only to keep what START's class branch says of the same crop.

The decoder and the classifier learn too, but only the backbone is written, and the rest is that of START. What the decoder learns spoils rooms and gains nothing in photos.
MOSAIC, depth and colour stay. Images are cropped and recoloured as in `train_mosaic.py`, rooms more strongly. The result is the exponential moving average; its mean with START
(`average_weights.py`) keeps more of what START knew.
"""

from __future__ import annotations

import argparse
import time
from copy import deepcopy
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import interpolate
from train_mosaic import Crops, Known, away_from, labelled_loss, learn, read_examples

from semgs.data.views import Views
from semgs.model.classes.mobilenet import MobileNetRefinement
from semgs.model.semgs import SemGS
from semgs.model.weights.initial_weights import initial_network
from semgs.model.weights.weights_file import save

CROPS = Crops((208, 272), (0.9, 1.7), 0.8, room_colour=0.8)
"""The class branch sees images as SemGS reads them, and in a second look 1.5 times as large."""

RATES = {"backbone": 1e-4, "decoder": 3e-4}
"""Peak learning rates."""

HELD = 6.0
"""Weight of what START says, in rooms."""


def in_two_looks(network: SemGS) -> Known:
    """What a network says of a photo in two looks.

    Args:
        network: the teacher; it keeps two looks.
    """
    network.looks = 2

    def known_of(small: Views, size: tuple[int, int]) -> Tensor:
        """The map, at a size."""
        taught = network.class_maps(small, alone=True).distributions.flatten(0, -4)
        return interpolate(taught, size, mode="area").clamp(min=1e-6)

    return known_of


def nothing(classes: int) -> Known:
    """No teacher, as for rooms: what START says of them depends on the crop.

    Args:
        classes: their number, which the maps of photos have.
    """
    return lambda _, size: torch.zeros(1, classes, *size)


def says(branch: MobileNetRefinement, images: Float[Tensor, "n 3 h w"]) -> Float[Tensor, "n class h4 w4"]:
    """The class logits of the branch for crops."""
    assert branch.classifier is not None
    logits: Tensor = branch.classifier(branch.decode(branch.backbone(images)))
    return logits


def main() -> None:
    """Read, train and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="OUT.safetensors")
    parser.add_argument("--photos", nargs="+", required=True, metavar="DIR")
    parser.add_argument("--rooms", nargs="+", required=True, metavar="DIR")
    parser.add_argument("--start", default="small")
    parser.add_argument("--steps", type=int, default=900)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    began = time.process_time()
    network = initial_network("small", given.start, switches={"class_mosaic": True})
    assert network.classes is not None
    names = network.classes.names
    examples = [
        example
        for position, folder in enumerate(given.photos)
        for example in read_examples(folder, names, in_two_looks(network), photo=True, new=position > 0)
    ]
    for folder in given.rooms:
        examples += read_examples(folder, names, nothing(len(names)), photo=False, new=True)
    print(f"{len(examples)} images, {time.process_time() - began:.0f} core-seconds", flush=True)
    assert network.semantic is not None
    branch = network.semantic.refinement
    assert isinstance(branch, MobileNetRefinement)
    start = deepcopy(branch.eval())
    branch.requires_grad_()

    def loss_of(images: Tensor, labels: Tensor, known: Tensor, photos: Tensor, _: Tensor) -> Tensor:
        """The loss of a batch of photos, then rooms."""
        count = int(photos.sum())
        logits = says(branch, images)
        with torch.no_grad():
            kept = says(start, images[count:]).softmax(1)
        learned = labelled_loss(logits[:count], labels[:count]) + away_from(known[:count], logits[:count])
        return torch.cat((learned, HELD * away_from(kept, logits[count:]))).mean()

    parts: dict[str, list] = {name: [] for name in RATES}
    for name, parameter in branch.named_parameters():
        parts["backbone" if name.startswith("backbone.") else "decoder"].append(parameter)
    groups = [{"params": found, "peak": RATES[name], "lr": 0.0, "weight_decay": 1e-4} for name, found in parts.items()]
    average = learn(branch, groups, loss_of, examples, given.steps, given.seed, CROPS, 0.995).state_dict()
    before = start.state_dict()
    branch.load_state_dict({name: (average if name.startswith("backbone.") else before)[name] for name in before})
    words = f"{given.start}, its class backbone trained on for {given.steps} steps"
    save(given.out, network, {"description": words, "seed": f"{given.seed}"})


if __name__ == "__main__":
    main()

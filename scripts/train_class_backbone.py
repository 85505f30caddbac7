"""Train the backbone of the class branch on, in weights with MOSAIC (--start, by default the included ones).

    python scripts/train_class_backbone.py OUT.safetensors --photos DIR [DIR ...] --rooms DIR [DIR ...]

--photos are labelled images without cameras (docs/train.md), --rooms what `semgs train --data` takes. Name folders whose images the class branch never saw second and
later. The class branch learns from
- labels;
- a teacher: what the weights say before the training, of photos with two looks, of rooms with one.

The decoder and the classifier learn too, but only the backbone is written, and the rest is that of START. What the decoder learns is how the rooms of --rooms look: kept, it
spoils other rooms and gains nothing in photos. MOSAIC, depth and colour stay. Images are cropped and recoloured as in `train_mosaic.py`. The result is the exponential moving
average; its mean with START (`average_weights.py`) keeps more of what START knew.
"""

from __future__ import annotations

import argparse
import time
from copy import deepcopy
from pathlib import Path
from typing import Literal

from torch import Tensor
from torch.nn.functional import interpolate
from train_mosaic import Crops, Known, away_from, labelled_loss, learn, read_examples

from semgs.data.views import Views
from semgs.model.semgs import SemGS
from semgs.model.weights.initial_weights import initial_network
from semgs.model.weights.weights_file import save

CROPS = Crops((208, 272), (0.9, 1.7), 0.8)
"""The class branch sees images as SemGS reads them, and in a second look 1.5 times as large."""

RATES = {"backbone": 1e-4, "decoder": 3e-4}
"""Peak learning rates."""


def known_by(network: SemGS, looks: Literal[1, 2]) -> Known:
    """What a network says of an image.

    Args:
        network: the teacher.
        looks: how often it looks.
    """

    def known_of(small: Views, size: tuple[int, int]) -> Tensor:
        """The map, at a size."""
        network.looks = looks
        taught = network.class_maps(small, alone=True).distributions.flatten(0, -4)
        return interpolate(taught, size, mode="area").clamp(min=1e-6)

    return known_of


def main() -> None:
    """Read, train and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, metavar="OUT.safetensors")
    parser.add_argument("--photos", nargs="+", required=True, metavar="DIR")
    parser.add_argument("--rooms", nargs="+", required=True, metavar="DIR")
    parser.add_argument("--start", default="small")
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument(
        "--photos-of-eight", type=int, choices=(2, 4), default=4, help="images of a step that are photos"
    )
    parser.add_argument(
        "--room-teacher", type=float, default=3.0, help="weight of the teacher in rooms; in photos it is 1"
    )
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    began = time.process_time()
    network = initial_network("small", given.start, switches={"class_mosaic": True})
    assert network.classes is not None
    examples = [
        example
        for kind, folders in (("photos", given.photos), ("rooms", given.rooms))
        for position, folder in enumerate(folders)
        for example in read_examples(
            folder,
            network.classes.names,
            known_by(network, 2 if kind == "photos" else 1),
            kind == "photos",
            kind == "rooms" or position > 0,
        )
    ]
    print(f"{len(examples)} images, {time.process_time() - began:.0f} core-seconds", flush=True)
    assert network.semantic is not None
    branch = network.semantic.refinement
    assert branch is not None
    branch.eval().requires_grad_()

    def loss_of(images: Tensor, labels: Tensor, known: Tensor, photos: Tensor, _: Tensor) -> Tensor:
        """The loss of a batch, as in `train_mosaic.py`."""
        logits = branch.classifier(branch.decode(branch.backbone(images)))
        weight = photos + given.room_teacher * (1 - photos)
        return (labelled_loss(logits, labels) + weight * away_from(known, logits)).mean()

    parts: dict[str, list] = {name: [] for name in RATES}
    for name, parameter in branch.named_parameters():
        parts["backbone" if name.startswith("backbone.") else "decoder"].append(parameter)
    groups = [{"params": found, "peak": RATES[name], "lr": 0.0, "weight_decay": 1e-4} for name, found in parts.items()]
    before = deepcopy(branch.state_dict())
    average = learn(
        branch, groups, loss_of, examples, given.steps, given.seed, CROPS, 0.995, given.photos_of_eight
    ).state_dict()
    branch.load_state_dict({name: (average if name.startswith("backbone.") else before)[name] for name in before})
    words = f"{given.start}, its class backbone trained on for {given.steps} steps"
    save(given.out, network, {"description": words, "seed": f"{given.seed}"})


if __name__ == "__main__":
    main()

"""Train MOSAIC on, beside the class branch of weights (--start, by default the included ones), and write weights with both.

    python scripts/train_mosaic.py MOSAIC.safetensors TABLE.npy OUT.safetensors --photos DIR [DIR ...] --rooms DIR [DIR ...]

MOSAIC.safetensors has the published weights, and TABLE [class of MOSAIC, class of SemGS] the share of each of its classes that is each of ours. --photos are labelled images
without cameras (docs/train.md), half of each batch; --rooms are what `semgs train --data` takes, the other half. Name folders whose images the class branch never saw
second and later; only there it learns from the mean of both networks, because elsewhere the class branch knows the answers by heart.

Every layer learns from
- labels, alone and in the mean of both networks;
- a teacher: what both networks say before the training. The class branch keeps the probability of the classes that MOSAIC never saw; the rest is divided by a geometric mean
  of both, .6 of MOSAIC in photos and .4 in rooms.
Images are cropped (rather where there is something that MOSAIC never saw), rolled, mirrored, recoloured and taken as by other cameras. Two of three photos are first reduced to the size at which SemGS reads them. The result is
the mean of the published weights and of an exponential moving average, with --trained of the latter: that keeps more of what MOSAIC knew. Depth, colour and the class branch do
not change.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, cross_entropy, grid_sample, interpolate, log_softmax

from semgs.data.resampling import default_size, resized
from semgs.data.scenes import open_scene, scene_paths
from semgs.data.views import Views
from semgs.model.classes.mosaic import GeometricMean, Mosaic
from semgs.model.semgs import SemGS
from semgs.model.weights.initial_weights import initial_network
from semgs.model.weights.weights_file import save
from semgs.training.data.augmentation import recolour
from semgs.training.data.photo_camera import photograph

ROLL = 8.0
"""Every second crop is rolled by up to this [degrees]."""

COLOUR, CAMERA = 0.4, 1.0
"""Strength of other colours and of other cameras, as for `semgs train --augmentation`."""

SHARES = {"photos": 0.6, "rooms": 0.4}
"""MOSAIC's share in the teacher."""

TEACHER = {"photos": 1.5, "rooms": 0.5}
"""Weight of the teacher in the loss."""

UNSEEN = ("counter", "desk", "refrigerator", "shower curtain", "toilet", "sink", "bathtub", "otherfurniture")
"""Classes that MOSAIC's published weights never saw."""

STILL_UNKNOWN = ("shower curtain", "toilet", "sink", "bathtub", "otherfurniture")
"""Classes that it knows too little after the training; the class branch alone decides how likely they are."""

RATES = {"published": 1.5e-4, "backbone": 6e-5, "own": 1e-3, "translation": 1.5e-3}
"""Peak learning rates."""

CLASS_WEIGHTS = torch.tensor(
    [
        0.7277, 0.8748, 0.8149, 1.1989, 1.4355, 1.4385, 1.5158, 1.2359, 1.39, 1.382,
        1.7476, 1.2159, 1.3499, 1.2089, 1.1479, 1.5229, 1.993, 1.7844, 1.553, 1.5416,
    ]
)  # fmt: skip
"""Weights of the classes in the cross-entropy, the inverse fourth roots of their frequencies. Their logarithms are added to the logits there, so that the network does not
find rare classes likelier than they are."""

WARMUP = 0.04
"""Share of the steps in which the learning rates rise."""

OFTEN = 0.02
"""Images of rooms with a larger share of classes that MOSAIC never saw come twice. And of two places for a crop, the one that shows more of them is taken."""

LABELLED = 2000
"""Labelled pixels, at half the size, from which on an image counts fully."""


@dataclass(frozen=True)
class Crops:
    """What crops are like.

    Attributes:
        size: height and width [px].
        scales: pixels of a crop per pixel of the image as SemGS reads it.
        reduced: share of photos that are reduced to the size at which SemGS reads them before they are cropped; the others are sharper.
        room_colour: `COLOUR` in rooms.
    """

    size: tuple[int, int]
    scales: tuple[float, float]
    reduced: float
    room_colour: float = COLOUR


CROPS = Crops((288, 352), (1.1, 2.6), 0.65)
"""MOSAIC is used at 1.6 pixels per pixel."""


@dataclass(frozen=True, eq=False)
class Example:
    """An image to learn from.

    Attributes:
        photo: whether it is one.
        new: whether the class branch has not seen it.
        full, small: the image at its own size, and as SemGS reads it.
        labels: at its own size, 255 = ignore.
        unseen: which labels are of classes that MOSAIC never saw.
        known: probabilities of the teacher, then log-probabilities of the class branch.
    """

    photo: bool
    new: bool
    full: UInt8[Tensor, "1 3 h w"]
    small: UInt8[Tensor, "1 3 h2 w2"]
    labels: UInt8[Tensor, "h w"]
    unseen: Bool[Tensor, "h w"]
    known: Float[Tensor, "1 channel h4 w4"]


Known = Callable[[Views, tuple[int, int]], Tensor]
"""What is known of a view at a height and width [1 channel h w]."""


@torch.no_grad()
def read_examples(folder: str, names: Sequence[str], known_of: Known, photo: bool, new: bool) -> Iterator[Example]:
    """The labelled images of a folder, with what is known of them before the training.

    Args:
        folder: of labelled images or scenes.
        names: of the classes.
        known_of: what is known of an image as SemGS reads it, at a quarter of its size.
        photo, new: as for `Example`.
    """
    rare = torch.tensor([number for number, name in enumerate(names) if name in UNSEEN])
    for path in scene_paths(folder):
        scene = open_scene(path.absolute(), needs_cameras=False)
        for index, frame in enumerate(scene.frames):
            full = scene.read([index], "native")
            if full.labels is None or not (full.labels < len(names)).any():
                continue
            small = resized(full, default_size(frame.lens.size))
            known = known_of(small, (small.size[0] // 4, small.size[1] // 4)).half()
            labels = full.labels[0]
            yield Example(photo, new, stored(full), stored(small), labels, torch.isin(labels, rare), known)


def known_by_both(network: SemGS, mosaic: Mosaic, photo: bool) -> Known:
    """What both networks say of an image, and then what the class branch says of it.

    Args:
        network: the weights that MOSAIC joins.
        mosaic: with its published weights.
        photo: whether the images are photos.
    """
    assert network.classes is not None
    own = torch.tensor([name not in UNSEEN for name in network.classes.names])
    teacher = GeometricMean(len(own), SHARES["photos" if photo else "rooms"])
    teacher.get_buffer("known").copy_(own)

    def known_of(small: Views, size: tuple[int, int]) -> Tensor:
        """The maps, at a size."""
        maps = []
        for mirrored in (False, True) if photo else (False,):
            views = small.map(lambda array: array.flip(-1)) if mirrored else small
            both = (network.class_maps(views, alone=True).distributions, mosaic(views.images).softmax(1))
            found = torch.cat([interpolate(one, size, mode="area") for one in both])
            maps.append(found.flip(-1) if mirrored else found)
        first, second = torch.stack(maps).mean(0).clamp(min=1e-6).split(1)
        plain = network.class_maps(small, alone=True).distributions
        known = interpolate(plain, size, mode="area").clamp(min=1e-6).log()
        return torch.cat((teacher(first.log(), second.log()).exp(), known), 1)

    return known_of


def stored(views: Views) -> UInt8[Tensor, "1 3 h w"]:
    """The images in 8 bits."""
    return (255 * views.images).round().byte()


def crop(example: Example, rng: np.random.Generator, crops: Crops = CROPS) -> tuple[Tensor, Tensor, Tensor]:
    """A random crop: its image [1 3 h w], labels at half the size [1 h2 w2], and what is known of it at a quarter [1 channel h4 w4]."""
    size = crops.size
    height, width = example.small.shape[-2:]
    scale = max(float(np.exp(rng.uniform(*np.log(crops.scales)))), 1.0001 * size[0] / height, 1.0001 * size[1] / width)
    angle = np.radians(rng.uniform(-ROLL, ROLL)) * int(rng.integers(2))
    half = (size[0] / scale / 2, size[1] / scale / 2)
    places = [(rng.uniform(half[1], width - half[1]), rng.uniform(half[0], height - half[0])) for _ in range(2)]
    middle = max(places, key=lambda place: unseen_around(example, place, half))
    right = (torch.arange(size[1]) + 0.5 - size[1] / 2) / scale * (1 - 2 * int(rng.integers(2)))
    down = ((torch.arange(size[0]) + 0.5 - size[0] / 2) / scale)[:, None]
    x = middle[0] + np.cos(angle) * right - np.sin(angle) * down
    y = middle[1] + np.sin(angle) * right + np.cos(angle) * down
    grid = torch.stack((2 * x / width - 1, 2 * y / height - 1), -1)[None].float()
    source = example.small if not example.photo or rng.uniform() < crops.reduced else example.full
    image = grid_sample(source / 255, grid, padding_mode="reflection", align_corners=False)
    unknown = 255 - example.labels[None, None].float()  # so that what is outside is ignored
    labels = 255 - grid_sample(unknown, grid[:, ::2, ::2], "nearest", align_corners=False)[:, 0].long()
    quarter = avg_pool2d(grid.permute(0, 3, 1, 2), 4).permute(0, 2, 3, 1)
    known = grid_sample(example.known.float(), quarter, padding_mode="border", align_corners=False)
    views = Views.trusted(images=image.clamp(0, 1), cameras=None, depth_range=None)
    colour = COLOUR if example.photo else crops.room_colour
    return photograph(recolour(views, colour, rng), CAMERA, rng).images, labels, known


def unseen_around(example: Example, middle: tuple[float, float], half: tuple[float, float]) -> int:
    """Labelled pixels of classes that MOSAIC never saw, in a window.

    Args:
        example: the image.
        middle: of the window, in pixels of the small image, from the left and from the top.
        half: half of its height and width, in the same pixels.
    """
    ratio = example.unseen.shape[0] / example.small.shape[-2]
    (left, top), (right, bottom) = (
        [int(ratio * (place + sign * side)) for place, side in zip(middle, half[::-1], strict=True)] for sign in (-1, 1)
    )
    return int(example.unseen[top : bottom + 1, left : right + 1].sum())


def labelled_loss(logits: Tensor, labels: Tensor) -> Tensor:
    """The cross-entropy of each image [n].

    Args:
        logits: at a quarter of the images [n class h4 w4].
        labels: of `crop` [n h2 w2].
    """
    wide = interpolate(logits, scale_factor=2, mode="bilinear", align_corners=False)
    wide = wide + CLASS_WEIGHTS.log()[:, None, None]
    each = cross_entropy(wide, labels, CLASS_WEIGHTS, ignore_index=255, reduction="none").sum((1, 2))
    return each / (labels < 255).sum((1, 2)).clamp(min=LABELLED)


def away_from(taught: Tensor, logits: Tensor) -> Tensor:
    """How far each image is from what a teacher says [n]: the Kullback-Leibler divergence.

    Args:
        taught, logits: probabilities and logits at a quarter of the images [n class h4 w4].
    """
    return (taught * (taught.clamp(min=1e-6).log() - log_softmax(logits, 1))).sum(1).mean((1, 2))


def loss_of(logits: Tensor, labels: Tensor, known: Tensor, photos: Tensor, new: Tensor) -> Tensor:
    """The loss of a batch.

    Args:
        logits: of MOSAIC, at a quarter of the images [n class h4 w4].
        labels, known: of `crop`, for n images.
        photos, new: 1 for photos, and for images that the class branch has not seen [n].
    """
    taught, first = known.chunk(2, 1)
    alone = labelled_loss(logits, labels) * (1 - new / 2)
    together = labelled_loss((logits + first) / 2, labels) * new
    weight = TEACHER["photos"] * photos + TEACHER["rooms"] * (1 - photos)
    return (alone + together + weight * away_from(taught, logits)).mean()


def parameter_groups(mosaic: Mosaic) -> list[dict]:
    """Groups of parameters, each with its peak learning rate."""
    groups: dict[str, list] = {name: [] for name in RATES}
    for name, parameter in mosaic.named_parameters():
        part = name.split(".")[0]
        kind = {"translation": "translation", "own": "own", "own_low": "own", "stem": "backbone", "blocks": "backbone"}
        groups[kind.get(part, "published")].append(parameter)
    return [
        {"params": found, "peak": RATES[name], "lr": 0.0, "weight_decay": 0.0 if name == "translation" else 1e-4}
        for name, found in groups.items()
    ]


def learn(
    network: nn.Module,
    groups: list[dict],
    loss_of_batch: Callable[[Tensor, Tensor, Tensor, Tensor, Tensor], Tensor],
    examples: Sequence[Example],
    steps: int,
    seed: int,
    crops: Crops = CROPS,
    longest: float = 0.998,
) -> nn.Module:
    """Train a network; returns the average of its weights.

    Args:
        network: for images at the size of crops.
        groups: of its parameters, each with its peak learning rate.
        loss_of_batch: of images, and of labels, known, photos and new as `loss_of` takes them.
        examples: photos and rooms.
        steps: of eight images, four of them photos, of these half new.
        seed: of the order and the crops.
        crops: what they are like.
        longest: decay of the moving average, at most.
    """
    pools = [[one for one in examples if one.photo and one.new is new] for new in (False, True)]
    rooms = [one for one in examples if not one.photo]
    pools = [pool for pool in pools if pool] + [rooms + [one for one in rooms if one.unseen.float().mean() > OFTEN]]
    counts = [4 // (len(pools) - 1)] * (len(pools) - 1) + [4]
    optimiser = torch.optim.AdamW(groups, betas=(0.9, 0.99))
    average = deepcopy(network)
    for step in range(steps):
        batch, examples_of_step = [], []
        for number, (pool, count) in enumerate(zip(pools, counts, strict=True)):
            for index in range(step * count, (step + 1) * count):
                order = np.random.default_rng((seed, number, index // len(pool))).permutation(len(pool))
                example = pool[order[index % len(pool)]]
                batch.append(crop(example, np.random.default_rng((seed, step, len(batch), 1)), crops))
                examples_of_step.append(example)
        images, labels, known = (torch.cat(parts) for parts in zip(*batch, strict=True))
        photos, new = (
            torch.tensor([float(getattr(one, name)) for one in examples_of_step]) for name in ("photo", "new")
        )
        done = step / steps
        rise = done / WARMUP if done < WARMUP else (1 + np.cos(np.pi * (done - WARMUP) / (1 - WARMUP))) / 2
        for group in optimiser.param_groups:
            group["lr"] = group["peak"] * rise
        loss = loss_of_batch(images, labels, known, photos, new)
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 2.0)
        optimiser.step()
        decay = min(longest, (1 + step) / (10 + step))
        with torch.no_grad():
            for mean, parameter in zip(average.parameters(), network.parameters(), strict=True):
                mean.lerp_(parameter, 1 - decay)
        if step % 50 == 49:
            print(f"step {step + 1}: loss {loss.item():.3f}", flush=True)
    return average


def main() -> None:
    """Read, train and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mosaic", type=Path, metavar="MOSAIC.safetensors")
    parser.add_argument("table", type=Path, metavar="TABLE.npy")
    parser.add_argument("out", type=Path, metavar="OUT.safetensors")
    parser.add_argument("--photos", nargs="+", required=True, metavar="DIR")
    parser.add_argument("--rooms", nargs="+", required=True, metavar="DIR")
    parser.add_argument("--start", default="small")
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--trained", type=float, default=0.6)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    began = time.process_time()
    network = initial_network("small", given.start, switches={"class_mosaic": False})
    both = initial_network("small", given.start, switches={"class_mosaic": True}, backbone=str(given.mosaic))
    assert both.semantic is not None
    assert both.semantic.mosaic is not None
    mosaic = both.semantic.mosaic.requires_grad_()
    with torch.no_grad():
        mosaic.translation.weight.copy_(torch.from_numpy(np.load(given.table)).clamp(min=1e-6).log().T)
    examples = [
        example
        for kind, folders in (("photos", given.photos), ("rooms", given.rooms))
        for position, folder in enumerate(folders)
        for example in read_examples(
            folder,
            network.classes.names,
            known_by_both(network, mosaic, kind == "photos"),
            kind == "photos",
            kind == "rooms" or position > 0,
        )
    ]
    print(f"{len(examples)} images, {time.process_time() - began:.0f} core-seconds", flush=True)
    enlargement, mosaic.enlargement = mosaic.enlargement, 1.0
    published = deepcopy(mosaic.state_dict())
    average = learn(
        mosaic,
        parameter_groups(mosaic),
        lambda images, *others: loss_of(mosaic(images), *others),
        examples,
        given.steps,
        given.seed,
    )
    assert isinstance(average, Mosaic)
    trained = average.state_dict()
    average.load_state_dict(
        {
            name: one.lerp(trained[name], given.trained) if one.is_floating_point() else one
            for name, one in published.items()
        }
    )
    both.semantic.mosaic = average
    assert both.classes is not None
    for name in STILL_UNKNOWN:
        average.mixture.known[both.classes.names.index(name)] = False
    both.semantic.mosaic.enlargement = enlargement
    save(
        given.out,
        both,
        {"description": f"small with MOSAIC, trained on for {given.steps} steps", "seed": f"{given.seed}"},
    )


if __name__ == "__main__":
    main()

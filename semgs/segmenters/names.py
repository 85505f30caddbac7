"""Class names of common vocabularies, and which of ScanNet's 20 classes each one means.

Names are compared in lower case, without what data sets append to them ("-merged", "-stuff", "-other"). A name that means something which none of
the 20 classes covers is ignored: it says nothing about them.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from semgs.data.tables.classes import SCANNET20, ClassTable

LEAST_KNOWN = 0.5
"""At least this share of the names of a table must be known."""

SAME = {
    "wall": "wall, wall-brick, wall-stone, wall-tile, wall-wood, wall-concrete, wall-panel, wall-other, column, pillar, fireplace, shower stall, "
    "shower door, screen door",
    "floor": "floor, floor-wood, floor-tile, floor-marble, floor-stone, floor-other, rug, carpet, floor mat, mat",
    "cabinet": "cabinet, cupboard, wardrobe, chest of drawers, dresser, night stand, nightstand, buffet, dishwasher, oven",
    "bed": "bed, cradle, pillow, blanket",
    "chair": "chair, armchair, swivel chair, seat, stool, bench",
    "sofa": "sofa, couch, cushion",
    "table": "table, dining table, coffee table, pool table",
    "door": "door",
    "window": "window, windowpane",
    "bookshelf": "bookshelf, bookcase, shelf, shelves, book, books",
    "picture": "picture, painting, poster, bulletin board, board, whiteboard",
    "counter": "counter, countertop, kitchen island, bar",
    "desk": "desk",
    "curtain": "curtain, blind, blinds, window-blind",
    "refrigerator": "refrigerator, fridge",
    "shower curtain": "shower curtain",
    "toilet": "toilet",
    "sink": "sink",
    "bathtub": "bathtub",
    "otherfurniture": "otherfurniture, other furniture, furniture, furniture-other, otherstructure, otherprop, stove, ottoman, washer, microwave, "
    "hood, stairs, stairway, step, staircase, bannister, banister, railing, rack, piano, case, booth, stage, pier, grandstand, base, escalator",
}  # fmt: skip
"""For each of the 20 classes, the names that mean it."""

IGNORED = (
    "ceiling, ceiling-tile, lamp, light, chandelier, sconce, mirror, radiator, plant, flower, houseplant, potted plant, vase, box, bag, clothes, apparel, "
    "towel, paper, cardboard, person, animal, bottle, wine glass, cup, fork, knife, spoon, bowl, plate, glass, tray, pot, basket, barrel, ball, food, fruit, "
    "clock, fan, television, television receiver, tv, computer, monitor, crt screen, screen, laptop, mouse, remote, keyboard, cell phone, toaster, "
    "hair drier, toothbrush, teddy bear, scissors, plaything, sculpture, flag, ashcan, signboard, trade name, banner, shower, textile, cloth, napkin, "
    "utensil, plastic, metal, wood, structural, solid, background, void, unlabeled, unknown, net, cage, backpack, umbrella, handbag, tie, suitcase, "
    "frisbee, skis, snowboard, sports ball, kite, baseball bat, baseball glove, skateboard, surfboard, tennis racket, banana, apple, sandwich, orange, "
    "broccoli, carrot, hot dog, pizza, donut, cake, salad, vegetable, bicycle, car, motorcycle, airplane, bus, train, truck, boat, traffic light, "
    "fire hydrant, stop sign, parking meter, bird, cat, dog, horse, sheep, cow, elephant, bear, zebra, giraffe, building, sky, tree, road, grass, "
    "sidewalk, earth, mountain, water, house, sea, field, fence, rock, sand, skyscraper, path, runway, river, bridge, hill, palm, arcade machine, "
    "hovel, tower, awning, streetlight, dirt track, pole, land, van, ship, fountain, conveyer belt, canopy, swimming pool, waterfall, tent, minibike, "
    "tank, lake, gravel, platform, playingfield, railroad, roof, snow, pavement, dirt, branch, bush, clouds, fog, ground, leaves, mud, moss, stone, "
    "straw, building-other, sky-other, water-other, food-other, plant-other, textile-other, rock-merged, brick"
)  # fmt: skip
"""Names that say nothing about the 20 classes."""

_ENDINGS = re.compile(r"-(merged|stuff|other)$")
_MEANING = {name.strip(): SCANNET20.index(label) for label, names in SAME.items() for name in names.split(",")}
_IGNORED = frozenset(name.strip() for name in IGNORED.split(","))


@dataclass(frozen=True)
class Correspondence:
    """How much each class of one table speaks for each class of another.

    Attributes:
        table: P(our class | their class) [their class, our class]; a row of zeros says nothing.
        classes: ours.
        unknown: names of theirs that are neither mapped nor ignored.
    """

    table: Float32[np.ndarray, "theirs ours"]
    classes: ClassTable
    unknown: tuple[str, ...] = ()

    def __call__(self, probabilities: Float[Tensor, "*batch theirs h w"]) -> Float[Tensor, "*batch ours h w"]:
        """Distributions over our classes; uniform where nothing that they say is about them.

        Args:
            probabilities: over their classes.
        """
        table = torch.from_numpy(self.table).to(probabilities)
        found = torch.einsum("...chw,ck->...khw", probabilities, table)
        known = found.sum(-3, keepdim=True)
        # What is left over says nothing, so it is spread evenly.
        return found + (1 - known).clamp(min=0) / len(self.classes)


def scannet20_of(names: Sequence[str]) -> Correspondence:
    """The correspondence by name of a table of classes with ScanNet's 20.

    Raises:
        ValueError: less than half of the names are known; the unknown ones are listed.
    """
    table = np.zeros((len(names), len(SCANNET20)), np.float32)
    unknown: list[str] = []
    for row, name in enumerate(names):
        meaning = meaning_of(name)
        if meaning is not None:
            table[row, meaning] = 1
        elif not is_ignored(name):
            unknown.append(name)
    if len(names) - len(unknown) < LEAST_KNOWN * len(names):
        raise ValueError(
            f"{len(unknown)} of {len(names)} class names are unknown ({', '.join(unknown)}); at least half must be known"
        )
    return Correspondence(table, SCANNET20, tuple(unknown))


def meaning_of(name: str) -> int | None:
    """The label among ScanNet's 20 that a name means; None for no label."""
    return next((_MEANING[form] for form in _forms(name) if form in _MEANING), None)


def is_ignored(name: str) -> bool:
    """Whether a name is known to say nothing about the 20 classes."""
    return any(form in _IGNORED for form in _forms(name))


def _forms(name: Any) -> list[str]:
    """A name, the name without endings, and its first synonym, all in lower case."""
    plain = str(name).strip().lower().replace("_", " ")
    first = re.split(r"[,;]", plain)[0].strip()
    return [plain, _ENDINGS.sub("", plain), first, _ENDINGS.sub("", first)]

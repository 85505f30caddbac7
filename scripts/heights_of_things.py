"""How high the things of each class stand or hang in generated rooms: writes semgs/robotics/heights.json.

    python scripts/heights_of_things.py ROOMS [ROOMS ...] --out semgs/robotics/heights.json

The rooms need true classes, depth and things, as `semgs rooms` draws them, and are those for training. Of each pair of neighbouring frames, the box around what both show
of a thing counts once; its bottom is measured from the floor, which is at z = 0. The file has the 1st and 99th percentile of each class, to a centimetre.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

from semgs.data.scenes import open_scene, scene_paths
from semgs.data.tables.classes import SCANNET20
from semgs.evaluation.scoring.panoptic import true_boxes
from semgs.files.atomic import write_json
from semgs.files.errors import InputError

SIZE = (240, 320)
PERCENTILES = (1, 99)
ANYTHING = "otherfurniture"
"""A class that anything may have, at any height."""


def bottoms(path: Path) -> list[tuple[str, float]]:
    """Class and height of the bottom of each thing in a room [m]."""
    scene, found = open_scene(path), []
    for first in range(0, len(scene.frames) - 1, 2):
        at = (first, first + 1)
        views = [scene.read([one], SIZE, fit="stretch") for one in at]
        numbers = [scene.frames[one].things(view) for one, view in zip(at, views, strict=True)]
        boxes = true_boxes(list(zip(views, numbers, strict=True)), SCANNET20, np.eye(3))
        if boxes is None:
            raise InputError(path, "a scene with true classes, depth and things", "one without")
        found += [(SCANNET20.names[label], box.bottom) for label, box in boxes]
    return found


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="+", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    heights, count = defaultdict(list), 0
    for path in (one for folder in arguments.rooms for one in scene_paths(folder)):
        count += 1
        for name, bottom in bottoms(path):
            heights[name].append(bottom)
    limits = {
        name: [round(float(one), 2) for one in np.percentile(heights[name], PERCENTILES)]
        for name in SCANNET20.names
        if name in heights and name != ANYTHING
    }
    print(f"{count} rooms: limits for {len(limits)} classes")
    write_json(arguments.out, {"rooms": count, "percentiles": PERCENTILES, "bottoms": limits})


if __name__ == "__main__":
    try:
        main()
    except InputError as error:
        sys.exit(f"error: {error}")

"""Check the depth spread: how often the true depth is within one and two spreads of the predicted depth.

    python scripts/depth_spread.py WEIGHTS SCENES [SCENES ...]

The input views are each scene's two middle frames at 240x320, which need true depth. Prints a Markdown table. For a normal distribution of log
depth, the shares would be 68 % and 95 %.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence

import torch

from semgs.data.scenes import open_scene, scene_paths
from semgs.data.views import Views
from semgs.files.errors import InputError
from semgs.model.weights.load import load

SIZE = (240, 320)


def pairs(folder: str) -> Iterator[Views]:
    """The two middle frames of every scene."""
    for path in scene_paths(folder):
        scene = open_scene(path)
        middle = len(scene) // 2
        views = scene.read([middle - 1, middle], SIZE)
        if views.depths is None:
            raise InputError(path, "a scene with true depth", "one without")
        yield views


def markdown(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in Markdown."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows))


@torch.no_grad()
def table(weights: str, folders: list[str]) -> str:
    """The shares as Markdown."""
    model = load(weights)
    rows = []
    for folder in folders:
        off, spreads = [], []
        for views in pairs(folder):
            encoding, known = model(views), views.depths > 0
            off.append((encoding.depths[known] / views.depths[known]).log().abs() / encoding.depth_spread[known])
            spreads.append(encoding.depth_spread[known])
        one, two = ((torch.cat(off) <= n).double().mean() for n in (1, 2))
        rows.append([folder, f"{2 * len(off)}", f"{one:.0%}", f"{two:.0%}", f"{torch.cat(spreads).median():.3f}"])
    return markdown(["scenes", "images", "within one", "within two", "median spread"], rows)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    try:
        print(table(sys.argv[1], sys.argv[2:]))
    except InputError as error:
        sys.exit(f"error: {error}")

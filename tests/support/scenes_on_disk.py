"""Small scenes with labels and depths on disk."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch
from posed import posed_views

from semgs.data.views import Views
from semgs_rooms.sets.room_scenes import write_views

SIZE = (24, 32)
TABLE = {
    "name": "three",
    "classes": [
        {"name": "wall", "colour": [174, 199, 232], "ids": [0]},
        {"name": "seat", "colour": [188, 189, 34], "ids": [4, 5]},
        {"name": "floor", "colour": [152, 223, 138], "ids": [1]},
    ],
    "ignored": [2, 3],
}
"""A table whose numbers are those of six of ScanNet's classes."""


def labelled_views(seed: int, frames: int = 6, labels: tuple[int, ...] = (0, 1, 4)) -> Views:
    """Posed views, each pixel with one of the labels."""
    generator = torch.Generator().manual_seed(seed)
    views = posed_views(frames, SIZE, seed=seed)
    chosen = torch.tensor(labels, dtype=torch.uint8)[
        torch.randint(0, len(labels), (frames, *SIZE), generator=generator)
    ]
    depths = 1 + 3 * torch.rand(frames, *SIZE, generator=generator)
    return replace(views, labels=chosen, depths=depths)


def write_labelled(
    folder: Path,
    seed: int,
    *,
    frames: int = 6,
    labels: tuple[int, ...] = (0, 1, 4),
    change: Callable[[dict], object] = lambda scene: None,
) -> Path:
    """A scene folder of such views; `change` edits its transforms.json."""
    folder.mkdir(parents=True)
    write_views(folder, labelled_views(seed, frames, labels), 95)
    described = json.loads((folder / "transforms.json").read_text())
    change(described)
    (folder / "transforms.json").write_text(json.dumps(described))
    return folder


def unlabel(scene: dict) -> None:
    for frame in scene["frames"]:
        del frame["label_file_path"]


def write_table(path: Path, table: dict | None = None) -> Path:
    path.write_text(json.dumps(TABLE if table is None else table))
    return path

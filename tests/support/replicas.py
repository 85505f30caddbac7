"""A room as Semantic-NeRF rendered those of Replica."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from miniatures import Miniature, text, write_picture

from semgs.data.tables.classes import IGNORE, SCANNET20

ID_OF = {
    "wall": 93, "floor": 40, "cabinet": 18, "bed": 7, "chair": 20, "sofa": 76, "table": 80, "door": 37, "window": 97, "picture": 59,
    "counter": 33, "desk": 34, "curtain": 30, "refrigerator": 67, "toilet": 84, "sink": 74, "bathtub": 4, "otherfurniture": 96,
}  # fmt: skip
"""A Replica id of each of the 20 classes that Replica has; it has neither bookshelves nor shower curtains."""


def class_ids(labels: np.ndarray) -> np.ndarray:
    """A class map in Replica's ids, void where there is no label, blinds (which are no class) where Replica has none."""
    ids = np.full(256, 12, np.uint8)
    for name, number in ID_OF.items():
        ids[SCANNET20.index(name)] = number
    ids[IGNORE] = 0
    return ids[labels]


def write_replica(folder: Path, room: Miniature, *, start: int = 0) -> Path:
    """A sequence whose pictures begin at a number: before it there are poses alone."""
    for index in range(len(room)):
        number = start + index
        write_picture(folder / f"rgb/rgb_{number}.png", room.images[index])
        write_picture(folder / f"depth/depth_{number}.png", room.depths[index])
        write_picture(folder / f"semantic_class/semantic_class_{number}.png", class_ids(room.labels[index]))
        write_picture(folder / f"semantic_class/vis_sem_class_{number}.png", room.images[index])
    lines = [text(np.eye(4).reshape(1, 16))] * start + [text(pose.reshape(1, 16)) for pose in room.poses]
    (folder / "traj_w_c.txt").write_text("".join(lines))
    return folder

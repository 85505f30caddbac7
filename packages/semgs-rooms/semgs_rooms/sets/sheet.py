"""Contact sheets: random frames of many rooms next to their labels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import UInt8
from PIL import Image, ImageDraw

from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs_rooms.assets.asset_library import Library
from semgs_rooms.plans.style import Style
from semgs_rooms.sets.room_stream import sample

FRAMES = 48
COLUMNS = 6
FRAME_SIZE = (120, 160)
LEGEND_PX = 20


def contact_sheet(
    seed: int,
    style: Style = "home",
    library: Library | None = None,
    *,
    done: Callable[[int], None] = lambda count: None,
) -> UInt8[np.ndarray, "h w 3"]:
    """48 frames of 48 rooms in eight rows of six, each with its labels to the right, above a legend of the classes.

    Args:
        seed: of the rooms; the first 48 are shown.
        style: of the rooms.
        library: meshes and images to use, None for none.
        done: called with the number of finished frames.

    Raises:
        ValueError: the seed is negative.
        ImportError: embreex is not installed; the message names the extra to install.
    """
    colours = np.zeros((IGNORE + 1, 3), np.uint8)
    colours[: len(SCANNET20)] = SCANNET20.colours
    tiles = []
    for index in range(FRAMES):
        views, _ = sample(seed, index, size=FRAME_SIZE, contexts=1, targets=0, library=library, style=style)
        assert views.labels is not None
        picture = (views.images[0].permute(1, 2, 0) * 255).round().byte().numpy()
        tiles.append(np.concatenate((picture, colours[views.labels[0].numpy()]), axis=1))
        done(index + 1)
    rows = [np.concatenate(tiles[start : start + COLUMNS], axis=1) for start in range(0, FRAMES, COLUMNS)]
    return np.concatenate((*rows, _legend(rows[0].shape[1])))


def _legend(width: int) -> UInt8[np.ndarray, "h w 3"]:
    """Two lines of class names on their colours."""
    per_line = len(SCANNET20) // 2
    cell = width // per_line
    strip = Image.new("RGB", (width, 2 * LEGEND_PX), "white")
    draw = ImageDraw.Draw(strip)
    for label, (name, colour) in enumerate(zip(SCANNET20.names, SCANNET20.colours, strict=True)):
        x, y = (label % per_line) * cell, (label // per_line) * LEGEND_PX
        draw.rectangle((x, y, x + LEGEND_PX - 2, y + LEGEND_PX - 2), fill=colour)
        draw.text((x + LEGEND_PX + 4, y + 4), name, fill="black")
    return np.array(strip)

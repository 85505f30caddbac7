"""Endless labelled samples of rooms, each a pure function of (seed, index).

Different seeds have nothing in common: rooms, paths and cameras depend on a hash of (seed, index). So training and validation need
only different seeds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64, UInt8
from PIL import Image, ImageDraw
from torch.utils.data import Dataset

from semgs.data.tables.classes import IGNORE, SCANNET20
from semgs.data.views import INDOOR_DEPTH_RANGE, Views
from semgs.geometry.cameras import Cameras
from semgs_rooms.assets.asset_library import Library
from semgs_rooms.drawing.film import develop, draw_film
from semgs_rooms.drawing.room import Room, build_room
from semgs_rooms.drawing.shading import RoomCamera, photograph
from semgs_rooms.plans.style import Style
from semgs_rooms.sets.carried_cameras import CameraPath, draw_camera, draw_habit, draw_path, view_overlap

Count = int | tuple[int, int]
"""A number of views, or its lowest and highest value."""

SHEET_FRAMES = 48
SHEET_COLUMNS = 6
FRAME_SIZE = (120, 160)
LEGEND_PX = 20


def sample(
    seed: int,
    index: int,
    *,
    size: tuple[int, int],
    contexts: int,
    targets: int,
    library: Library | None = None,
    style: Style = "home",
) -> tuple[Views, Views]:
    """Input and target views of one room, with labels and depths.

    Input views are one to four steps of a hand-held camera apart, or closer if neighbours would overlap too little: by less than 60 to
    90 %, in a third of the homes 25 to 60 %.
    Target views are between them and slightly beyond. The same arguments give the same bits.

    Args:
        seed: of the samples.
        index: of the sample.
        size: image (height, width) [px].
        contexts: number of input views, at least 1.
        targets: number of target views, may be 0.
        library: meshes and images to use, None for none.
        style: of the room.

    Raises:
        ValueError: a count or a side is too small, seed or index is negative, or there is no such style.
        InputError: a file of the library cannot be read.
        ImportError: embreex is not installed; the message names the extra to install.
    """
    if contexts < 1 or targets < 0 or min(size) < 1:
        raise ValueError(
            f"contexts is {contexts}, targets {targets} and size {size}; expected contexts >= 1, targets >= 0 and positive sides"
        )
    rng = generator(seed, index)
    room = build_room(rng, library, style)
    habit = draw_habit(rng, style)
    camera = draw_camera(rng, size, habit)
    span = (contexts - 1) / 2
    gap = float(rng.integers(1, 5))
    path = draw_path(rng, room, camera, gap * (span + 0.5), habit).change_pace(gap)
    path = keep_overlap(rng, room, path, camera, habit.overlap)
    places = np.arange(contexts) - span
    strata = (np.arange(targets) + rng.uniform(0, 1, targets)) / max(targets, 1)
    between = -span - 0.3 + strata * (2 * span + 0.6)
    rng.shuffle(between)
    poses = [path.pose(float(s)) for s in (*places, *between)]
    views = shoot(rng, room, poses, camera)
    return views.select(range(contexts)), views.select(range(contexts, contexts + targets))


def generator(seed: int, index: int) -> np.random.Generator:
    """The random numbers of a sample.

    Raises:
        ValueError: seed or index is negative.
    """
    if seed < 0 or index < 0:
        raise ValueError(f"seed is {seed} and index {index}; expected 0 or more")
    return np.random.default_rng((seed, index))


def keep_overlap(
    rng: np.random.Generator, room: Room, path: CameraPath, camera: RoomCamera, shares: tuple[float, float]
) -> CameraPath:
    """The path, slowed down until views one unit of s apart overlap by a random share in a range."""
    least = rng.uniform(*shares)
    for _ in range(6):
        if view_overlap(room, path.pose(-0.5), path.pose(0.5), camera) >= least:
            break
        path = path.change_pace(0.75)
    return path


def shoot(
    rng: np.random.Generator, room: Room, poses: Sequence[Float64[np.ndarray, "4 4"]], camera: RoomCamera
) -> Views:
    """Views from poses, with one camera whose exposure suits the first."""
    frames = [photograph(room, pose, camera) for pose in poses]
    film = draw_film(rng, frames[0].radiance)
    pictures = np.stack([develop(rng, film, frame.radiance) for frame in frames])
    count = len(frames)
    return Views(
        images=torch.from_numpy(pictures).permute(0, 3, 1, 2).float() / 255,
        cameras=Cameras(np.stack(poses), np.broadcast_to(camera.intrinsics, (count, 3, 3)).copy(), camera.size),
        depth_range=np.broadcast_to(INDOOR_DEPTH_RANGE, (count, 2)).copy(),
        labels=torch.from_numpy(np.stack([frame.labels for frame in frames])),
        depths=torch.from_numpy(np.stack([frame.depths for frame in frames])),
    )


@dataclass(frozen=True, eq=False)
class RoomSamples(Dataset):
    """The first `length` samples of a seed as a data set for loaders. Item k is (input views, target views), a pure function of k.

    Attributes:
        seed: of the samples.
        size: image (height, width) [px].
        contexts: number of input views, or a (lowest, highest) range.
        targets: number of target views, or a range.
        length: number of samples.
        group: samples k with equal k // group have equal numbers of views, so that they can be stacked. Set it to the size of
            a batch that is filled in order.
        library: meshes and images to use, None for none.

    Raises:
        ValueError: a range is empty, or length or group is not positive.
    """

    seed: int
    size: tuple[int, int]
    contexts: Count
    targets: Count
    length: int
    group: int = 1
    library: Library | None = None

    def __post_init__(self) -> None:
        if self.length < 1 or self.group < 1:
            raise ValueError(f"length is {self.length} and group {self.group}; expected positive numbers")
        if any(low > high for low, high in self.ranges):
            raise ValueError(f"contexts are {self.contexts} and targets {self.targets}; expected (lowest, highest)")

    @property
    def ranges(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Lowest and highest number of input views, and of target views."""
        counts = (self.contexts, self.targets)
        contexts, targets = ((count, count) if isinstance(count, int) else count for count in counts)
        return contexts, targets

    def __len__(self) -> int:
        return self.length

    def __getitem__(self, k: int) -> tuple[Views, Views]:
        """Input and target views of sample k.

        Raises:
            IndexError: k is not in 0 .. length - 1.
        """
        contexts, targets = self.counts(k)
        return sample(self.seed, k, size=self.size, contexts=contexts, targets=targets, library=self.library)

    def counts(self, k: int) -> tuple[int, int]:
        """Number of input and target views of sample k.

        Raises:
            IndexError: k is not in 0 .. length - 1.
        """
        if not 0 <= k < self.length:
            raise IndexError(f"sample {k} of {self.length}")
        draws = np.random.default_rng((self.seed, k // self.group, 1))
        contexts, targets = (int(draws.integers(low, high + 1)) for low, high in self.ranges)
        return contexts, targets


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
    for index in range(SHEET_FRAMES):
        views, _ = sample(seed, index, size=FRAME_SIZE, contexts=1, targets=0, library=library, style=style)
        assert views.labels is not None
        picture = (views.images[0].permute(1, 2, 0) * 255).round().byte().numpy()
        tiles.append(np.concatenate((picture, colours[views.labels[0].numpy()]), axis=1))
        done(index + 1)
    rows = [
        np.concatenate(tiles[start : start + SHEET_COLUMNS], axis=1) for start in range(0, SHEET_FRAMES, SHEET_COLUMNS)
    ]
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

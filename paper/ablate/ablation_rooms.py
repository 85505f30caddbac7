"""The rooms of an ablation: to train all variants on, and to evaluate them on. They are drawn once, into its folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from semgs.cli.progress import show_progress
from semgs.run.usage_errors import what_the_user_gave

if TYPE_CHECKING:
    from semgs.training.training_settings import TrainingSettings
    from semgs_rooms.assets.splits import Split
    from semgs_rooms.plans.style import Style

TESTED = 48
"""Rooms of a set to evaluate on."""
FRAMES = 5
"""Images of each room."""


@dataclass(frozen=True)
class Drawn:
    """A set of rooms.

    Attributes:
        folder: for it.
        style: of the rooms.
        split: of the assets.
        scenes: number of rooms.
    """

    folder: Path
    style: Style
    split: Split
    scenes: int = TESTED


def draw_rooms(drawn: Drawn, settings: TrainingSettings, workers: int) -> Path:
    """Draw the rooms that are missing in a set, at the size and with the assets of the settings. Returns its folder.

    Raises:
        UsageError: the folder has other rooms.
        InputError: the folder or the assets cannot be used.
    """
    from semgs.training.data.data_settings import VALIDATION_SEED
    from semgs_rooms.sets.dataset import RoomSettings, write_dataset
    from semgs_rooms.training_rooms import library

    seed = settings.seed if drawn.split == "training" else VALIDATION_SEED
    own = library(settings.assets, drawn.split)
    rooms = RoomSettings(seed, settings.size, FRAMES, drawn.style, own)
    with what_the_user_gave(), show_progress("Generating rooms", drawn.scenes) as done:
        write_dataset(drawn.folder, rooms, drawn.scenes, workers=workers, done=done)
    return drawn.folder

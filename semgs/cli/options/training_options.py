"""Training settings on the command line: a preset's name, then what to change. No torch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import tyro

from semgs.data.tables.class_files import read_class_file
from semgs.data.tables.classes import ClassTable
from semgs.run.options.types import height_and_width, one_word, optional, shown_size
from semgs.training.presets import PRESETS
from semgs.training.training_settings import TrainingSettings

CLASS_FILE = one_word(
    "FILE",
    lambda text: None if text == "None" else read_class_file(text).table,
    lambda table: "None" if table is None else table.name,
)
"""A class table, given by its file."""


def show_default(default: str) -> str:
    """The default as the help shows it; nothing if it is empty."""
    return "" if default in ("", "None") else f"(default: {default})"


@dataclass(frozen=True, kw_only=True)
class TypedSettings(TrainingSettings):
    """`TrainingSettings` as the command line parses and shows them."""

    model: Annotated[str, tyro.conf.Suppress]
    data: Annotated[tuple[str, ...], tyro.conf.arg(help_behavior_hint=show_default)] = TrainingSettings.data
    size: Annotated[tuple[int, int], one_word("HxW", height_and_width, shown_size)] = TrainingSettings.size
    classes: Annotated[ClassTable | None, CLASS_FILE, optional()] = TrainingSettings.classes
    class_weights: Annotated[
        tuple[float, ...] | Literal["inverse_root_frequency", "inverse_fourth_root_frequency"] | None,
        tyro.conf.arg(help_behavior_hint=show_default),
    ] = TrainingSettings.class_weights
    assets: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = TrainingSettings.assets
    preset: Annotated[str, tyro.conf.Suppress] = TrainingSettings.preset


def _preset(name: str) -> object:
    """A preset as a subcommand."""
    preset = PRESETS[name]
    return tyro.conf.subcommand(name, default=preset(), description=preset.__doc__, constructor=TypedSettings)


PresetSettings = (
    Annotated[TrainingSettings, _preset("small")]
    | Annotated[TrainingSettings, _preset("small_plain")]
    | Annotated[TrainingSettings, _preset("base")]
    | Annotated[TrainingSettings, _preset("paper")]
    | Annotated[TrainingSettings, _preset("base_text")]
)
"""The name of a preset, then the settings to change."""

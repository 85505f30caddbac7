"""Training settings on the command line: a preset's name, then what to change. No torch."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, Any

import tyro

from semgs.data.class_files import read_class_file
from semgs.data.classes import ClassTable
from semgs.training import presets
from semgs.training.settings import TrainingSettings


def _size(given: list[str]) -> tuple[int, int]:
    """(height, width) of "240x320".

    Raises:
        ValueError: it is written otherwise.
    """
    match = re.fullmatch(r"(\d{1,5})[x×X](\d{1,5})", given[0])
    if not match:
        raise ValueError(f"expected height x width in pixels, such as 240x320, found {given[0]!r}")
    return int(match[1]), int(match[2])


HEIGHT_BY_WIDTH = tyro.constructors.PrimitiveConstructorSpec(
    nargs=1,
    metavar="HxW",
    instance_from_str=_size,
    is_instance=lambda value: isinstance(value, tuple) and len(value) == 2,
    str_from_instance=lambda size: [f"{size[0]}x{size[1]}"],
)
"""How a size is written on the command line, here as everywhere."""

CLASS_FILE = tyro.constructors.PrimitiveConstructorSpec(
    nargs=1,
    metavar="FILE",
    instance_from_str=lambda given: None if given[0] == "None" else read_class_file(given[0]).table,
    is_instance=lambda value: value is None or isinstance(value, ClassTable),
    str_from_instance=lambda table: ["None" if table is None else table.name],
)
"""A class table is named by its file; from there on the table itself travels."""


@dataclass(frozen=True)
class TypedSettings(TrainingSettings):
    """The fields of `TrainingSettings` that the command line writes in its own way; all others it reads as they are.

    Only its annotations are used. A call makes plain `TrainingSettings`, which compare equal to those of a preset.
    """

    model: Annotated[str, tyro.conf.Suppress]
    size: Annotated[tuple[int, int], HEIGHT_BY_WIDTH] = TrainingSettings.size
    classes: Annotated[ClassTable | None, CLASS_FILE, tyro.conf.arg(help_behavior_hint="")] = TrainingSettings.classes
    assets: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = TrainingSettings.assets
    preset: Annotated[str, tyro.conf.Suppress] = TrainingSettings.preset

    def __new__(cls, **values: Any) -> TrainingSettings:  # type: ignore[misc]
        """The settings with these values."""
        return TrainingSettings(**values)


def _preset(name: str) -> object:
    """A preset as a subcommand, with its other name."""
    preset = presets.PRESETS[name]
    other = presets.OTHER_NAMES.get(name)
    return tyro.conf.subcommand(
        name,
        default=preset(),
        description=preset.__doc__,
        aliases=None if other is None else [other],
        constructor=TypedSettings,
    )


PresetSettings = (
    Annotated[TrainingSettings, _preset("small")]
    | Annotated[TrainingSettings, _preset("base")]
    | Annotated[TrainingSettings, _preset("paper")]
    | Annotated[TrainingSettings, _preset("base_text")]
)
"""A preset's name, then what shall differ from it."""

"""Differences between the settings of two runs, in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import PurePath

from semgs.data.tables.classes import ClassTable
from semgs.training.training_settings import PLACES, TrainingSettings


def differences(settings: TrainingSettings, reference: TrainingSettings) -> dict[str, tuple[object, object]]:
    """The fields that differ: name to (value, value in the reference)."""
    names = [setting.name for setting in fields(settings) if setting.compare]
    pairs = {name: (getattr(settings, name), getattr(reference, name)) for name in names}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def find_changes(settings: TrainingSettings, reference: TrainingSettings) -> dict[str, tuple[object, object]]:
    """The fields that differ; the same file or folder in another place is no difference."""

    def last_part(value: object) -> object:
        if isinstance(value, tuple):
            return tuple(map(last_part, value))
        return PurePath(str(value)).name

    return {
        name: pair
        for name, pair in differences(settings, reference).items()
        if name not in PLACES or last_part(pair[0]) != last_part(pair[1])
    }


def list_changes(changes: Mapping[str, tuple[object, object]], here: str) -> str:
    """Differences from an existing run in one phrase; `here` names the other values, such as "requested"."""
    return ", ".join(f"{name} = {describe(run)} there, {describe(own)} {here}" for name, (own, run) in changes.items())


def describe(value: object) -> str:
    """A setting's value in words."""
    return f"{value.name} ({', '.join(value.names)})" if isinstance(value, ClassTable) else str(value)

"""Differences between the settings of two runs, in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields

from semgs.data.tables.classes import ClassTable
from semgs.training.training_settings import BEST, PLACES, WEIGHTS, TrainingSettings, name_place


def differences(settings: TrainingSettings, reference: TrainingSettings) -> dict[str, tuple[object, object]]:
    """The fields that differ: name to (value, value in the reference)."""
    names = [setting.name for setting in fields(settings) if setting.compare]
    pairs = {name: (getattr(settings, name), getattr(reference, name)) for name in names}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def find_changes(settings: TrainingSettings, reference: TrainingSettings) -> dict[str, tuple[object, object]]:
    """The fields that differ; the same file or folder in another place is no difference."""
    return {
        name: pair
        for name, pair in differences(settings, reference).items()
        if name not in PLACES or not _same_name(*pair)
    }


def _same_name(one: object, other: object) -> bool:
    """Whether two places may be of the same file or folder; weights of a run may lack its name."""
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(_same_name, one, other))
    short, long = sorted((name_place(str(one)), name_place(str(other))), key=len)
    return short == long or (short in (WEIGHTS, BEST) and long.endswith(f"/{short}"))


def list_changes(changes: Mapping[str, tuple[object, object]], here: str) -> str:
    """Differences from an existing run in one phrase; `here` names the other values, such as "requested"."""
    return ", ".join(f"{name} = {describe(run)} there, {describe(own)} {here}" for name, (own, run) in changes.items())


def describe(value: object) -> str:
    """A setting's value in words; "none" if it is empty."""
    if value in ("", (), None):
        return "none"
    return f"{value.name} ({', '.join(value.names)})" if isinstance(value, ClassTable) else str(value)

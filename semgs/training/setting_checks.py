"""Refuse settings whose values cannot be used. Each part of a training checks its own."""

from __future__ import annotations


def check_values(values: object, **checks: tuple[bool, str]) -> None:
    """Refuse the first value that does not hold.

    Args:
        values: the settings, whose attributes have the names of the checks; "augmentation.roll" is one of an attribute.
        checks: for each name whether the value holds, and what is expected otherwise.

    Raises:
        ValueError: a value does not hold.
    """
    for name, (holds, expected) in checks.items():
        if not holds:
            value = values
            for attribute in name.split("."):
                value = getattr(value, attribute)
            raise ValueError(f"{name} is {value!r}; expected {expected}")

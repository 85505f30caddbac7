"""Sources: where training scenes come from, and in which proportion."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction

ROOMS = "rooms"
"""The name of generated rooms among the sources."""


@dataclass(frozen=True)
class Source:
    """One source of training scenes.

    Attributes:
        path: a scene or a folder of scenes; "rooms" for generated rooms.
        weight: its share of the samples, relative to the weights of the other sources.
    """

    path: str
    weight: Fraction

    @classmethod
    def parsed(cls, text: str) -> Source:
        """From "PATH=WEIGHT", or "PATH" for weight 1.

        Raises:
            ValueError: the weight is not a positive number, or there is no path.
        """
        match = re.fullmatch(r"([^=].*?)(?:=([^=/]*))?", text)
        try:
            weight = Fraction(match[2] or "1" if match else "")
        except (ValueError, ZeroDivisionError):
            weight = Fraction(0)
        if match is None or weight <= 0:
            raise ValueError(f"data is {text!r}; expected {ROOMS} or DIR, optionally with =WEIGHT, a positive number")
        return cls(match[1], weight)

    @property
    def is_rooms(self) -> bool:
        """Whether its scenes are generated rooms."""
        return self.path == ROOMS
